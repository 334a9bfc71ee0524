"""Pieces that are worth growing, and what is done to many of them or of their corners at once."""

import cv2
import numpy as np
import pytest

from cubicfish.find.detection import corners as corners_module
from cubicfish.find.detection.corners import check_rings, find_corners
from cubicfish.find.detection.crossing import fit_crossings
from cubicfish.find.detection.lattice import LocalFit
from cubicfish.find.detection.links import Patch, find_patches
from cubicfish.find.detection.nearby import Tree
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.find.detection.seeds import find_promising
from cubicfish.find.detection.windows import group_windows

SIDE, MARGIN = 18, 60


def chequers(columns=8, rows=6):
    """A board of that many inner corners, white around it, blurred, with noise; and its corners."""
    cells = np.add.outer(np.arange(rows + 1), np.arange(columns + 1)) % 2
    board = np.kron(np.where(cells == 0, 40.0, 200.0), np.ones((SIDE, SIDE)))
    photo = cv2.GaussianBlur(np.pad(board, MARGIN, constant_values=200.0), (0, 0), 0.8)
    photo += np.random.default_rng(0).normal(0, 2, photo.shape)
    x, y = np.meshgrid(np.arange(1, columns + 1), np.arange(1, rows + 1))
    place = MARGIN + SIDE * np.stack([x, y], axis=-1).reshape(-1, 2) - 0.5
    return np.clip(np.rint(photo), 0, 255).astype(np.uint8), place


def piece(patch, rows, parity=None):
    return Patch(corner=patch.corner[rows], cells=patch.cells[rows], parity=parity or patch.parity)


def square_at(patch, i, j):
    cells = patch.cells - patch.cells.min(0)
    return np.flatnonzero(((cells >= (i, j)) & (cells <= (i + 1, j + 1))).all(1))


@pytest.fixture(scope="module")
def board():
    pyramid = build_pyramid(chequers()[0])
    corners = find_corners(pyramid)
    patch = find_patches(pyramid, corners)[0]
    assert len(patch.corner) == 48
    return pyramid, corners, patch


def test_single_squares_of_a_board_are_promising_and_others_are_not(board):
    pyramid, corners, patch = board
    last = np.ptp(patch.cells, axis=0) - 1
    squares = [piece(patch, square_at(patch, *at)) for at in ((0, 0), (3, 2), last)]
    # Of the wrong colours nothing around it is like a corner of its grid.
    wrong = piece(patch, square_at(patch, 3, 2), parity=-patch.parity)
    three = piece(patch, square_at(patch, 2, 2)[:3])
    every = [patch, squares[0], wrong, squares[1], three, squares[2]]
    free = Tree(corners.pixel)
    together = find_promising(pyramid, corners, every, free)
    assert together.tolist() == [True, True, False, True, False, True]
    alone = [find_promising(pyramid, corners, [one], free)[0] for one in every]
    assert together.tolist() == alone
    assert find_promising(pyramid, corners, [], free).shape == (0,)


def test_pieces_of_noise_are_not_promising():
    rng = np.random.default_rng(1)
    photo = cv2.resize(rng.random((120, 160)), (480, 360), interpolation=cv2.INTER_CUBIC)
    pyramid = build_pyramid((np.clip(photo, 0, 1) * 255).astype(np.uint8))
    corners = find_corners(pyramid)
    patches = [one for one in find_patches(pyramid, corners) if len(one.corner) >= 4]
    assert len(patches) > 20
    free = Tree(corners.pixel)
    assert find_promising(pyramid, corners, patches, free).mean() < 0.5


def test_every_window_is_in_one_group_that_holds_it():
    radius = np.random.default_rng(2).integers(3, 14, 400)
    groups = group_windows(radius)
    assert 1 < len(groups) < len(np.unique(radius))
    rows = np.concatenate([some for _, some in groups])
    assert np.array_equal(np.sort(rows), np.arange(len(radius)))
    assert all(radius[some].max() == size for size, some in groups)
    assert group_windows(np.zeros(0, int)) == []


def test_saddles_are_the_same_whatever_else_is_fitted():
    photo, place = chequers()
    rng = np.random.default_rng(3)
    start, half = place + rng.uniform(-0.6, 0.6, place.shape), rng.uniform(1.5, 6, len(place))
    start[:3] = [(2.2, 100), (photo.shape[1] - 2.4, 90), (80, 3)]  # their windows would not fit in
    together, ok = fit_saddles(photo, start, half)
    assert not ok[:3].any()
    assert ok[3:].mean() > 0.9
    for k in range(len(start)):
        alone, fine = fit_saddles(photo, start[k : k + 1], half[k : k + 1])
        assert fine[0] == ok[k]
        assert alone[0] == pytest.approx(together[k], abs=1e-9)


def test_crossings_are_the_same_whatever_else_is_fitted():
    photo, place = chequers()
    count = len(place)
    fit = LocalFit(
        pixel=place,
        step=np.tile(SIDE * np.eye(2), (count, 1, 1)),
        bend=np.zeros((count, 2, 3)),
        leverage=np.zeros(count),
        side=np.full(count, float(SIDE)),
        sound=np.ones(count, bool),
    )
    half = np.repeat([3.0, 4.0, 5.0, 7.0], count // 4)
    together = fit_crossings(photo, place + 0.03, fit, half, 2.0)
    assert together.ok.all()
    assert np.abs(together.pixel - place).max() < 0.2
    for k in range(0, count, 5):
        alone = fit_crossings(photo, place + 0.03, fit, half, 2.0, rows=np.array([k]))
        assert alone.pixel[0] == pytest.approx(together.pixel[k], abs=1e-5)
        assert alone.misfit[0] == pytest.approx(together.misfit[k], rel=1e-3)


def test_levels_on_a_sheet_show_what_they_show_alone():
    levels = build_pyramid(chequers()[0]).levels[1:]
    sheet, places = corners_module._lay_out(list(levels))
    rng = np.random.default_rng(4)
    for level, place in zip(levels, places, strict=True):
        height, width = level.shape
        part = sheet[place[1] : place[1] + height, place[0] : place[0] + width]
        assert np.array_equal(part, level)
        # Rings of many of them reach beyond the border.
        pixel = rng.uniform(0, 1, (300, 2)) * (width - 1, height - 1)
        limits = np.tile([*place, place[0] + width - 1, place[1] + height - 1], (300, 1))
        alone = corners_module.measure_contrast(level, pixel)
        there = corners_module.measure_contrast(sheet, pixel + place, limits)
        assert there == pytest.approx(alone, abs=1e-3)
        alone, which = check_rings(level, pixel, 3.0)
        there, which_there = check_rings(sheet, pixel + place, 3.0, limits)
        assert np.array_equal(which, which_there)
        assert np.array_equal(alone.radius, there.radius)
