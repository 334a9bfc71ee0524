import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard, corner_of_three

from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.allowed_offsets import find_allowed_offsets
from cubicfish.find.identification.decide import _Photo
from cubicfish.find.identification.search import Labelings
from cubicfish.target.placement import TURNS, placement_of
from cubicfish.target.target import Target


def grid(columns: int, rows: int, parity: int) -> Grid:
    cells = np.indices((columns, rows)).reshape(2, -1).T
    return Grid(
        cells=cells,
        pixel=cells * 10.0,
        parity=parity,
        step=10.0,
        contrast=np.full(len(cells), 100.0),
    )


def one_board(columns: int, rows: int) -> Target:
    return Target(units="mm", boards=(checkerboard("b", columns, rows, 10.0),))


@pytest.mark.slow
@given(
    st.integers(2, 7),
    st.integers(2, 7),
    st.integers(2, 5),
    st.integers(2, 5),
    st.sampled_from([-1, 1]),
)
def test_places_are_all_those_where_extent_and_colours_agree(columns, rows, width, height, parity):
    # The squares' colours are painted, not computed from a rule: turn the painting and compare.
    sides = placement_of(one_board(columns, rows))
    side, offset = find_allowed_offsets(grid(width, height, parity).cells, parity, sides).places()
    found = {(int(s), *map(int, o)) for s, o in zip(side, offset, strict=True)}
    squares = np.where(np.add(*np.indices((columns + 1, rows + 1))) % 2 == 0, -1, 1)
    expected = set()
    for turn in range(4):
        for column in range(-8, 9):
            for row in range(-8, 9):
                box = np.array([[0, 0], [width - 1, height - 1]]) @ TURNS[turn].T + [column, row]
                inside = (box >= 0).all() and (box < [columns, rows]).all()
                if not inside:
                    continue
                # middle of the square between cells (0, 0) and (1, 1), counted from the square
                # up-left of corner (0, 0), whose middle is at (-1/2, -1/2)
                middle = TURNS[turn] @ [0.5, 0.5] + [column, row]
                i, j = np.rint(middle + 0.5).astype(int)
                if squares[i, j] == parity:
                    expected.add((turn, column, row))
    assert found == expected


def test_world_points_of_a_place_are_those_of_the_board():
    target = corner_of_three()
    sides = placement_of(target)
    one = grid(3, 4, 1)
    side, offset = find_allowed_offsets(one.cells, one.parity, sides).places()
    assert {int(sides.board[s]) for s in side} == {0, 1, 2}
    forms = sides.world_from_grid(side, offset)
    for k in range(len(side)):
        cells = sides.board_cells(int(side[k]), offset[k], one.cells)
        board = target.boards[sides.board[side[k]]]
        world = np.column_stack([one.cells, np.ones(len(one))]) @ forms[k].T
        np.testing.assert_allclose(world, board.world_points(*cells.T), atol=1e-9)


def test_a_grid_larger_than_the_board_has_no_place():
    allowed = find_allowed_offsets(grid(5, 4, 1).cells, 1, placement_of(one_board(4, 4)))
    assert not allowed.possible
    assert len(allowed.places()[0]) == 0


def test_a_grid_is_possible_where_it_has_a_place() -> None:
    seen = set()
    for columns, rows, width, height, bright in np.ndindex(3, 3, 4, 4, 2):
        sides, parity = placement_of(one_board(columns + 2, rows + 2)), 2 * bright - 1
        allowed = find_allowed_offsets(grid(width + 2, height + 2, parity).cells, parity, sides)
        assert allowed.possible == (len(allowed.places()[0]) > 0)
        seen.add((allowed.possible, allowed.wide_enough))
    assert seen == {(True, True), (False, True), (False, False)}


def test_labelings_are_apart_where_no_two_grids_claim_a_corner() -> None:
    rng = np.random.default_rng(4)
    sides = placement_of(corner_of_three())
    photo = _Photo(grids=[grid(3, 4, 1), grid(4, 3, 1), grid(2, 5, -1)], sides=sides)
    count = 300
    labelings = Labelings(
        side=rng.integers(-1, len(sides.board), (count, 3)),
        offset=rng.integers(0, 6, (count, 3, 2)),
        rotation=np.zeros((count, 3, 3)),
        translation=np.zeros((count, 3)),
        pivot=np.zeros((count, 3)),
        grid_cost=np.zeros((count, 3)),
    )
    labelings = labelings[(labelings.side >= 0).sum(axis=1) > 1]
    apart = [
        k
        for k in range(len(labelings))
        if not photo.overlap(labelings.side[k], labelings.offset[k])
    ]
    assert photo.list_apart(labelings) == apart
    assert 0 < len(apart) < len(labelings)
