"""Markers that blur leaves unreadable one by one, and readable together."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.markers import find_marked_corners
from cubicfish.find.detection.markers_detect import Sight
from cubicfish.find.detection.markers_read import read_grid, read_together
from cubicfish.scene.truth import project_corners
from cubicfish.target.target import Target
from tests.cubicfish.find.detection.test_markers import (
    LENS,
    POSE,
    SIZE,
    errors,
    find,
    photo_of,
    true_grid,
    wall,
)

BOARD = wall("front", "charuco", (7, 6), 22.0)


@pytest.fixture(scope="module")
def sharp():
    return photo_of(Target(units="mm", boards=(BOARD,)), noise=0)


def soft(photo, blur):
    light = cv2.GaussianBlur(photo.astype(float), (0, 0), blur)
    light += np.random.default_rng(0).normal(0, 1, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def blurred(sharp):
    return soft(sharp, 3.0)


def read(photo, board, grid):
    target = Target(units="mm", boards=(board,))
    return read_together(Sight.of(photo, target), grid)


@pytest.mark.parametrize("turn", range(4))
def test_a_grid_of_blurred_markers_is_named_however_it_is_turned(blurred, turn):
    target, grid = true_grid(BOARD, turn)
    assert len(read_grid(Sight.of(blurred, target), grid)) == 0
    named = read(blurred, BOARD, grid)
    seen = project_corners(target, LENS, POSE, SIZE)
    assert named is not None
    assert np.array_equal(named.cells, np.stack([seen.column, seen.row], axis=-1))


def test_a_part_of_it_is_found_among_all_places(blurred):
    _, grid = true_grid(BOARD)
    part = (grid.cells[:, 0] >= 2) & (grid.cells[:, 1] >= 1)
    parity = grid.parity * (-1) ** (2 + 1)
    cut = replace(
        grid,
        cells=grid.cells[part] - (2, 1),
        pixel=grid.pixel[part],
        contrast=grid.contrast[part],
        parity=parity,
    )
    named = read(blurred, BOARD, cut)
    assert named is not None
    assert np.array_equal(named.cells, grid.cells[part])


def test_other_markers_or_the_same_in_another_order_name_nothing(blurred):
    _, grid = true_grid(BOARD)
    markers = BOARD.markers
    assert read(blurred, replace(BOARD, markers=replace(markers, first=18)), grid) is None
    # One column more: only the first row has its markers where they are.
    wide = wall("front", "charuco", (8, 6), 22.0)
    assert read(blurred, wide, grid) is None


def test_their_corners_are_found_and_named(blurred):
    target, grid = true_grid(BOARD)
    none = FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=SIZE)
    assert len(find_marked_corners(blurred, target, none)) == 0
    found = find_marked_corners(blurred, target, replace(none, grids=(grid,)))
    seen = project_corners(target, LENS, POSE, SIZE)
    true = seen.pixel.reshape(6, 7, 2)[found.row, found.column]
    assert len(found) >= 30
    assert np.hypot(*(found.pixel - true).T).max() < 1.0  # blurred by 3 px, it is no other one
    assert found.grid_board.tolist() == [0]


@pytest.mark.parametrize("blur", [1.2, 1.8, 2.5])
def test_a_board_is_read_where_few_or_none_of_its_markers_are(sharp, blur):
    target, _ = true_grid(BOARD)
    found = find(soft(sharp, blur), target)
    error, share = errors(found, target)
    assert error.max() < 0.5
    assert share > 0.85
