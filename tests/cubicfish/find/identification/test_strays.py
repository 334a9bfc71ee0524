"""Corners that hang on a grid beyond its board: cut off where they are few, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from seen import grid_evidence
from synthetic import IMAGE_SIZE, checkerboard, corner_of_three, flat_board

from cubicfish.diagnosis.corner_count import nothing_named
from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.ends import doubtful_rims, solid, without_strays
from cubicfish.find.identification.identified import Decided, remark_of
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.judge.codes import Code
from cubicfish.target.target import Target
from tests.cubicfish.find.identification.test_name_grids import names, places, seen

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
    assert tuple(np.ptp(solid(grid(9, 6, *strays)).cells, axis=0) + 1) == (9, 6)


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
    identified = name_grids(grids, target, IMAGE_SIZE, names(len(grids)))
    assert [photo[0].verdict for photo in identified.grids] == [Decided.NAMED] * len(grids)
    assert len(identified.corners.pixel) == 88 * len(grids)
    assert identified.corners.certain.all()


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
    identified = name_grids(covered, target, IMAGE_SIZE, names(len(covered)))
    assert [photo[0].verdict for photo in identified.grids] == [Decided.NAMED] * len(covered)
    assert len(identified.corners.pixel) == 82 * len(covered)


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
    identified = name_grids(photos, target, IMAGE_SIZE, names(len(photos)))
    assert places(identified) == truth


def test_a_photo_of_a_larger_board_says_so_without_counting_strays():
    target = Target(units="mm", boards=(checkerboard("b", 9, 6, 30.0),))
    identified = name_grids([[grid(12, 8, (12, 3))]] * 2, target, IMAGE_SIZE, names(2))
    assert identified.grids[0][0].verdict is Decided.TOO_LARGE
    assert identified.grids[0][0].size == (12, 8)
    (reported,) = nothing_named(grid_evidence(identified, target))
    assert reported.figures["seen"] == "12x8"


def shifted_by_a_line(own: Grid) -> tuple[Grid, np.ndarray, tuple[int, int]] | None:
    """A board of 10x7 and a line before it, its last line behind the border; None if it is not.

    Args:
        own: a whole grid of 11x7.

    Returns:
        The grid, which corners are on the line before the board, and the picture's size.

    """
    axis = int(np.argmax(own.cells.max(axis=0)))
    for side in (0, 1):
        for end in (0, 10):
            border = float(own.pixel[own.cells[:, axis] == end, side].min()) - 1
            keep = own.pixel[:, side] < border
            if keep.sum() < 70 - 3 or len(np.unique(own.cells[keep, axis])) != 10:
                continue
            part = _part_of(own, keep)
            first = part.cells[:, axis] == (0 if end == 10 else 9)
            size = (int(border), IMAGE_SIZE[1]) if side == 0 else (IMAGE_SIZE[0], int(border))
            return part, first, size
    return None


def _part_of(own: Grid, keep: np.ndarray) -> Grid:
    first = own.cells[keep].min(axis=0)
    return replace(
        own,
        cells=own.cells[keep] - first,
        pixel=own.pixel[keep],
        parity=own.parity * (-1) ** int(first.sum()),
        contrast=own.contrast[keep],
    )


def shifted_boards(rows: int) -> list[tuple[Grid, np.ndarray, tuple[int, int]]]:
    larger = Target(units="mm", boards=(checkerboard("b", 11, rows, 30.0),))
    corners = seen(larger, photos=30, distance=(0.9, 1.4))
    grids = [own[0] for own in anonymous_photos(corners, larger)[0] if len(own[0]) == 11 * rows]
    made = [one for own in grids if (one := shifted_by_a_line(own)) is not None]
    assert len(made) >= 3
    return made


@pytest.mark.slow
@pytest.mark.parametrize("why", ["few", "faint"])
def test_a_line_that_may_be_none_of_a_cut_boards_is_not_certain(why):
    target = Target(units="mm", boards=(checkerboard("b", 10, 7, 30.0),))
    for whole, first, size in shifted_boards(7):
        if why == "few":
            axis = int(np.ptp(whole.cells[first], axis=0).argmax())
            across = whole.cells[:, axis]
            part = _part_of(whole, ~first | (across == 3) | (across == 4))
        else:
            part = replace(whole, contrast=np.where(first, 30.0, whole.contrast))
        identified = name_grids([[part]], target, size, names(1))
        assert identified.grids[0][0].verdict is Decided.CONVENTION
        assert len(identified.corners.pixel) == len(part)
        assert not identified.exact.any()
        # It is no part of the board in its middle, but as wide as all of it.
        remark = remark_of("a.png", identified.grids[0][0])
        assert remark is not None
        assert (remark.code, remark.case) == (Code.BY_CONVENTION, "whole")
        # With nothing against that line the board is whole.
        assert name_grids([[whole]], target, size, names(1)).exact.all()


@pytest.mark.slow
def test_colours_tell_whether_a_weak_line_is_the_boards():
    """A board of 10x8 begins with one colour only, whichever way it is turned."""
    target = Target(units="mm", boards=(checkerboard("b", 10, 8, 30.0),))
    for whole, first, size in shifted_boards(8):
        part = replace(whole, contrast=np.where(first, 30.0, whole.contrast))
        assert name_grids([[part]], target, size, names(1)).exact.all()


def test_a_line_askew_to_the_others_is_doubtful():
    own = grid(9, 6)
    own = replace(own, contrast=np.full(54, 100.0))
    assert doubtful_rims(own) == []
    last = own.cells[:, 0] == 8
    askew = replace(own, pixel=own.pixel + 12.0 * np.outer(last, [1.0, 0.0]))
    assert [rim.tolist() for rim in doubtful_rims(askew)] == [last.tolist()]


def test_a_truly_weak_line_is_certain_where_the_board_ends_on_the_other_side():
    """A hand leaves two of the last column's corners; behind the first one the board ends."""
    target = flat_board()
    corners = seen(target, photos=6, distance=(0.9, 1.4))
    grids = []
    for own in (one[0] for one in anonymous_photos(corners, target)[0] if len(one[0]) == 88):
        axis = int(np.argmax(own.cells.max(axis=0)))
        last = own.cells[:, axis] == 10
        grids.append([_part_of(own, ~last | (own.cells[:, 1 - axis] < 2))])
    identified = name_grids(grids, target, IMAGE_SIZE, names(len(grids)))
    assert len(grids) >= 3
    assert [photo[0].verdict for photo in identified.grids] == [Decided.NAMED] * len(grids)
    assert identified.exact.all()


@pytest.mark.slow
def test_a_full_line_beside_the_border_stays_certain():
    """The board fills the picture to its borders: nothing speaks against its outermost lines."""
    target = flat_board()
    corners = seen(target, photos=6, distance=(0.9, 1.4))
    grids = [own[0] for own in anonymous_photos(corners, target)[0] if len(own[0]) == 88]
    for own in grids:
        size = tuple(int(side) for side in own.pixel.max(axis=0) + 2)
        identified = name_grids([[own]], target, size, names(1))
        assert identified.grids[0][0].verdict is Decided.NAMED
