"""``cubicfish rig``: corners of several cameras to rig.yaml, and reading it again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from equality import same_records
from reference import keys_of
from running import Run, run_cli
from simulated import CornerErrors
from simulated_rig import corner_target, simulated_rig
from synthetic_lenses import synthetic_lens

from cubicfish import CameraFileError, Rig, load_camera
from cubicfish.models.lift import lift_rotation
from cubicfish.rigs.rig import ErrorsInRig
from cubicfish.scene.truth import rotation_matrix
from cubicfish_cli import (
    RigEvaluateOptions,
    RigOptions,
    calibrate_rig_files,
    compare_rigs,
    evaluate_rig_files,
    load_rig,
    save_corners,
    save_target,
)
from cubicfish_cli.extensions.rigs.naming import named_by
from cubicfish_cli.words.sentences import render


def calibrate_pair(folder: Path) -> list[object]:
    """The command that calibrates both cameras of the folder."""
    corners = [folder / f"{name}.csv" for name in ("left", "right")]
    return ["rig", "calibrate", *corners, "-t", folder / "target.yaml"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Corners of two cameras and their target."""
    folder = tmp_path_factory.mktemp("rig")
    target = corner_target()
    lenses = [synthetic_lens("equisolid", (640, 480)), synthetic_lens("orthographic", (640, 480))]
    corners, _ = simulated_rig(
        lenses,
        [(np.zeros(3), np.zeros(3)), (np.array([0, 0.6, 0]), np.array([-100.0, 0, 0]))],
        target,
        8,
        distances=(50, 300),
        middle=(330, 330, 300),
        errors=CornerErrors(noise=0.1, shared=0, spread=0),
        candidates=5,
    )
    save_target(folder / "target.yaml", target)
    for name, own in zip(("left", "right"), corners, strict=True):
        save_corners(folder / f"{name}.csv", own)
    return folder


@pytest.fixture(scope="module")
def made(folder: Path) -> tuple[Path, dict[str, Any]]:
    said = run_cli(
        "rig", "calibrate", folder / "left.csv", folder / "right.csv", "-t", folder / "target.yaml",
        "-o", folder / "rig", "--refine-target", "off", "--json",
    )  # fmt: skip
    return folder / "rig", json.loads(said.stdout)


@pytest.mark.slow
def test_it_says_in_json_what_it_writes(made: tuple[Path, dict[str, Any]]) -> None:
    rig, record = made
    assert set(record) == set(keys_of("rig calibrate"))
    held = yaml.safe_load((rig / "rig.yaml").read_text())
    assert held["cubicfish_rig"] == 1
    assert held["cameras"] == record["cameras"]
    assert [one["name"] for one in record["cameras"]] == ["left", "right"]
    assert record["pairs"][0]["shots"] == 8
    assert np.linalg.norm(record["cameras"][1]["position"]) == pytest.approx(100, abs=3)
    assert record["fit"]["rms_px"] == pytest.approx(0.1414, rel=0.15)
    assert len(record["fit"]["per_shot"]) == 8
    inputs = held["made_by"]["inputs"]
    assert [Path(one["file"]).name for one in inputs] == ["left.csv", "right.csv"]


@pytest.mark.slow
def test_a_program_makes_the_same_rig(
    folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    by_call = calibrate_rig_files(
        RigOptions(
            cameras={"left": folder / "left.csv", "right": folder / "right.csv"},
            target=folder / "target.yaml",
            folder=tmp_path,
            refine_target="off",
        )
    )
    assert same_records(by_call.rig.as_record()["cameras"], made[1]["cameras"])
    assert [path.relative_to(tmp_path) for path in by_call.files] == [
        Path("rig.yaml"), Path("left/camera.yaml"), Path("right/camera.yaml"),
        Path("left/corners.csv"), Path("right/corners.csv"),
    ]  # fmt: skip


def test_what_is_written_reads_back(made: tuple[Path, dict[str, Any]]) -> None:
    rig, record = made
    read = load_rig(rig)
    for one, own in zip(read.cameras, record["cameras"], strict=True):
        assert one.rotation.tolist() == own["camera_from_rig"]["rotation"]
        assert one.covariance is not None
        assert one.covariance.tolist() == own["covariance"]
        assert (one.camera.P == load_camera(rig / one.name / "camera.yaml").camera.P).all()
    assert read.units == "mm"


def test_info_knows_rigs(run: Run, made: tuple[Path, dict[str, Any]]) -> None:
    rig, record = made
    found = json.loads(run("rig", "info", rig / "rig.yaml", "--json").stdout)
    assert set(found) <= set(keys_of("rig info"))
    assert found["rig"]["cameras"] == record["cameras"]
    said = run("rig", "info", rig).stdout
    assert "2 cameras, 8 shots" in said
    assert "left + right" in said


@pytest.mark.slow
def test_known_lenses_stay_and_exchanged_ones_are_named(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, _ = made
    args = calibrate_pair(folder)
    models = ["--lens", f"left={rig / 'left'}", "--lens", f"right={rig / 'right'}"]
    run(*args, *models, "-o", tmp_path / "held", "-q")
    for name in ("left", "right"):
        before, after = (
            load_camera(place / name / "camera.yaml") for place in (rig, tmp_path / "held")
        )
        assert (before.camera.P == after.camera.P).all()
    wrong = ["--lens", f"left={rig / 'right'}", "--lens", f"right={rig / 'left'}"]
    said = run(*args, *wrong, "-o", tmp_path / "wrong", code=1).stderr
    assert "cameras left and right are swapped" in said
    assert not (tmp_path / "wrong").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_a_page_shows_the_rig(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    lenses = [f"--lens={name}={made[0] / name}" for name in ("left", "right")]
    rig = tmp_path / "rig"
    args = calibrate_pair(folder)
    record = json.loads(run(*args, *lenses, "-o", rig, "--json").stdout)
    page = (rig / "report.html").read_text()
    assert 'id="rig-places-title"' in page
    assert "1 left" in page
    assert "2 right" in page
    assert f"{record['cameras'][1]['shift_sigma']:.3f}" in page
    assert "<h2" in page
    assert "Good" in page
    said = run("rig", "report", rig / "rig.yaml", "-o", tmp_path / "again.html").stdout
    assert "verdict: good" in said
    assert (tmp_path / "again.html").read_text() == page
    assert "exists" in run("rig", "report", rig, "-o", tmp_path / "again.html", code=1).stderr


def with_right(rig: Rig, **change: Any) -> Rig:
    """A rig whose second camera is another."""
    left, right = rig.cameras
    return replace(rig, cameras=(left, replace(right, **change)))


def wide(turn_deg: float, shift: float) -> np.ndarray:
    """A covariance of these standard deviations, root of the sum over three axes."""
    return np.diag(np.repeat([np.deg2rad(turn_deg), shift], 3) ** 2 / 3)


@pytest.mark.parametrize(
    ("change", "words", "level"),
    [
        ({"in_rig": ErrorsInRig(rms_px=2.0, alone_rms_px=0.2)}, "off by 2.00 px as a rig", "bad"),
        ({"in_rig": ErrorsInRig(rms_px=0.4, alone_rms_px=0.2)}, "off by 0.40 px as a rig", "care"),
        ({"in_rig": ErrorsInRig(rms_px=0.2, alone_rms_px=0.05)}, "", "good"),
        ({"covariance": wide(0.01, 5.0)}, "right is placed on the body only to", "care"),
        ({"covariance": wide(2.0, 0.1)}, "right is placed on the body only to", "bad"),
        ({"in_rig": ErrorsInRig(), "covariance": None}, "", "good"),
        # Cameras in one place: how far from there is no share of nothing.
        ({"translation": np.array([0.01, 0, 0]), "covariance": wide(0.01, 0.02)}, "", "good"),
        ({"translation": np.array([0.01, 0, 0]), "covariance": wide(0.01, 5.0)},
         "placed on the body only to within", "care"),
    ],
)  # fmt: skip
def test_a_rig_is_judged_by_its_figures(
    made: tuple[Path, dict[str, Any]], change: dict[str, Any], words: str, level: str
) -> None:
    rig = load_rig(made[0])
    assert rig.verdict.level == made[1]["verdict"]["level"] == "good"
    judged = with_right(rig, **change).verdict
    assert judged.level == level
    assert words in " ".join(render(one).what for one in judged.reasons)


def test_names_on_a_rigs_page_are_only_text(
    made: tuple[Path, dict[str, Any]],
) -> None:
    pytest.importorskip("jinja2")
    from cubicfish_cli.extensions.rigs.page import rig_html

    rig = load_rig(made[0])
    cameras = tuple(replace(one, name=f"<b>{one.name}") for one in rig.cameras)
    page = rig_html(replace(rig, cameras=cameras))
    assert "<b>" not in page
    assert "&lt;b&gt;left" in page


@pytest.mark.slow
def test_a_rig_is_evaluated_on_shots(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, record = made
    args = [folder / "left.csv", folder / "right.csv", "-t", folder / "target.yaml"]
    found = json.loads(run("rig", "evaluate", rig / "rig.yaml", *args, "--json").stdout)
    assert set(found) <= set(keys_of("rig evaluate"))
    # The very shots that it was fitted to: no more error than then, and none less.
    assert found["rms_px"] == pytest.approx(record["fit"]["rms_px"], rel=0.02)
    assert found["alone_rms_px"] < found["rms_px"]
    assert [one["images"] for one in found["cameras"]] == [8, 8]
    assert found["pairs"][0]["rms_px"] == pytest.approx(found["rms_px"], rel=1e-6)
    said = run("rig", "evaluate", rig, *args).stdout
    assert "8 shots" in said
    by_call = evaluate_rig_files(
        RigEvaluateOptions(rig=rig, cameras=args[:2], target=folder / "target.yaml")
    )
    assert same_records(by_call.as_record()["rms_px"], found["rms_px"])
    # A rig that stands 5 mm elsewhere explains them worse, and each camera alone as before.
    held = yaml.safe_load((rig / "rig.yaml").read_text())
    held["cameras"][1]["camera_from_rig"]["translation"][0] += 5.0
    del held["cameras"][1]["position"]
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        text = (rig / name / "camera.yaml").read_text()
        (tmp_path / name / "camera.yaml").write_text(text)
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(held, sort_keys=False))
    worse = json.loads(run("rig", "evaluate", tmp_path / "rig.yaml", *args, "--json").stdout)
    assert worse["rms_px"] > 3 * found["rms_px"]
    assert worse["alone_rms_px"] == pytest.approx(found["alone_rms_px"], rel=0.05)


@pytest.mark.slow
def test_two_rigs_are_compared(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, _ = made
    held = yaml.safe_load((rig / "rig.yaml").read_text())
    turn = np.array(held["cameras"][1]["camera_from_rig"]["rotation"])
    shift = held["cameras"][1]["camera_from_rig"]["translation"]
    held["cameras"][1]["camera_from_rig"]["translation"] = (turn @ [0, 0, -3] + shift).tolist()
    del held["cameras"][1]["position"]
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        text = (rig / name / "camera.yaml").read_text()
        (tmp_path / name / "camera.yaml").write_text(text)
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(held, sort_keys=False))
    found = json.loads(run("rig", "compare", rig, tmp_path, "--json").stdout)
    assert set(found) <= set(keys_of("rig compare"))
    left, right = found["cameras"]
    assert left["shift"] == [0, 0, 0]
    assert left["sigmas"] is None
    assert right["shift"] == pytest.approx([0, 0, 3], abs=1e-6)
    assert right["turn_deg"] < 1e-6
    assert right["shift_sigma"] > 0
    assert right["sigmas"] > 1
    assert right["lens"]["rms_px"] < 1e-6
    said = run("rig", "compare", rig, tmp_path).stdout
    assert "3.000" in said
    said = run("rig", "compare", rig, rig / "left" / "camera.yaml", code=1).stderr
    assert "camera.yaml is not a rig file" in said


def test_a_lens_that_turns_its_rays_where_its_camera_turns_back_is_the_same(
    made: tuple[Path, dict[str, Any]],
) -> None:
    rig = load_rig(made[0])
    right = rig.cameras[1]
    turn = rotation_matrix(np.array([0.01, -0.02, 0.015]))
    other = with_right(
        rig,
        camera=replace(right.camera, P=right.camera.P @ lift_rotation(turn)),
        rotation=turn.T @ right.rotation,
        translation=turn.T @ right.translation,
    )
    _, found = compare_rigs(rig, other)
    assert found.lens.statistics.rms_px < 1e-3
    assert found.turn_deg < 1e-3
    assert np.linalg.norm(found.shift) < 1e-2
    # Nor does it count which camera is named first.
    back = rig.cameras[::-1]
    _, found = compare_rigs(rig, replace(rig, cameras=back))
    assert found.turn_deg < 1e-6
    assert np.linalg.norm(found.shift) < 1e-6


@pytest.mark.slow
def test_photos_are_matched_by_times_in_a_table(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, _ = made
    rows = [
        f"{camera},shot_00{n},{n + late}"
        for n in range(1, 9)
        for camera, late in (("left", 0), ("right", 0.004))
    ]
    (tmp_path / "times.csv").write_text("camera,image,seconds\n" + "\n".join(rows) + "\n")
    args = calibrate_pair(folder)
    args += ["--lens", f"left={rig / 'left'}", "--lens", f"right={rig / 'right'}"]
    args += ["--times", tmp_path / "times.csv", "-o", tmp_path / "rig"]
    record = json.loads(run(*args, "--tolerance", "5ms", "--json").stdout)
    assert record["pairs"][0]["shots"] == 8
    said = run(*args, "--tolerance", "1ms", "--overwrite", code=1).stderr
    assert "no two cameras have photos within 1 ms" in " ".join(said.split())


def test_finished_calibrations_are_inputs_and_stay(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, record = made
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "camera.yaml").write_text((rig / name / "camera.yaml").read_text())
        (tmp_path / name / "corners.csv").write_text((folder / f"{name}.csv").read_text())
    held = json.loads(
        run("rig", "calibrate",
            tmp_path / "left", tmp_path / "right" / "camera.yaml",
            "-t", folder / "target.yaml", "-o", tmp_path / "rig", "--json").stdout
    )  # fmt: skip
    assert [one["name"] for one in held["cameras"]] == ["left", "right"]
    assert held["fit"]["held_lenses"]
    for name in ("left", "right"):
        before, after = (load_camera(at / name / "camera.yaml") for at in (rig, tmp_path / "rig"))
        assert (before.camera.P == after.camera.P).all()
    own, then = (one["cameras"][1] for one in (held, record))
    assert own["position"] == pytest.approx(then["position"], abs=0.1)
    assert own["shift_sigma"] < then["shift_sigma"]  # a lens that is held leaves less in doubt
    (tmp_path / "left" / "corners.csv").unlink()
    said = run("rig", "calibrate", tmp_path / "left", tmp_path / "right",
               "-t", folder / "target.yaml",
               "-o", tmp_path / "never", code=1).stderr  # fmt: skip
    assert "has a camera.yaml and no corners.csv" in " ".join(said.split())


def test_shots_may_be_listed(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig, _ = made
    rows = [f"s{n},{camera},shot_00{n}" for n in range(1, 6) for camera in ("left", "right")]
    (tmp_path / "shots.csv").write_text("shot,camera,image\n" + "\n".join(rows) + "\n")
    args = calibrate_pair(folder)
    models = ["--lens", f"left={rig / 'left'}", "--lens", f"right={rig / 'right'}"]
    args += [*models, "--shots", tmp_path / "shots.csv", "-o", tmp_path / "rig", "--json"]
    record = json.loads(run(*args).stdout)
    assert [one["shot"] for one in record["fit"]["per_shot"]] == ["s1", "s2", "s3", "s4", "s5"]


def with_known_lenses(folder: Path, rig: Path) -> list[object]:
    """The command that calibrates both cameras of the folder again, with the lenses of a rig."""
    lenses = [f"--lens={name}={rig / name}" for name in ("left", "right")]
    return [*calibrate_pair(folder), *lenses]


def test_what_an_earlier_rig_left_is_removed(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig = tmp_path / "rig"
    shutil.copytree(made[0], rig)
    left = [rig / "target.refined.yaml", rig / "report.html"]
    for path in left:
        path.write_text("of an earlier rig")
    line = [*with_known_lenses(folder, made[0]), "-o", rig, "--no-report"]
    assert "exists already" in run(*line, code=1).stderr
    assert all(path.exists() for path in left)
    said = " ".join(run(*line, "--overwrite").stderr.split())
    assert not any(path.exists() for path in left)
    assert all(f"removed {path}" in said for path in left)
    assert (rig / "rig.yaml").exists()


def test_tables_of_shots_are_read_before_photos_are_searched(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    table = tmp_path / "shots.csv"
    table.write_text("shot,camera\n")
    line = [*with_known_lenses(folder, made[0]), "--shots", table, "-o", tmp_path / "rig"]
    said = run(*line, code=1).stderr
    assert "shots.csv" in said
    assert "Camera left" not in said
    table.write_text("shot,camera,image\none,rear,a.png\n")
    assert "Camera left" in run(*line, code=1).stderr


@pytest.mark.usefixtures("with_report")
def test_a_rig_is_not_lost_where_its_page_fails(
    run: Run,
    folder: Path,
    made: tuple[Path, dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(rig: Rig) -> str:
        raise RuntimeError(f"no picture of {len(rig.cameras)} cameras")

    monkeypatch.setattr("cubicfish_cli.extensions.rigs.page.rig_html", fail)
    said = run(*with_known_lenses(folder, made[0]), "-o", tmp_path / "rig").stderr
    assert "no picture of 2 cameras" in " ".join(said.split())
    assert (tmp_path / "rig" / "rig.yaml").exists()
    assert not (tmp_path / "rig" / "report.html").exists()


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("photos/left*.png", "left"),
        ("photos/left_[0-9]*.png", "left"),
        ("left/*.png", "left"),
        ("left", "left"),
        ("left.csv", "left"),
        ("left.cam.mp4", "left.cam"),
        ("run.bag:/cam0/image_raw", "run_cam0_image_raw"),
    ],
)
def test_cameras_are_called_as_their_photos_are(path: str, name: str) -> None:
    assert named_by(Path(path)) == name


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["left.csv"], 2, "name two cameras or more"),
        (["left.csv", "left.csv"], 2, "--names: cameras are called left, left: give each a name"),
        (["left.csv", "right.csv", "--names", "a,A"], 2, "which some folders do not tell apart"),
        (["left.csv", "right.csv", "--names", ","], 2, "camera '': a name must be text"),
        (
            ["left.csv", "right.csv", "--names", "a"],
            2,
            "has 1 name, and there are 2 cameras",
        ),
        (["left.csv", "right.csv", "--lens", "rear=x.yaml"], 2, "names no camera"),
        (["left.csv", "film.mp4"], 2, "is a film, and other cameras have none"),
        (["a.mp4", "b.mp4", "--shots", "s.csv"], 2, "films are matched by time"),
        (["left.csv", "right.csv", "--tolerance", "5"], 2, "write 5ms"),
        (["left.csv", "nothing.csv"], 1, "does not exist"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], code: int, words: str
) -> None:
    monkeypatch.chdir(folder)
    said = run("rig", "calibrate", *args, "-t", "target.yaml", "-o", "never", code=code).stderr
    assert words in " ".join(said.split())
    assert not (folder / "never").exists()


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("cubicfish_rig", 2, "format version 2 is not 1"),
        ("cameras", [], "cameras must be a list of 2 to 100"),
        ("cameras", [{"name": "left"}], "cameras must be a list of 2 to 100 records: one alone"),
        ("units", 3, "units must be text"),
        ("units", "furlong", "units 'furlong' is not known: write mm, cm, m, in or ft"),
        ("extra", 1, "unknown key 'extra'"),
    ],
)
def test_a_spoilt_rig_is_refused(
    made: tuple[Path, dict[str, Any]], tmp_path: Path, key: str, value: object, words: str
) -> None:
    record = yaml.safe_load((made[0] / "rig.yaml").read_text())
    record[key] = value
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(record, sort_keys=False))
    with pytest.raises(CameraFileError, match=words):
        load_rig(tmp_path / "rig.yaml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": "../elsewhere.yaml"}, "in the rig's folder or below"),
        ({"name": "LEFT"}, "cameras are called left, LEFT: give each a name of its own"),
        ({"name": ""}, "name '': a name must be text"),
        ({"name": "../evil"}, "without / and"),
        ({"name": "/tmp/evil"}, "without / and"),
        ({"name": "a\\b"}, "without / and"),
        ({"name": ".."}, "a name must be text"),
        ({"name": "two\nlines"}, "and line breaks"),
        ({"name": 7}, "name '7': a name must be text"),
        ({"image_size": [640, 481]}, "unknown key 'image_size'"),
        ({"position": [100.0, 0.0, 7.0]}, "position is not where camera_from_rig says"),
        ({"covariance": (-np.eye(6)).tolist()}, "covariance is none"),
        ({"covariance": np.diag([1, 1, 1, 1, 1, -1e-9]).tolist()}, "covariance is none"),
        ({"covariance": (np.eye(6) + np.eye(6, k=1)).tolist()}, "must be symmetric"),
        ({"covariance": (np.eye(6) + 2 * np.eye(6)[::-1]).tolist()}, "covariance is none"),
        ({"covariance": [[1, 2], [3, 4]]}, "covariance must be 6 x 6 numbers"),
        ({"camera_from_rig": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 1, 1]],
                              "translation": [0, 0, 0]}}, "must be a rotation"),
        ({"camera_from_rig": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
                              "translation": [0, 0]}}, "translation must be 3 numbers, all finite"),
    ],
)  # fmt: skip
def test_a_spoilt_camera_of_a_rig_is_refused(
    made: tuple[Path, dict[str, Any]], tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    record = yaml.safe_load((made[0] / "rig.yaml").read_text())
    record["cameras"][1].update(change)
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        text = (made[0] / name / "camera.yaml").read_text()
        (tmp_path / name / "camera.yaml").write_text(text)
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(record, sort_keys=False))
    with pytest.raises(CameraFileError, match=words) as refused:
        load_rig(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_target_that_was_refined_is_named_where_it_is_measured_as_drawn(
    run: Run, folder: Path, made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rig = tmp_path / "rig"
    shutil.copytree(made[0], rig)
    tables = [folder / f"{name}.csv" for name in ("left", "right")]
    line = ["rig", "evaluate", rig, *tables, "-t"]
    assert "target.refined.yaml" not in run(*line, folder / "target.yaml").stderr
    refined = rig / "target.refined.yaml"
    refined.write_text("# as fitted\n" + (folder / "target.yaml").read_text())
    assert "target.refined.yaml" in run(*line, folder / "target.yaml").stderr
    assert "target.refined.yaml" not in run(*line, refined).stderr
