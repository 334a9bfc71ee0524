"""Whole jobs from files to files: what a command does, a program does by one call."""

import contextlib
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from equality import same_records
from listening import Heard
from running import run_cli
from samples import SAMPLE

from cubicfish import OutputError, UsageError
from cubicfish_cli import (
    CalibrateOptions,
    CompareOptions,
    DetectOptions,
    Event,
    ExportOptions,
    InfoOptions,
    MapOptions,
    PlaneOptions,
    ReportOptions,
    RigCompareOptions,
    RigInfoOptions,
    RigMapOptions,
    RigOptions,
    RigUndistortOptions,
    Run,
    Target,
    UndistortOptions,
    ViewOptions,
    calibrate_files,
    calibrate_rig_files,
    compare_files,
    compare_rig_files,
    detect_files,
    export_files,
    info_files,
    info_rig_files,
    load_camera,
    map_files,
    map_rig_files,
    report_files,
    undistort_files,
    undistort_rig_files,
)
from cubicfish_cli.terminal.terminal import print_json
from tests.cubicfish_cli.extensions.rigs.test_export import made_rig

CORNERS, TARGET = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"


def read(path: Path) -> dict[str, bytes]:
    return {one.name: one.read_bytes() for one in path.iterdir() if one.is_file()}


def as_json(made: Any) -> Any:
    """What a command prints of what a call gave."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        print_json(made.as_record())
    return json.loads(out.getvalue())


def test_a_program_is_told_what_is_done_and_says_nothing_of_a_command(
    tmp_path: Path, quick_fit: None
) -> None:
    heard, options = Heard(), CalibrateOptions(inputs=CORNERS, target=TARGET, folder=tmp_path / "b")
    made = calibrate_files(options, run=Run(listener=heard))
    assert heard.events == [(Event.FITTING, {"corners": 1139})]
    assert heard.steps[-1][0] == "Writing"
    assert "command" not in load_camera(made.files["camera"]).made_by
    with pytest.raises(OutputError, match="exists already"):
        calibrate_files(options)


def test_a_target_in_memory_is_written_beside_its_camera(tmp_path: Path, quick_fit: None) -> None:
    target = Target.load(TARGET)
    made = calibrate_files(
        CalibrateOptions(inputs=[CORNERS], target=target, folder=tmp_path / "c", report=False)
    )
    assert Target.load(made.files["drawn"]).text() == target.text()
    of = load_camera(made.files["camera"]).made_by["target"]
    assert of["file"] == str(made.files["drawn"])


def test_what_does_not_go_together_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--refine-target goes with --lift ray"):
        calibrate_files(
            CalibrateOptions(
                inputs=CORNERS, target=TARGET, folder=tmp_path, lift="point", refine_target="shape"
            )
        )
    with pytest.raises(UsageError, match="name the target that the photos show"):
        detect_files(
            DetectOptions(photos=SAMPLE / "photos", target=None, table=tmp_path / "corners.csv")
        )
    with pytest.raises(UsageError, match="two cameras or more"):
        calibrate_rig_files(RigOptions(cameras=[CORNERS], target=TARGET, folder=tmp_path))
    with pytest.raises(UsageError, match="'right' names no camera"):
        calibrate_rig_files(
            RigOptions(
                cameras=["left.csv", "rear.csv"],
                target=TARGET,
                folder=tmp_path,
                lenses={"right": Path("a.yaml")},
            )
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_corners_of_files_are_found_drawn_and_reported(tmp_path: Path) -> None:
    photos = [SAMPLE / "photos" / f"corner_0{n}.jpg" for n in (1, 2)]
    (tmp_path / "film.mp4").touch()
    for photo in photos:
        (tmp_path / photo.name).symlink_to(photo)
    heard = Heard()
    made = detect_files(
        DetectOptions(
            photos=tmp_path, target=TARGET, table=tmp_path / "a.csv", draw=tmp_path / "seen"
        ),
        run=Run(listener=heard),
    )
    assert made.drawings == [tmp_path / "seen" / f"corner_0{n}.png" for n in (1, 2)]
    assert [event for event, _ in heard.events][:2] == [Event.PASSED_OVER, Event.LOOKING]
    assert [len(heard.of(step)) for step in ("Finding corners", "Looking again")] == [3, 2]


def test_a_camera_is_exported_as_the_command_does(calibrated: Path, tmp_path: Path) -> None:
    for form, limit in (("opencv", 1.0), ("maps", None)):  # maps hold the camera as it is
        line = ("export", calibrated, "--to", form, "-o", tmp_path / "a.npz", "--json")
        said = json.loads(run_cli(*line, *(("--max-error", limit) if limit else ())).stdout)
        options = ExportOptions(camera=calibrated, to=form, output=tmp_path / "b.npz")
        made = export_files(replace(options, max_error=limit))
        assert made.files == [tmp_path / "b.npz"]
        assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
        assert set(made.record) == set(said)
        for path in tmp_path.iterdir():
            path.unlink()


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_a_page_is_that_of_the_command(calibrated: Path, tmp_path: Path) -> None:
    run_cli("report", calibrated, "-o", tmp_path / "a.html")
    options = ReportOptions(camera=calibrated, page=tmp_path / "b.html")
    made = report_files(options)
    assert made.verdict.level == "care"
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        report_files(options)


def test_maps_are_refused_before_a_camera_is_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="maps are written as"):
        map_files(MapOptions(camera=tmp_path / "none.yaml", output=tmp_path / "a.txt"))


@pytest.mark.parametrize(
    ("line", "options"),
    [
        ((), {}),
        (
            ("--view", "stereographic", "--fit", "outer", "--rotate", "10,5,0"),
            {"view": ViewOptions(kind="stereographic", fit="outer", rotate_deg=(10, 5, 0))},
        ),
        (
            ("--view", "cube", "--size", "40x40", "--interpolation", "cubic"),
            {"view": ViewOptions(kind="cube", size=(40, 40)), "interpolation": "cubic"},
        ),
        (
            ("--view", "plane:floor", "-t", TARGET, "--scale", 0.3, "--quality", 40),
            {
                "view": PlaneOptions(board="floor", target=TARGET, pixels_per_unit=0.3),
                "quality": 40,
            },
        ),
    ],
)
def test_pictures_are_those_of_the_command(
    calibrated: Path, tmp_path: Path, line: tuple[object, ...], options: dict[str, Any]
) -> None:
    photos = [SAMPLE / "photos" / f"corner_{number:02d}.jpg" for number in (1, 2)]
    said = run_cli("undistort", *photos, tmp_path / "a", "-m", calibrated, *line, "--json")
    made = undistort_files(
        UndistortOptions(photos=photos, output=tmp_path / "b", camera=calibrated, **options)
    )
    assert read(tmp_path / "a") == read(tmp_path / "b") != {}
    record = as_json(made)
    files = [file.replace(str(tmp_path / "b"), str(tmp_path / "a")) for file in record["files"]]
    assert {**record, "files": files} == json.loads(said.stdout)
    assert made.failed == {}


def test_files_beside_pictures_are_those_of_the_command(calibrated: Path, tmp_path: Path) -> None:
    photo = SAMPLE / "photos" / "corner_01.jpg"
    for name in "ab":
        (tmp_path / name).mkdir()
    a, b = tmp_path / "a", tmp_path / "b"
    beside = ("--mask", a / "m.png", "--camera", a / "flat.png")
    run_cli("undistort", photo, a / "flat.png", "-m", calibrated, *beside)
    made = undistort_files(
        UndistortOptions(
            photos=photo,
            output=b / "flat.png",
            camera=calibrated,
            mask=b / "m.png",
            virtual_camera=b / "flat.png",
        )
    )
    assert read(a) == read(b)
    assert made.files == (b / "flat.png",)
    assert sorted(file.name for file in made.extras) == [
        "flat.view.yaml",
        "m.png",
    ]


def test_a_board_that_there_is_not_is_refused(calibrated: Path, tmp_path: Path) -> None:
    view = PlaneOptions(board="flor", target=TARGET)
    folder = tmp_path / "a"
    options = UndistortOptions(
        photos=SAMPLE / "photos", output=folder, camera=calibrated, view=view
    )
    with pytest.raises(UsageError, match="did you mean 'floor'"):
        undistort_files(options)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        (ViewOptions, {"kind": "cubes"}, "did you mean 'cube'"),
        (ViewOptions, {"focal": 100, "fit": 0.5}, "focal and fit say the same thing twice"),
        (ViewOptions, {"hfov_deg": 200}, "hfov_deg 200 is too wide: a perspective view shows less"),
    ],
)
def test_options_that_cannot_be_are_refused(kind: Any, options: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        kind(**options)


@pytest.mark.slow
def test_maps_are_those_of_the_command(calibrated: Path, tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
    a, b = tmp_path / "a", tmp_path / "b"
    line = ("--fit", "inner", "--size", "90x60", "--photo-size", "480x360")
    said = run_cli("map", a / "m.npz", "-m", calibrated, *line, "--json")
    inner = ViewOptions(fit="inner", size=(90, 60))
    made = map_files(
        MapOptions(output=b / "m.npz", camera=calibrated, view=inner, photo_size=(480, 360))
    )
    assert read(a) == read(b)
    assert json.loads(said.stdout)["image_size"] == [480, 360] == list(made.image_size)
    line = ("--view", "equidistant", "--fit", "outer", "--redistort")
    run_cli("map", a / "s.png", "-m", calibrated, *line)
    whole = ViewOptions(kind="equidistant", fit="outer")
    map_files(MapOptions(output=b / "s.png", camera=calibrated, view=whole, redistort=True))
    assert read(a) == read(b)


def test_pictures_and_maps_of_a_rig_are_those_of_the_command(
    calibrated: Path, tmp_path: Path
) -> None:
    rig = made_rig(calibrated, tmp_path / "rig", 2)
    photos = tmp_path / "photos"
    for name in ("left", "right"):
        (photos / name).mkdir(parents=True)
        for number in (1, 2):
            photo = SAMPLE / "photos" / f"corner_{number:02d}.jpg"
            (photos / name / f"{number}.jpg").write_bytes(photo.read_bytes())
    for name in "ab":
        (tmp_path / name).mkdir()
    a, b = tmp_path / "a", tmp_path / "b"
    run_cli("rig", "undistort", photos, a, "-m", rig, "--size", "80x40", "--distance", 900)
    view = ViewOptions(size=(80, 40))
    made = undistort_rig_files(
        RigUndistortOptions(photos=photos, output=b, rig=rig.parent, view=view, distance=900)
    )
    assert read(a) == read(b)
    assert [*made.written] == ["1", "2"]
    for folder in (a, b):
        (folder / "m").mkdir()
    run_cli("rig", "map", a / "m" / "m.npz", "-m", rig, "--view", "cylindrical", "--size", "60x40")
    view = ViewOptions(kind="cylindrical", size=(60, 40))
    maps = map_rig_files(
        RigMapOptions(rig=rig, output=b / "m" / "m.npz", view=view, pair=("left", "right"))
    )
    assert read(a / "m") == read(b / "m")
    assert maps.stereo["cameras"] == ["left", "right"]
    with pytest.raises(UsageError, match="rows of stereographic pictures do not agree"):
        map_rig_files(
            RigMapOptions(rig=rig, output=b / "n.npz", view=ViewOptions(kind="stereographic"))
        )


@pytest.mark.slow
def test_what_cameras_are_and_how_far_apart_is_what_the_commands_say(
    calibrated: Path, tmp_path: Path
) -> None:
    made = info_files(InfoOptions(camera=calibrated))
    assert same_records(as_json(made), json.loads(run_cli("info", calibrated, "--json").stdout))
    true = SAMPLE / "true_camera.yaml"
    line = ("compare", calibrated, true, "--picture", tmp_path / "a.png", "--json")
    said = json.loads(run_cli(*line).stdout)
    options = CompareOptions(first=calibrated, second=true, picture=tmp_path / "b.png")
    apart = compare_files(options)
    assert same_records(as_json(apart), {**said, "picture": str(tmp_path / "b.png")})
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        compare_files(options)


def test_what_rigs_are_and_how_far_apart_is_what_the_commands_say(
    calibrated: Path, tmp_path: Path
) -> None:
    rig = made_rig(calibrated, tmp_path / "rig", 2)
    made = info_rig_files(RigInfoOptions(rig=rig.parent))
    assert same_records(as_json(made), json.loads(run_cli("rig", "info", rig, "--json").stdout))
    assert [one.name for one in made.rig.cameras] == ["left", "right"]
    said = json.loads(run_cli("rig", "compare", rig, rig, "--json").stdout)
    found = compare_rig_files(RigCompareOptions(first=rig.parent, second=rig))
    assert same_records(as_json(found), said)
    assert [one.turn_deg for one in found.cameras] == pytest.approx([0, 0], abs=1e-6)
