"""Corners that hang on a grid beyond its board: cut off where they are few, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from synthetic import IMAGE_SIZE, checkerboard, corner_of_three, flat_board
from test_naming_name_grids import names, places, seen

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.naming.decide import Verdict
from cubicfish_cli.naming.name_grids import name_grids
from cubicfish_cli.naming.refusals import nothing_named
from cubicfish_cli.naming.strays import solid_size, without_strays
from cubicfish_cli.target import Target

BOARD = np.array([[9, 6], [6, 9]])


def grid(columns, rows, *more):
    """A full grid of so many corners, and more at other cells, which may be negative."""
    full = np.argwhere(np.ones((columns, rows), bool))
    return with_corners(
        Grid(
            cells=full,
            pixel=20.0 * full,
            parity=1,
            step=20.0,
            contrast=np.arange(len(full), dtype=float),
        ),
        *more,
    )


def with_corners(own, *more):
    """A grid with corners at more cells, where the grid's own plane would have them."""
    if not more:
        return own
    affine = np.linalg.lstsq(
        np.column_stack([own.cells, np.ones(len(own))]), own.pixel, rcond=None
    )[0]
    beyond = np.column_stack([more, np.ones(len(more))]) @ affine
    cells = np.concatenate([own.cells, more])
    first = cells.min(axis=0)
    return replace(
        own,
        cells=cells - first,
        pixel=np.concatenate([own.pixel, beyond]),
        parity=own.parity * (-1) ** int(first.sum()),
        contrast=np.concatenate([own.contrast, np.zeros(len(more))]),
    )


@pytest.mark.parametrize(
    "strays",
    [
        [(9, 3)],
        [(-1, 2)],
        [(9, 2), (9, 3)],
        [(9, 2), (9, 3), (10, 2), (10, 3)],
        [(3, -1), (4, -1), (9, 0)],
        [(-1, -1)],
        [(-1, 1), (9, 4), (3, 6)],
    ],
)
def test_strays_are_cut_off_a_whole_board(strays):
    cut = without_strays(grid(9, 6, *strays), BOARD)
    own = grid(9, 6)
    order = np.lexsort(cut.cells.T[::-1])
    np.testing.assert_array_equal(cut.cells[order], own.cells)
    np.testing.assert_allclose(cut.pixel[order], own.pixel)
    np.testing.assert_array_equal(cut.contrast[order], own.contrast)
    assert cut.parity == own.parity
    assert solid_size(grid(9, 6, *strays)) == (9, 6)


@pytest.mark.parametrize(
    "larger",
    [
        grid(10, 6),
        grid(9, 7),
        grid(10, 7),
        grid(9, 6, *[(9, row) for row in range(4)]),
        grid(9, 6, *[(column, 6) for column in range(5)]),
        grid(9, 6, *[(9 + i, row) for i in range(4) for row in (2, 3)]),
    ],
)
def test_what_is_truly_larger_stays_so(larger):
    assert without_strays(larger, BOARD) is None


def test_no_line_is_cut_that_need_not_be():
    """A line of two corners at the picture's rim may be the board's own."""
    part = grid(8, 6, (8, 2), (8, 3), (-1, 5))
    cut = without_strays(part, BOARD)
    assert len(cut) == 8 * 6 + 2
    kept = without_strays(grid(8, 6, (8, 2), (8, 3)), BOARD)
    assert len(kept) == 8 * 6 + 2


def test_of_two_lines_alike_none_is_the_boards():
    cut = without_strays(grid(8, 6, (8, 2), (-1, 3)), BOARD)
    assert np.ptp(cut.cells, axis=0).tolist() == [7, 5]


def test_a_lone_board_with_strays_keeps_its_photos():
    target = flat_board()
    corners = seen(target, photos=6, distance=(0.9, 1.4))
    grids, truth = anonymous_photos(corners, target)
    whole = [(own, place) for own, place in zip(grids, truth, strict=True) if len(own[0]) == 88]
    assert len(whole) >= 3
    grids = []
    for own, _ in whole:
        last = own[0].cells.max(axis=0)
        grids.append([with_corners(own[0], (last[0] + 1, 2), (last[0] + 1, 3), (0, -1))])
    naming = name_grids(grids, target, IMAGE_SIZE, names(len(grids)))
    assert [photo[0].verdict for photo in naming.grids] == [Verdict.NAMED] * len(grids)
    assert len(naming.corners.pixel) == 88 * len(grids)
    assert naming.corners.certain.all()


def test_a_weak_line_of_the_board_itself_stays_where_strays_go():
    """Of the last column a hand leaves two corners; a stray is beside the first row."""
    target = flat_board()
    corners = seen(target, photos=6, distance=(0.9, 1.4))
    grids = [own[0] for own in anonymous_photos(corners, target)[0] if len(own[0]) == 88]
    assert len(grids) >= 3
    covered = []
    for own in grids:
        axis = int(np.argmax(own.cells.max(axis=0)))  # along the board's 11 columns
        last = own.cells[:, axis] == own.cells[:, axis].max()
        keep = ~last | (own.cells[:, 1 - axis] == 2) | (own.cells[:, 1 - axis] == 3)
        part = replace(
            own,
            cells=own.cells[keep],
            pixel=own.pixel[keep],
            contrast=own.contrast[keep],
        )
        covered.append([with_corners(part, (3, -1) if axis == 0 else (-1, 3))])
    naming = name_grids(covered, target, IMAGE_SIZE, names(len(covered)))
    assert [photo[0].verdict for photo in naming.grids] == [Verdict.NAMED] * len(covered)
    assert len(naming.corners.pixel) == 82 * len(covered)


@pytest.mark.slow
def test_strays_do_not_make_a_board_another_larger_one():
    """The wall with a stray still fits the floor's size: it is tried without the stray too."""
    target = corner_of_three()
    corners = seen(target, photos=6)
    grids, truth = anonymous_photos(corners, target)
    sizes = sorted((b.columns, b.rows) for b in target.boards)
    assert sizes[0] < sizes[-1]
    changed, photos = 0, []
    for own, right in zip(grids, truth, strict=True):
        photo = []
        for one, place in zip(own, right, strict=True):
            board = target.boards[place.board]
            if len(one) == board.columns * board.rows:
                one = with_corners(one, (int(one.cells[:, 0].max()) + 1, 1))
                changed += 1
            photo.append(one)
        photos.append(photo)
    assert changed >= 6
    naming = name_grids(photos, target, IMAGE_SIZE, names(len(photos)))
    assert places(naming) == truth


def test_a_photo_of_a_larger_board_says_so_without_counting_strays():
    target = Target(units="mm", boards=(checkerboard("b", 9, 6, 30.0),))
    naming = name_grids([[grid(12, 8, (12, 3))]] * 2, target, IMAGE_SIZE, names(2))
    assert naming.grids[0][0].verdict is Verdict.TOO_LARGE
    assert naming.grids[0][0].size == (12, 8)
    told = nothing_named(naming, target)
    assert (told.figures["columns"], told.figures["rows"]) == (12, 8)
