"""calibrate and evaluate: what they print, what they write, and when they refuse."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from pairs_csv import write_pairs
from running import Run
from samples import SAMPLE
from saved_maps import read_map

from cubicfish import OutputError, Target, load_camera, load_corners
from cubicfish.files import Fingerprint
from cubicfish.fit import calibrate as fitting
from cubicfish.views import MapInBands
from cubicfish_cli import __version__

CORNERS = SAMPLE / "true_corners.csv"
TARGET = SAMPLE / "target.yaml"
STATISTICS = {"rms_px", "median_px", "p95_px", "max_px", "corners"}


@pytest.fixture
def no_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail the test when a fit starts."""

    def fail(*_: object, **__: object) -> None:
        pytest.fail("the fit must not start")

    monkeypatch.setattr(fitting, "calibrate", fail)


def text_of(*paths: Path) -> list[bytes]:
    return [path.read_bytes() for path in paths]


@pytest.mark.slow
def test_the_calibration_is_written_whole(calibrated: Path) -> None:
    names = sorted(path.name for path in calibrated.iterdir())
    assert names == ["camera.yaml", "corners.csv", "undistort_map.npz"]
    read = load_camera(calibrated / "camera.yaml")
    assert read.fit.corners == 1139
    assert read.fit.rms_px < 0.03
    made_by = read.made_by
    assert made_by["version"] == __version__
    assert made_by["target"] == {"file": str(TARGET), "sha256": Fingerprint.of(TARGET).sha256}
    assert made_by["inputs"] == [{"file": str(CORNERS), "sha256": Fingerprint.of(CORNERS).sha256}]
    target = Target.load(TARGET)
    again = load_corners(calibrated / "corners.csv", target)
    np.testing.assert_array_equal(again.pixel, load_corners(CORNERS, target).pixel)


@pytest.mark.slow
def test_json_is_one_object_and_nothing_else(run: Run, tmp_path: Path) -> None:
    result = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--json")
    record = json.loads(result.stdout)
    assert set(record) >= STATISTICS | {"images", "held_out_rms_px", "rank", "dropped", "model"}
    assert record["images"] == len(record["per_image"]) == 10
    assert record["rank"] == 16
    assert record["dropped"] == 0
    assert record["model"] == str(tmp_path / "c" / "camera.yaml")
    assert 0 < record["rms_px"] < record["held_out_rms_px"] < 0.03
    assert set(record["per_image"][0]) >= STATISTICS | {"image", "camera_from_world"}
    assert "Fitting" in result.stderr


def test_the_text_says_what_the_rms_is(run: Run, tmp_path: Path, quick_fit: None) -> None:
    result = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--no-hold-out", "-q")
    assert "10 photos, 1,139 corners used, 0 outliers" in result.stdout
    assert "sqrt(mean(dx² + dy²)) over all corners used" in result.stdout
    assert "Kannala–Brandt" in result.stdout
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith("corner_")]
    assert [row[-1] for row in rows] == ["good"] * 3
    assert "10 photos good; all of them: -v, or " in result.stdout
    assert "Next:" not in result.stdout
    assert result.stderr == ""


@pytest.mark.slow
def test_a_gross_corner_is_dropped_and_listed(run: Run, tmp_path: Path) -> None:
    lines = CORNERS.read_text().splitlines()
    image, board, column, row, x, y = lines[300].split(",")
    lines[300] = ",".join([image, board, column, row, str(float(x) + 30), y])
    (tmp_path / "c.csv").write_text("\n".join(lines))
    args = ["calibrate", tmp_path / "c.csv", "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c"]
    result = run(*args, "-v")
    assert "1,138 corners used, 1 outlier" in result.stdout
    assert f"dropped: {image} {board} column {column} row {row}: 30." in result.stderr
    dropped = load_camera(tmp_path / "c" / "camera.yaml").fit.dropped_corners
    assert [(d.image, d.board, d.column) for d in dropped] == [(image, board, int(column))]
    assert "dropped:" not in run(*args, "--overwrite").stderr


@pytest.mark.slow
def test_existing_outputs_are_refused_before_the_work(
    run: Run, calibrated: Path, no_fit: None
) -> None:
    before = text_of(*sorted(calibrated.iterdir()))
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", calibrated, code=1).stderr
    assert "camera.yaml exists already: choose another name or add --overwrite" in said
    assert text_of(*sorted(calibrated.iterdir())) == before


def test_overwriting_replaces_all(run: Run, tmp_path: Path, quick_fit: None) -> None:
    for name in ("camera.yaml", "corners.csv", "undistort_map.npz"):
        (tmp_path / name).write_text("old")
    run("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o", tmp_path, "--overwrite")
    assert load_camera(tmp_path / "camera.yaml").fit.images == 10
    assert (tmp_path / "corners.csv").read_text().startswith("# cubicfish corners 1")
    assert read_map(tmp_path / "undistort_map.npz").image_size == (960, 720)


def test_when_one_output_fails_none_is_written(
    run: Run, tmp_path: Path, quick_fit: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(MapInBands, "write", fail)
    run("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c", code=1)
    assert list((tmp_path / "c").iterdir()) == []


def test_corners_that_lie_in_the_output_folder_are_not_written_again(
    run: Run, tmp_path: Path, quick_fit: None
) -> None:
    path = tmp_path / "corners.csv"
    path.write_bytes(CORNERS.read_bytes())
    run("calibrate", path, "-t", TARGET, "--no-hold-out", "-o", tmp_path)
    assert path.read_bytes() == CORNERS.read_bytes()
    assert (tmp_path / "camera.yaml").exists()


@pytest.mark.parametrize("command", ["calibrate", "evaluate"])
def test_a_failed_gate_exits_with_3_and_the_work_is_done(
    run: Run, tmp_path: Path, calibrated: Path, quick_fit: None, command: str
) -> None:
    more = ["--no-hold-out", "-o", tmp_path / "c"]
    if command == "evaluate":
        more = ["-m", calibrated / "camera.yaml"]
    result = run(command, CORNERS, "-t", TARGET, "--max-rms", 1e-6, "--json", *more, code=3)
    assert "is above --max-rms 1e-06" in result.stderr
    assert json.loads(result.stdout)["corners"] == 1139
    if command == "calibrate":
        assert (tmp_path / "c" / "camera.yaml").exists()
        run(command, CORNERS, "-t", TARGET, "--max-rms", 0.1, "--overwrite", *more)


def test_a_goal_of_ones_own_is_kept_with_the_camera(run: Run, tmp_path: Path) -> None:
    made = run("calibrate", CORNERS, "-t", TARGET, "--goal", 1e-4, "-o", tmp_path, "--no-hold-out")
    assert "verdict: not to be trusted: uncertainty is" in made.stdout
    assert "the goal is 0.0001 px" in made.stdout
    told = run("info", tmp_path).stdout
    assert "not to be trusted" in told
    assert re.search(r"goal +0.0001 px", told)
    assert json.loads(run("info", tmp_path, "--json").stdout)["verdict"]["level"] == "bad"
    about = json.loads(run("advise", tmp_path, "--json").stdout)
    assert (about["enough"], about["goal_px"]) == (False, 1e-4)
    # What is asked for now takes its place.
    about = json.loads(run("advise", tmp_path, "--goal", 1, "--json").stdout)
    assert "uncertain" not in [one["code"] for one in about["findings"]]
    assert about["goal_px"] == 1
    run("transform", tmp_path, "--scale", 0.5, "-o", tmp_path / "half.yaml")
    assert load_camera(tmp_path / "half.yaml").fit.goal_px == pytest.approx(5e-5)
    usual = run("calibrate", CORNERS, "-t", TARGET, "--overwrite", "-o", tmp_path, "--no-hold-out")
    assert "--goal" not in usual.stdout
    assert "goal_px:" not in (tmp_path / "camera.yaml").read_text()


def correspondences(folder: Path) -> Path:
    """The sample as pairs, without a line that gives the size."""
    target = Target.load(TARGET)
    path = folder / "pairs.csv"
    write_pairs(path, load_corners(CORNERS, target))
    path.write_text(path.read_text().split("\n", 1)[1])
    return path


@pytest.mark.slow
def test_pairs_need_no_target(run: Run, tmp_path: Path, calibrated: Path) -> None:
    pairs = correspondences(tmp_path)
    args = ["calibrate", "--correspondences", pairs, "--no-hold-out", "-o", tmp_path / "c"]
    assert "image size is not known: add --size" in run(*args, code=1).stderr
    run(*args, "--size", "960x720")
    assert {path.name for path in (tmp_path / "c").iterdir()} == {
        "camera.yaml",
        "undistort_map.npz",
    }
    read = load_camera(tmp_path / "c" / "camera.yaml")
    other = load_camera(calibrated / "camera.yaml")
    rays = [[0.1, 0.2, 1.0], [1, -1, 0.3]]
    np.testing.assert_allclose(read.camera.project(rays), other.camera.project(rays), atol=1e-3)
    # evaluate takes the size from the camera.
    record = json.loads(run("evaluate", pairs, "-m", tmp_path / "c/camera.yaml", "--json").stdout)
    assert record["rms_px"] == pytest.approx(read.fit.rms_px, rel=0.01)


def test_pairs_may_stand_where_corners_do(run: Run, tmp_path: Path, quick_fit: None) -> None:
    pairs = correspondences(tmp_path)
    run("calibrate", pairs, "--size", "960x720", "-o", tmp_path / "c")
    assert {path.name for path in (tmp_path / "c").iterdir()} == {
        "camera.yaml",
        "undistort_map.npz",
    }


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ([], "name photos, a folder of photos, or a corners.csv"),
        ([CORNERS], "name the target that the photos show with --target target.yaml"),
        ([SAMPLE / "photos"], "'cubicfish target print --object corner'), or a flat"),
        ([CORNERS, CORNERS, "-t", TARGET], "must be the only input"),
        ([CORNERS, "--correspondences", CORNERS, "-t", TARGET], "not both"),
        ([CORNERS, "-t", TARGET, "--size", "960"], "is not an image size: write WIDTHxHEIGHT"),
        ([CORNERS, "-t", TARGET, "-j", "0"], "--jobs"),
        ([CORNERS, "-t", TARGET, "--max-rms", "0"], "--max-rms"),
    ],
)
def test_wrong_usage_exits_with_2(
    run: Run, tmp_path: Path, no_fit: None, args: list[object], message: str
) -> None:
    result = run("calibrate", *args, "-o", tmp_path / "c", code=2)
    assert message in result.stderr
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["no.csv", "-t", TARGET], "no.csv does not exist: check the name"),
        (["--correspondences", "no.csv"], "no.csv does not exist: check the name"),
        ([CORNERS, "-t", "no.yaml"], "no.yaml does not exist: check the name"),
        ([SAMPLE / "photos", "-t", "no.yaml"], "no.yaml does not exist: check the name"),
        ([SAMPLE / "photos", "no.jpg", "-t", TARGET], "no.jpg does not exist: check the name"),
        (["nowhere/", "-t", TARGET], "nowhere"),
        ([CORNERS, "-t", CORNERS], "true_corners.csv"),
        ([CORNERS, "-t", TARGET, "--size", "96x72"], "960x720 here, but 96x72 is expected"),
    ],
)
def test_bad_inputs_exit_with_1_and_leave_nothing(
    run: Run, tmp_path: Path, no_fit: None, args: list[object], message: str
) -> None:
    result = run("calibrate", *args, "-o", tmp_path / "c", code=1)
    assert message in result.stderr
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "c").exists()


def test_evaluate_measures_a_camera_on_corners(run: Run, calibrated: Path) -> None:
    args = ["evaluate", CORNERS, "-t", TARGET, "-m", calibrated / "camera.yaml"]
    record = json.loads(run(*args, "--json").stdout)
    assert set(record) >= STATISTICS | {"images", "per_image"}
    fit = load_camera(calibrated / "camera.yaml").fit
    assert record["corners"] == fit.corners
    assert record["rms_px"] == pytest.approx(fit.rms_px, rel=0.01)
    said = run(*args).stdout
    assert "10 photos, 1,139 corners" in said
    assert "sqrt(mean(dx² + dy²)) over all corners used" in said
    assert said.count("corner_") == 10


def test_evaluate_says_what_it_did_not_count(run: Run, calibrated: Path, tmp_path: Path) -> None:
    data = yaml.safe_load((calibrated / "camera.yaml").read_text())
    data["max_angle_deg"] = 60.0
    (tmp_path / "narrow.yaml").write_text(yaml.safe_dump(data))
    lines = CORNERS.read_text().splitlines()
    few = [line for line in lines if not line.startswith("corner_10")]
    few += [line for line in lines if line.startswith("corner_10")][:3]
    (tmp_path / "few.csv").write_text("\n".join(few))
    result = run("evaluate", tmp_path / "few.csv", "-t", TARGET, "-m", tmp_path / "narrow.yaml")
    assert "corners not counted: beyond the 60°" in result.stderr
    assert "corner_10.jpg: too few corners to find its pose" in result.stderr


@pytest.mark.slow
def test_photos_left_out_for_the_same_reason_are_said_in_one_line(run: Run, tmp_path: Path) -> None:
    lines = CORNERS.read_text().splitlines()
    few = [line for line in lines if not line.startswith(("corner_09", "corner_10"))]
    for name in ("corner_09", "corner_10"):
        few += [line for line in lines if line.startswith(name)][:3]
    (tmp_path / "few.csv").write_text("\n".join(few))
    result = run(
        "calibrate", tmp_path / "few.csv", "-t", TARGET, "-o", tmp_path / "c", "--no-report"
    )
    said = [line for line in result.stderr.splitlines() if line.startswith("left out")]
    assert said == [
        "left out: 2 photos (corner_09.jpg and corner_10.jpg): too few corners to find its pose"
    ]


def test_a_date_of_ones_own_makes_the_same_bytes_again(
    run: Run, tmp_path: Path, quick_fit: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for name in ("a", "b"):
        run("calibrate", CORNERS, "--target", TARGET, "-o", tmp_path / name)
    texts = [(tmp_path / name / "camera.yaml").read_bytes() for name in ("a", "b")]
    assert texts[0] == texts[1]
    assert b"2023-11-14T22:13:20+00:00" in texts[0]


def test_a_date_that_is_none_is_reported_before_the_work(
    run: Run, tmp_path: Path, no_fit: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    said = run("calibrate", CORNERS, "--target", TARGET, "-o", tmp_path / "a", code=1).stderr
    assert "SOURCE_DATE_EPOCH='yesterday' is not a time" in said


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_what_an_earlier_calibration_left_goes_with_it(run: Run, tmp_path: Path) -> None:
    args = ("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path)
    run(*args)
    usual = sorted(path.name for path in tmp_path.iterdir())
    for name in ("report.html", "target.refined.yaml", "notes.txt"):
        (tmp_path / name).write_text("old")
    said = run(*args, "--overwrite").stderr
    for name in ("report.html", "target.refined.yaml"):
        assert f"removed {tmp_path / name}, which was of an earlier calibration" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*usual, "notes.txt"])
    run(*args, "--overwrite", "--lift", "point")
    assert not (tmp_path / "undistort_map.npz").exists()
    assert (tmp_path / "notes.txt").exists()


@pytest.mark.usefixtures("quick_fit")
def test_a_calibration_does_not_replace_the_object_that_it_is_made_from(
    run: Run, tmp_path: Path
) -> None:
    mine = tmp_path / "target.refined.yaml"
    mine.write_bytes(TARGET.read_bytes())
    args = ("calibrate", CORNERS, "-t", mine, "-o", tmp_path, "--overwrite")
    said = run(*args, "--refine-target", "shape", code=1).stderr
    assert f"{mine} is read here, and would be replaced" in said
    run(*args, "--refine-target", "off")
    assert mine.read_bytes() == TARGET.read_bytes()


@pytest.mark.slow
def test_corners_that_may_be_others_stay_marked(run: Run, tmp_path: Path) -> None:
    """What the table of corners marks as uncertain is so for every reader, and stays marked."""
    header, names, *rows = CORNERS.read_text().splitlines()
    first = rows[0].split(",")[0]
    marked = [f"{row},{0 if row.startswith(first + ',') else 1}" for row in rows]
    table = tmp_path / "corners.csv"
    text = [header.replace("corners 1", "corners 2"), names + ",certain", *marked]
    table.write_text("\n".join(text) + "\n")
    result = run("calibrate", table, "-t", TARGET, "-o", tmp_path / "c", "--json", "--no-report")
    assert "1 photo shows too little of the board to tell which corners these are" in result.stderr
    assert "shape" in json.loads(result.stdout)["held_out_by_level"]  # the others are measured
    kept = load_corners(tmp_path / "c" / "corners.csv", Target.load(TARGET))
    assert {kept.images[image] for image in kept.image[~kept.certain]} == {first}
