"""What is proposed for a word that is none of those that a command knows."""

from pathlib import Path

import pytest
from running import run_cli
from samples import SAMPLE

from cubicfish import Target, TargetError


@pytest.mark.parametrize(
    ("line", "said", "not_said"),
    [
        ("undistort a.png b.png --view cylinder", "did you mean 'cylindrical'?", ", "),
        ("calibrate a.csv --refine-target shapes", "did you mean 'shape'?", ", "),
        ("export c --to openvc", "did you mean 'opencv'?", ", "),
        ("undistort a.png b.png --view round", "known: perspective, ", "did you mean"),
        ("calibrate a --boards 9x6", "--board", "--report"),
        ("calibrate a --photos b", "--photos", "--report"),
    ],
)
def test_the_nearest_word_is_proposed_if_it_is_near(line: str, said: str, not_said: str) -> None:
    told = run_cli(*line.split(), code=2).stderr.partition("Error:")[2]
    assert said in told
    assert not_said not in told.partition(":")[2].partition(said)[0]


@pytest.mark.parametrize("name", ["corner_01.jpg", "film.mp4"])
def test_a_picture_is_no_camera(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes((SAMPLE / "photos" / "corner_01.jpg").read_bytes())
    kind = "video" if name.endswith("mp4") else "photo"
    assert f"is a {kind}, not a camera" in run_cli("info", tmp_path / name, code=1).stderr


@pytest.mark.parametrize(
    ("units", "square", "length"),
    [("mm", "25mm", 25), ("cm", "25 mm", 2.5), ("m", "1in", 0.0254), ("in", "25.4mm", 1)],
)
def test_a_length_may_say_its_unit(units: str, square: str, length: float) -> None:
    board = {"name": "b", "type": "checkerboard", "corners": [9, 6], "square": square}
    read = Target.from_data({"units": units, "boards": [board]})
    assert read.boards[0].square == pytest.approx(length, rel=1e-12)


@pytest.mark.parametrize(("units", "square"), [("mm", "25"), ("squares", "25mm"), ("mm", "25mn")])
def test_other_text_is_no_length(units: str, square: str) -> None:
    board = {"name": "b", "type": "checkerboard", "corners": [9, 6], "square": square}
    with pytest.raises(TargetError, match="square: must be a positive"):
        Target.from_data({"units": units, "boards": [board]})


def test_evaluate_takes_the_target_of_the_cameras_folder(
    calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    line = ("evaluate", SAMPLE / "true_corners.csv", "-m", tmp_path / "c")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "camera.yaml").write_bytes((calibrated / "camera.yaml").read_bytes())
    assert "--target" in run_cli(*line, code=2).stderr
    (tmp_path / "c" / "target.yaml").write_bytes((SAMPLE / "target.yaml").read_bytes())
    assert "target.yaml" in run_cli(*line).stderr
    (tmp_path / "c" / "target.refined.yaml").write_bytes((SAMPLE / "target.yaml").read_bytes())
    assert "target.refined.yaml" in run_cli(*line).stderr
