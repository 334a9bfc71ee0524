"""Boards that have another number of corners than the target says, as photos count them."""

from dataclasses import replace

import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from seen import grid_evidence
from synthetic import (
    IMAGE_SIZE,
    checkerboard,
    corner_of_three,
    lens_of_size,
    poses_around,
    synthetic_corners,
)

from cubicfish.diagnosis.corner_count import Count, miscounted
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.scene.photos import Look
from cubicfish.scene.scene import Scene
from cubicfish.target.target import Target

pytestmark = pytest.mark.slow

ONE = Target(units="mm", boards=(checkerboard("board", 7, 5, 30.0),))
THREE = corner_of_three()
SMALL = lens_of_size(0.6)
PHOTOS = 4
NARROW = (700, 700)


def resized(target: Target, index: int, columns: int, rows: int) -> Target:
    """One board drawn with other numbers of corners."""
    boards = list(target.boards)
    boards[index] = replace(boards[index], columns=columns, rows=rows)
    return replace(target, boards=tuple(boards))


def reported(grids, target, size=IMAGE_SIZE):
    names = [f"{index}.png" for index in range(len(grids))]
    return grid_evidence(name_grids(grids, target, size, names), target).counts


def in_words(counts, target, photos):
    return miscounted(grid_evidence(None, target, counts=counts, photos=photos))


# One board, in small photos


POSES = poses_around(ONE, PHOTOS, distance=(0.9, 1.1), off_axis_deg=35, slant_deg=40, seed=4)


@pytest.fixture(scope="module")
def grids():
    poses = {str(number): pose for number, pose in enumerate(POSES)}
    pictures = Scene(target=ONE, lens=SMALL, image_size=SMALL.image_size).photos(poses, Look())
    return [find_grids(picture).grids for _, picture in pictures]


def without_last(grids, lines):
    """The grids without the last so many lines of their longer axis, in each photo."""
    shorter = []
    for (grid,), less in zip(grids, lines, strict=True):
        axis = int(np.argmax(grid.cells.max(axis=0)))
        kept = grid.cells[:, axis] <= grid.cells[:, axis].max() - less
        cut = {name: getattr(grid, name)[kept] for name in ("cells", "pixel", "contrast")}
        shorter.append((replace(grid, **cut),))
    return shorter


def test_a_board_that_is_as_drawn_has_no_other_count(grids):
    assert [len(own) for own in grids] == [1] * PHOTOS
    assert reported(grids, ONE, size=SMALL.image_size) == []


@pytest.mark.parametrize("drawn", [(8, 5), (7, 6), (9, 7), (6, 7)])
def test_a_lone_board_that_is_drawn_too_large(grids, drawn):
    (count,) = reported(grids, resized(ONE, 0, *drawn), SMALL.image_size)
    assert count.size == ((7, 5) if drawn[0] > drawn[1] else (5, 7))
    assert count.photos >= 2


@pytest.mark.parametrize("drawn", [(6, 5), (7, 4)])
def test_a_lone_board_that_is_drawn_too_small(grids, drawn):
    assert reported(grids, resized(ONE, 0, *drawn), size=SMALL.image_size) == [
        Count(board=0, size=(7, 5), photos=PHOTOS)
    ]


@pytest.mark.parametrize("lines", [(1, 1, 1, 0), (2, 1, 1, 2), (3, 2, 0, 1)])
def test_lines_that_are_missed_here_and_there_are_no_end_of_the_board(grids, lines):
    """One photo has all of them, or not all photos have lost as many."""
    assert reported(without_last(grids, lines), ONE, SMALL.image_size) == []


def test_a_board_that_leaves_the_picture_has_no_end_there():
    """The last column of each photo is beyond the picture's rim, and in the lens's field."""
    tilts = [(0.3 * np.sin(k), 0.3 * np.cos(k), 0.02 * k) for k in range(6)]
    cut = [pose for tilt in tilts if (pose := at_the_rim(np.array(tilt))) is not None]
    assert len(cut) >= 4
    corners = synthetic_corners(ONE, cut, image_size=NARROW)
    grids = anonymous_photos(corners, ONE)[0]
    assert {tuple(sorted(np.ptp(own[0].cells, axis=0) + 1)) for own in grids} == {(5, 6)}
    assert reported(grids, ONE, NARROW) == []


def at_the_rim(tilt):
    """A pose from which the board is seen but for its last column, if there is any."""
    for x in np.linspace(-100, 300, 200):
        pose = (tilt, np.array([x, -60.0, 200.0]))
        seen = synthetic_corners(ONE, [pose], image_size=NARROW)
        if len(seen.pixel) == 30 and (seen.column < 6).all():
            return pose
    return None


# Three boards, of which each has its place


@pytest.fixture(scope="module")
def corner():
    """What a detector finds in photos of the object."""
    corners = synthetic_corners(THREE, poses_around(THREE, 5, seed=2), noise=0.1, seed=3)
    return anonymous_photos(corners, THREE)[0]


def test_boards_that_are_as_drawn_have_no_other_counts(corner):
    assert reported(corner, THREE) == []


@pytest.mark.parametrize(("index", "drawn"), [(0, (8, 6)), (2, (7, 4))])
def test_a_board_among_others_that_is_drawn_too_small(corner, index, drawn):
    (count,) = reported(corner, resized(THREE, index, *drawn))
    board = THREE.boards[index]
    assert (count.board, count.size) == (index, (board.columns, board.rows))
    assert count.photos >= 2


def test_a_board_that_is_drawn_too_small_at_its_start(corner):
    """The drawing leaves the first column out, and says rightly where the second is."""
    floor = THREE.boards[0]
    target = resized(THREE, 0, 8, 6)
    moved = replace(
        target.boards[0], origin=floor.origin + floor.square * floor.x_axis, first_square="light"
    )
    (count,) = reported(corner, replace(target, boards=(moved, *target.boards[1:])))
    assert (count.board, count.size) == (0, (9, 6))


def test_a_board_among_others_that_is_drawn_too_large(corner):
    (count,) = reported(corner, resized(THREE, 0, 10, 6))
    assert (count.board, count.size) == (0, (9, 6))


def test_one_photo_is_not_enough(corner):
    assert reported(corner[:1], resized(THREE, 0, 8, 6)) == []
