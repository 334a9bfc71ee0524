"""Boards that have another number of corners than the target says, as photos count them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from seen import grid_evidence, no_photo
from synthetic import (
    IMAGE_SIZE,
    checkerboard,
    corner_of_three,
    lens_of_size,
    poses_around,
    synthetic_corners,
)

from cubicfish_cli.detection.finder import find_grids
from cubicfish_cli.diagnosis import fewer_corners as module
from cubicfish_cli.diagnosis import more_corners
from cubicfish_cli.diagnosis.corner_count import miscounted
from cubicfish_cli.diagnosis.more_corners import Count
from cubicfish_cli.identification.name_grids import name_grids
from cubicfish_cli.rendering.options import LookOptions
from cubicfish_cli.rendering.simulate import simulated_photos
from cubicfish_cli.rendering.truth import camera_points
from cubicfish_cli.target import Target

pytestmark = pytest.mark.slow

ONE = Target(units="mm", boards=(checkerboard("board", 7, 5, 30.0),))
THREE = corner_of_three()
SMALL = lens_of_size(0.6)
PHOTOS = 4


def resized(target: Target, index: int, columns: int, rows: int) -> Target:
    """One board drawn with other numbers of corners."""
    boards = list(target.boards)
    boards[index] = replace(boards[index], columns=columns, rows=rows)
    return replace(target, boards=tuple(boards))


def told(grids, target, pictures=None, size=IMAGE_SIZE):
    names = [f"{index}.png" for index in range(len(grids))]
    identified = name_grids(grids, target, size, names)

    picture = no_photo if pictures is None else pictures.__getitem__
    return grid_evidence(identified, target, picture).counts


def in_words(counts, target, photos):
    return miscounted(grid_evidence(None, target, counts=counts, photos=photos))


# One board, in small photos


POSES = poses_around(ONE, PHOTOS, distance=(0.9, 1.1), off_axis_deg=35, slant_deg=40, seed=4)


@pytest.fixture(scope="module")
def pictures():
    poses = {str(number): pose for number, pose in enumerate(POSES)}
    return [
        picture
        for _, picture in simulated_photos(ONE, SMALL, SMALL.image_size, poses, LookOptions())
    ]


@pytest.fixture(scope="module")
def grids(pictures):
    return found(pictures)


def found(pictures):
    return [find_grids(picture).grids for picture in pictures]


def test_a_board_that_is_as_drawn_needs_no_look(grids):
    assert [len(own) for own in grids] == [1] * PHOTOS
    assert told(grids, ONE, size=SMALL.image_size) == []


@pytest.mark.parametrize("drawn", [(8, 5), (7, 6), (9, 7), (6, 7)])
def test_a_lone_board_that_is_drawn_too_large(grids, pictures, drawn):
    (count,) = told(grids, resized(ONE, 0, *drawn), pictures, SMALL.image_size)
    assert count.size == ((7, 5) if drawn[0] > drawn[1] else (5, 7))
    assert count.photos >= 2


@pytest.mark.parametrize("drawn", [(6, 5), (7, 4)])
def test_a_lone_board_that_is_drawn_too_small(grids, drawn):
    assert told(grids, resized(ONE, 0, *drawn), size=SMALL.image_size) == [
        Count(board=0, size=(7, 5), photos=PHOTOS)
    ]


@pytest.mark.parametrize("level", [15, 120, 240])
def test_a_strip_over_the_last_column_is_no_end_of_the_board(pictures, level):
    """The same strip in all photos, which covers half a square more than the last corners."""
    covered = []
    for picture, pose in zip(pictures, POSES, strict=True):
        along = np.linspace(-1.6, 5.6, 30)
        rim = [(5.5, row) for row in along] + [(9.0, row) for row in along[::-1]]
        plane = 30.0 * np.array([(*cell, 0.0) for cell in (np.array(rim))])
        pixel = SMALL.project(camera_points(pose, plane))
        one = picture.copy()
        cv2.fillPoly(one, [np.round(pixel * 16).astype(np.int32)], level, cv2.LINE_AA, 4)
        covered.append(one)
    grids = found(covered)
    sizes = {tuple(sorted(np.ptp(grid.cells, axis=0) + 1)) for own in grids for grid in own}
    assert sizes == {(5, 6)}
    assert told(grids, ONE, covered, SMALL.image_size) == []


def test_corners_that_are_missed_though_squares_go_on(grids, pictures):
    """The last column is in all photos, and the finder has it in none."""
    shorter = []
    for own in grids:
        (grid,) = own
        axis = int(np.argmax(grid.cells.max(axis=0)))
        kept = grid.cells[:, axis] < grid.cells[:, axis].max()
        cut = {name: getattr(grid, name)[kept] for name in ("cells", "pixel", "contrast")}
        shorter.append((replace(grid, **cut),))
    assert told(shorter, ONE, pictures, SMALL.image_size) == []


# Three boards, of which each has its place


@pytest.fixture(scope="module")
def corner():
    """What a detector finds in photos of the object."""
    corners = synthetic_corners(THREE, poses_around(THREE, 5, seed=2), noise=0.1, seed=3)
    return anonymous_photos(corners, THREE)[0]


def test_boards_that_are_as_drawn_are_not_named_again(corner, monkeypatch):
    names = [f"{index}.png" for index in range(5)]
    identified = name_grids(corner, THREE, IMAGE_SIZE, names)
    monkeypatch.setattr(more_corners, "name_again", lambda *_: pytest.fail("must not be tried"))
    monkeypatch.setattr(module, "_sights", lambda *_: pytest.fail("must not be tried"))
    assert grid_evidence(identified, THREE).counts == []


@pytest.mark.parametrize(("index", "drawn"), [(0, (8, 6)), (2, (7, 4))])
def test_a_board_among_others_that_is_drawn_too_small(corner, index, drawn):
    (count,) = told(corner, resized(THREE, index, *drawn))
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
    (count,) = told(corner, replace(target, boards=(moved, *target.boards[1:])))
    assert (count.board, count.size) == (0, (9, 6))


@pytest.mark.parametrize(
    ("ends", "size"),
    [
        (1.0, (9, 6)),  # whole squares
        (0.4, None),  # the board's other ends are elsewhere: something covers it
        (np.inf, None),  # squares go on
        (None, None),  # no photo tells
    ],
)
def test_a_board_among_others_that_is_drawn_too_large(corner, monkeypatch, ends, size):
    target = resized(THREE, 0, 10, 6)

    def pattern_end(picture, camera, form, grid, axis, **_):
        lines = sorted((grid.cells.max(axis=0) + 1).tolist())
        return ends if lines == [6, 9] and grid.cells[:, axis].max() == 8 else 1.0

    monkeypatch.setattr(module, "pattern_end", pattern_end)
    counts = told(corner, target, [np.zeros((2, 2))] * 5)
    assert [count.size for count in counts] == ([] if size is None else [size])


def test_cut_squares_are_believed_where_all_ends_are_cut_alike(corner, monkeypatch):
    monkeypatch.setattr(module, "pattern_end", lambda *_, **__: 0.4)
    (count,) = told(corner, resized(THREE, 0, 10, 6), [np.zeros((2, 2))] * 5)
    assert count.size == (9, 6)


def test_photos_that_cannot_be_read_again_tell_nothing(corner):
    assert told(corner, resized(THREE, 0, 10, 6), [None] * 5) == []


def test_one_photo_is_not_enough(corner):
    assert told(corner[:1], resized(THREE, 0, 8, 6)) == []


def test_of_a_board_that_is_cut_in_all_photos_only_what_is_seen_is_told(corner, monkeypatch):
    """Rows end in view, and the last two columns are beyond the picture."""
    monkeypatch.setattr(module, "pattern_end", lambda *_, **__: 1.0)
    monkeypatch.setattr(module, "_ends", _no_columns(module._ends))
    target = resized(THREE, 0, 11, 7)
    (count,) = told(corner, target, [np.zeros((2, 2))] * 5)
    assert (count.size, count.sure) == ((11, 6), (False, True))
    (finding,) = in_words([count], target, 5)
    assert finding.what == (
        "photos show 6 rows of inner corners of board floor (the target says 7)"
    )


def _no_columns(ends):
    return lambda sights, sides, shows: None if (0, 1) in sides else ends(sights, sides, shows)


# In words


def test_what_is_said():
    counts = [Count(board=0, size=(9, 6), photos=8)]
    (finding,) = in_words(counts, resized(THREE, 0, 10, 6), 10)
    assert (finding.code, finding.severity, finding.boards) == ("corner_count", "care", ("floor",))
    assert finding.line == (
        "photos show 9x6 inner corners of board floor (the target says 10x6) (8 of 10 photos "
        "show where it ends, none shows otherwise); correct the counts of corners "
        "in target.yaml (or of --board) and run it again (origin too, if it was of a corner that "
        "is not there)"
    )
    assert in_words([], THREE, 10) == []


def test_several_boards_are_said_in_one_line():
    target = resized(resized(THREE, 0, 10, 7), 2, 8, 6)
    counts = [Count(board=0, size=(9, 6), photos=8), Count(board=2, size=(7, 5), photos=5)]
    (finding,) = in_words(counts, target, 10)
    assert finding.boards == ("floor", "right")
    assert "9x6 inner corners of board floor (the target says 10x7) and 7x5 inner " in finding.what
    assert finding.evidence.startswith("5 to 8 of 10 photos show where they end")
