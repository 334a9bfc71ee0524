"""A board's plane at its true scale, wherever the photo was taken."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import Run
from samples import SAMPLE

from cubicfish import Target, read_picture

TARGET = SAMPLE / "target.yaml"
PHOTO = SAMPLE / "photos" / "corner_01.jpg"
SCALE = 3.0


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


def drawn(name: str) -> np.ndarray:
    """The board as it is drawn, a square around its corners: 1 where it is light."""
    board = next(board for board in Target.load(TARGET).boards if board.name == name)
    side = round(board.square * SCALE)
    squares = np.add.outer(np.arange(board.rows + 1), np.arange(board.columns + 1)) % 2
    if board.first_square == "light":
        squares = 1 - squares
    return np.kron(squares, np.ones((side, side)))


def likeness(picture: np.ndarray, board: np.ndarray) -> float:
    """Correlation of a picture with the drawing, where the picture is not empty."""
    picture = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    assert picture.shape == board.shape
    seen = picture > 0
    assert seen.mean() > 0.6
    local = picture / (cv2.blur(picture.astype(float), (151, 151)) + 1)
    return float(np.corrcoef(local[seen], board[seen])[0, 1])


@pytest.mark.parametrize("board", ["floor", "left", "right"])
def test_a_boards_plane_is_the_drawing_of_the_board(
    run: Run, model: Path, tmp_path: Path, board: str
) -> None:
    args = ["-m", model, "--view", f"plane:{board}", "--target", TARGET, "--scale", SCALE]
    said = run("undistort", PHOTO, tmp_path / "o.png", *args).stdout
    assert "the plane at 3 pixels per mm" in said
    assert likeness(read_picture(tmp_path / "o.png"), drawn(board)) > 0.93


def test_the_scale_sets_the_size(run: Run, model: Path, tmp_path: Path) -> None:
    args = ["-m", model, "--view", "plane:floor", "-t", TARGET]
    run("undistort", PHOTO, tmp_path / "o.png", *args, "--scale", 2)
    # 9x6 inner corners of 25 mm, and a square around them.
    assert read_picture(tmp_path / "o.png").shape == (7 * 50, 10 * 50, 3)


@pytest.mark.slow
def test_without_a_pose_the_boards_corners_give_it(run: Run, model: Path, tmp_path: Path) -> None:
    shutil.copy(PHOTO, tmp_path / "unknown.jpg")
    args = ["-m", model, "--view", "plane:floor", "-t", TARGET, "--scale", SCALE]
    done = run("undistort", tmp_path / "unknown.jpg", tmp_path / "o.png", *args)
    assert "Looking for corners in 1 photo" in done.stderr
    run("undistort", PHOTO, tmp_path / "known.png", *args)
    made, known = (read_picture(tmp_path / n).astype(int) for n in ("o.png", "known.png"))
    assert np.abs(made - known).mean() < 1


@pytest.mark.slow
def test_a_camera_of_points_shows_its_boards(run: Run, tmp_path: Path) -> None:
    lines = (SAMPLE / "true_corners.csv").read_text().splitlines()
    own = [line for line in lines if line.startswith(("#", "image", "corner_01"))]
    (tmp_path / "one.csv").write_text("\n".join(own) + "\n")
    points = ["--lift", "point", "-o", tmp_path / "p"]
    run("calibrate", tmp_path / "one.csv", "-t", TARGET, *points)
    args = ["-m", tmp_path / "p" / "camera.yaml", "--view", "plane:floor", "-t", TARGET]
    args += ["--scale", SCALE]
    run("undistort", PHOTO, tmp_path / "o.png", *args)
    assert likeness(read_picture(tmp_path / "o.png"), drawn("floor")) > 0.93
    other = PHOTO.with_name("corner_02.jpg")
    said = run("undistort", other, tmp_path / "x.png", *args, code=1).stderr
    assert "holds for the one photo that it was fitted to, corner_01.jpg" in said


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--view", "plane:floor"], "--view plane:floor needs the target"),
        (["--view", "plane:flor", "-t", TARGET], "did you mean 'floor'"),
        (["--view", "plane:floor", "-t", TARGET, "--hfov", "90"], "--hfov does not go with"),
        (["--view", "plane:floor", "-t", TARGET, "--size", "9x9"], "--size does not go with"),
        (["--view", "plane:"], "is not one of them"),
        (["--target", TARGET], "--target goes with --view plane:BOARD"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(
    run: Run, model: Path, tmp_path: Path, args: list[object], message: str
) -> None:
    assert message in run("undistort", PHOTO, tmp_path / "o.png", "-m", model, *args, code=2).stderr
    assert not (tmp_path / "o.png").exists()
