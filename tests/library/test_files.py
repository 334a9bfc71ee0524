"""Whole jobs from files to files: what a command does, a program does by one call."""

import json
from pathlib import Path

import pytest
from listening import Heard
from running import SAMPLE, run_cli

from cubicfish_cli import (
    Event,
    Run,
    Target,
    advise_files,
    calibrate_files,
    calibrate_rig_files,
    detect_files,
    evaluate_files,
    export_files,
    load_camera,
    report_files,
)
from cubicfish_cli.errors import OutputError, UsageError
from cubicfish_cli.library.map_files import MapFormat
from cubicfish_cli.target import target_text

CORNERS, TARGET = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"


def read(path: Path) -> dict[str, bytes]:
    return {one.name: one.read_bytes() for one in path.iterdir()}


def test_a_calibration_is_that_of_the_command(
    tmp_path: Path, quick_fit: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    line = ("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "a", "--no-hold-out", "--json")
    said = json.loads(run_cli(*line, "--title", "left").stdout)
    heard = Heard()
    made = calibrate_files(
        CORNERS,
        TARGET,
        tmp_path / "b",
        hold_out=False,
        title="left",
        command=load_camera(tmp_path / "a" / "camera.yaml").made_by["command"],
        run=Run(listener=heard),
    )
    assert read(tmp_path / "a") == read(tmp_path / "b")
    known = ("files", "model", "report")
    record = {key: value for key, value in made.as_record().items() if key not in known}
    assert json.loads(json.dumps(record)) == {
        key: value for key, value in said.items() if key not in known
    }
    assert heard.told == [(Event.FITTING, {"corners": 1139})]
    assert heard.steps[-1][0] == "Writing"
    with pytest.raises(OutputError, match="exists already"):
        calibrate_files(CORNERS, TARGET, tmp_path / "b")
    again = calibrate_files(CORNERS, TARGET, tmp_path / "b", run=Run(overwrite=True))
    assert "command" not in load_camera(again.files["camera"]).made_by


def test_a_target_in_memory_is_written_beside_its_camera(tmp_path: Path, quick_fit: None) -> None:
    target = Target.load(TARGET)
    made = calibrate_files([CORNERS], target, tmp_path / "c", report=False)
    assert target_text(Target.load(made.files["drawn"])) == target_text(target)
    of = load_camera(made.files["camera"]).made_by["target"]
    assert of["file"] == str(made.files["drawn"])


def test_what_does_not_go_together_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--compare is of cameras with rays"):
        calibrate_files(CORNERS, TARGET, tmp_path, lift="point", compare=True)
    with pytest.raises(UsageError, match="the photos show an unknown target"):
        detect_files(SAMPLE / "photos", None, tmp_path / "corners.csv")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="two cameras or more"):
        calibrate_rig_files([CORNERS], TARGET, tmp_path)
    with pytest.raises(UsageError, match=r"'right=a\.yaml' names no camera"):
        calibrate_rig_files(
            ["left.csv", "rear.csv"], TARGET, tmp_path, lenses={"right": Path("a.yaml")}
        )
    assert list(tmp_path.iterdir()) == []


def test_a_camera_is_measured_on_files(calibrated: Path) -> None:
    line = ("evaluate", CORNERS, "-t", TARGET, "-m", calibrated, "--json")
    said = json.loads(run_cli(*line).stdout)
    made = evaluate_files(calibrated, CORNERS, TARGET)
    assert json.loads(json.dumps(made.record)) == said
    assert made.verdict.level == "good"


@pytest.mark.slow
def test_corners_of_files_are_found_drawn_and_told(tmp_path: Path) -> None:
    photos = [SAMPLE / "photos" / f"corner_0{n}.jpg" for n in (1, 2)]
    (tmp_path / "film.mp4").touch()
    for photo in photos:
        (tmp_path / photo.name).symlink_to(photo)
    heard = Heard()
    made = detect_files(
        tmp_path, TARGET, tmp_path / "a.csv", draw=tmp_path / "seen", run=Run(listener=heard)
    )
    assert made.drawings == [tmp_path / "seen" / f"corner_0{n}.png" for n in (1, 2)]
    assert [event for event, _ in heard.told][:2] == [Event.PASSED_OVER, Event.LOOKING]
    assert [len(heard.of(step)) for step in ("Finding corners", "Looking again")] == [3, 3]
    run_cli("detect", *photos, "-t", TARGET, "-o", tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()


def test_a_camera_is_exported_as_the_command_does(calibrated: Path, tmp_path: Path) -> None:
    for form in ("opencv", "maps"):
        line = (
            "export",
            calibrated,
            "--to",
            form,
            "-o",
            tmp_path / "a.npz",
            "--max-error",
            1,
            "--json",
        )
        said = json.loads(run_cli(*line).stdout)
        made = export_files(calibrated, form, tmp_path / "b.npz", max_error=1)
        assert made.files == [tmp_path / "b.npz"]
        assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
        assert set(made.record) == set(said)
        for path in tmp_path.iterdir():
            path.unlink()
    with pytest.raises(UsageError, match="--pair names two cameras of a rig"):
        export_files(calibrated, "opencv", tmp_path / "c", pair=("left", "right"))


def test_what_to_photograph_next_is_what_the_command_says(calibrated: Path, tmp_path: Path) -> None:
    line = ("advise", calibrated, "--goal", 0.001, "--poses", tmp_path / "a.csv", "--json")
    said = json.loads(run_cli(*line).stdout)
    made = advise_files(calibrated, goal_px=0.001, poses=tmp_path / "b.csv")
    assert made.written == [tmp_path / "b.csv"]
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
    assert made.advice.enough is said["enough"] is False
    with pytest.raises(OutputError, match="drawings are SVG"):
        advise_files(calibrated, picture=tmp_path / "a.png")


@pytest.mark.usefixtures("with_report")
def test_a_page_is_that_of_the_command(calibrated: Path, tmp_path: Path) -> None:
    run_cli("report", calibrated, "-o", tmp_path / "a.html")
    made = report_files(calibrated, tmp_path / "b.html")
    assert made.verdict.level == "care"
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        report_files(calibrated, tmp_path / "b.html")


def test_maps_are_refused_before_a_camera_is_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="maps are written as"):
        MapFormat(output=tmp_path / "a.txt")
    with pytest.raises(UsageError, match="--fixed-point is for maps in"):
        MapFormat(output=tmp_path / "a.exr", fixed_point=True)
