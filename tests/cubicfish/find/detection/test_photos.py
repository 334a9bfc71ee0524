"""Real photos, where they lie beside the project."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from cubicfish.find.detection.finder import find_grids

DATA = Path(__file__).resolve().parents[5] / "shared" / "data"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["0000.png", "0039.png"])
def test_walls_cut_by_the_image_circle(name):
    folder = DATA / "ov_cube"
    if not folder.exists():
        pytest.skip("no ov_cube photos")
    lines = (folder / "reference_corners.csv").read_text().splitlines()
    rows = [
        row
        for row in csv.DictReader(line for line in lines if not line.startswith("#"))
        if row["image"] == name
    ]
    reference = np.array([(float(row["x"]), float(row["y"])) for row in rows])
    board = np.array([row["board"] for row in rows])
    found = find_grids(cv2.imread(str(folder / "images" / name), cv2.IMREAD_GRAYSCALE))
    pixel = np.concatenate([grid.pixel for grid in found.grids])
    owner = np.repeat(np.arange(len(found.grids)), [len(grid) for grid in found.grids])
    distance = np.hypot(*(reference[:, None] - pixel[None]).transpose(2, 0, 1))
    near = distance.min(1) < 1
    assert near.mean() > 0.97
    assert np.median(distance.min(1)) < 0.09
    for wall in np.unique(board):  # each is one grid, and no grid has two walls
        assert len(np.unique(owner[distance.argmin(1)][near & (board == wall)])) == 1


@pytest.mark.slow
@pytest.mark.parametrize("number", [4, 16, 23, 26])
def test_a_board_near_the_lens_or_the_rim_or_in_shadow_is_whole(number):
    path = DATA / "boofcv_chessboard" / "images" / f"{number}.jpg"
    if not path.exists():
        pytest.skip("no boofcv_chessboard photos")
    (grid,) = find_grids(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)).grids
    assert len(grid) == 24
    assert sorted(grid.cells.max(0)) == [3, 5]
