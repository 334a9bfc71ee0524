"""Photos and drawings that are wrong in one way, told from grids that fit nowhere."""

from dataclasses import replace

import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from seen import grid_evidence
from synthetic import (
    IMAGE_SIZE,
    as_type,
    checkerboard,
    corner_of_three,
    poses_around,
    synthetic_corners,
)

from cubicfish.diagnosis import object_faults as module
from cubicfish.diagnosis.object_faults import find_wrong_layout
from cubicfish.find.detection.grids import grid_in_mirror
from cubicfish.find.identification import name_grids as naming
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.target.target import Target

TARGET = corner_of_three()
NAMES = [f"{index}.png" for index in range(5)]


@pytest.fixture(scope="module")
def grids():
    """What a detector finds in photos of the object."""
    corners = synthetic_corners(TARGET, poses_around(TARGET, 5, seed=2), noise=0.1, seed=3)
    return anonymous_photos(corners, TARGET)[0]


def reported(grids, target=TARGET):
    names = NAMES[: len(grids)]
    identified = name_grids(grids, target, IMAGE_SIZE, names)
    return next(iter(find_wrong_layout(grid_evidence(identified, target))), None)


def mirrored(grids, photos):
    """The same, with photos seen in a mirror: the grids found there are numbered anew."""
    return [
        [grid_in_mirror(grid, IMAGE_SIZE[0]) for grid in own] if photo in photos else own
        for photo, own in enumerate(grids)
    ]


def changed(index, **values):
    boards = list(TARGET.boards)
    boards[index] = replace(boards[index], **values)
    return replace(TARGET, boards=tuple(boards))


def test_a_mirrored_grid_is_the_one_of_the_mirrored_photo(grids):
    grid = grids[0][0]
    seen = grid_in_mirror(grid, IMAGE_SIZE[0])
    again = grid_in_mirror(seen, IMAGE_SIZE[0])
    np.testing.assert_array_equal(again.cells, grid.cells)
    np.testing.assert_allclose(again.pixel, grid.pixel)
    assert again.parity == grid.parity
    # Right-handed again, with the first square still the first.
    where = {tuple(cell): pixel for cell, pixel in zip(seen.cells, seen.pixel, strict=True)}
    for (i, j), pixel in zip(grid.cells, grid.pixel, strict=True):
        np.testing.assert_allclose(where[j, i], [IMAGE_SIZE[0] - 1, 0] + pixel * [-1, 1])
    right, below = where[1, 0] - where[0, 0], where[0, 1] - where[0, 0]
    assert right[0] * below[1] - right[1] * below[0] > 0
    assert seen.parity == grid.parity


def test_right_photos_of_a_right_drawing_are_not_named_again(grids, monkeypatch):
    identified = name_grids(grids, TARGET, IMAGE_SIZE, NAMES)
    monkeypatch.setattr(naming, "name_again", lambda *_: pytest.fail("must not be tried"))
    assert find_wrong_layout(grid_evidence(identified, TARGET)) == []


@pytest.mark.slow
def test_all_photos_mirrored(grids):
    finding = reported(mirrored(grids, range(5)))
    assert (finding.code, finding.severity, finding.images) == ("mirrored", "bad", ())


@pytest.mark.slow
@pytest.mark.parametrize("photos", [(2,), (0, 3)])
def test_some_photos_mirrored_of_which_some_boards_have_a_place(grids, photos):
    finding = reported(mirrored(grids, photos))
    assert finding.code == "mirrored"
    assert finding.images == tuple(NAMES[photo] for photo in photos)


@pytest.mark.slow
def test_a_photo_of_something_else_is_not_put_down_to_a_mirror(grids):
    """A floor with tiles of another size and count, in one photo."""
    tiles = Target(units="mm", boards=(checkerboard("tiles", 13, 4, 61.0),))
    poses = poses_around(tiles, 1, seed=1)
    other = anonymous_photos(synthetic_corners(tiles, poses, noise=0.1), tiles)[0]
    assert reported([*grids[:4], other[0]]) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "cause", "board"),
    [
        (
            changed(0, columns=6, rows=9),
            "board_order",
            "floor",
        ),
        (
            changed(1, y_axis=-TARGET.boards[1].y_axis),
            "board_order",
            "left",
        ),
        (
            changed(0, square=25 / 25.4),
            "board_square",
            "floor",
        ),
    ],
)
def test_one_board_drawn_wrongly_is_named(grids, target, cause, board):
    finding = reported(grids, target)
    assert finding.code == cause
    assert finding.boards == (board,)


@pytest.fixture
def few_trials(monkeypatch):
    """Mirrors and exchanged places alone are tried, to save time."""
    monkeypatch.setattr(module, "_change_board", lambda board: iter(()))


@pytest.mark.slow
def test_two_boards_places_exchanged(grids, few_trials):
    one, two = TARGET.boards[1], TARGET.boards[2]
    boards = (
        TARGET.boards[0],
        module._swap_place(one, two),
        module._swap_place(two, one),
    )
    finding = reported(grids[:3], replace(TARGET, boards=boards))
    assert finding.code == "board_names"
    assert finding.boards == ("left", "right")


@pytest.mark.slow
def test_what_nothing_simple_explains_is_left_alone(grids, few_trials):
    """All boards have other squares and places than drawn."""
    boards = [
        replace(board, square=board.square * ratio, origin=board.origin * ratio)
        for board, ratio in zip(TARGET.boards, (1.7, 0.6, 3.1), strict=True)
    ]
    assert reported(grids[:2], replace(TARGET, boards=tuple(boards))) is None


def test_boards_of_two_kinds_are_changed_alike():
    """A board without squares has no colours: what is tried of all is the same for each."""
    boards = (TARGET.boards[0], as_type(TARGET.boards[1], "aprilgrid"))
    assert [board.has_squares for board in boards] == [True, False]

    def tried(target, which):
        layouts = module._try_layouts(target)
        own = [one for one, _ in layouts if one.figures.get("which") == which]
        keys = ("order", "times", "small")
        said = [[one.code, *map(one.figures.get, keys)] for one in own]
        return [[module._IN_GENERAL.get(word, word) for word in words] for words in said]

    of_all = tried(replace(TARGET, boards=boards), "all")
    assert len(of_all) > 5
    assert of_all == tried(replace(TARGET, boards=boards[1:]), "one")
