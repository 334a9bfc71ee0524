import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard, corner_of_three

from cubicfish_cli.core.geometry import similarity
from cubicfish_cli.core.placement import TURNS, placement_of, reach_of
from cubicfish_cli.core.target import Target
from cubicfish_cli.corners.detection.grids import Grid


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
    side, offset = reach_of(grid(width, height, parity).cells, parity, sides).places()
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
    side, offset = reach_of(one.cells, one.parity, sides).places()
    assert {int(sides.board[s]) for s in side} == {0, 1, 2}
    forms = sides.world_from_grid(side, offset)
    for k in range(len(side)):
        cells = sides.board_cells(int(side[k]), offset[k], one.cells)
        board = target.boards[sides.board[side[k]]]
        world = np.column_stack([one.cells, np.ones(len(one))]) @ forms[k].T
        np.testing.assert_allclose(world, board.world_points(*cells.T), atol=1e-9)


def test_a_grid_larger_than_the_board_has_no_place():
    reach = reach_of(grid(5, 4, 1).cells, 1, placement_of(one_board(4, 4)))
    assert not reach.possible
    assert len(reach.places()[0]) == 0


@pytest.mark.parametrize(
    ("size", "turns"),
    [
        ((6, 4), {0, 2}),
        ((9, 6), {0}),
        ((7, 7), {0, 2}),
        ((6, 6), {0, 1, 2, 3}),
        ((7, 5), {0, 2}),
    ],
)
def test_symmetries_of_a_single_board(size, turns):
    """A board is symmetric exactly where turning its painted squares reproduces them."""
    columns, rows = size
    squares = np.where(np.add(*np.indices((columns + 1, rows + 1))) % 2 == 0, -1, 1)
    painted = {k for k in range(4) if np.array_equal(np.rot90(squares, k), squares)}
    assert painted == turns
    sides = placement_of(one_board(columns, rows))
    world = sides.origin[0] + 10.0 * np.array(
        [[0, 0, 0], [columns - 1, 0, 0], [columns - 1, rows - 1, 0], [0, rows - 1, 0]], float
    )
    middle = world.mean(axis=0)
    for k in range(4):
        turn = np.eye(3)
        turn[:2, :2] = TURNS[k]
        motion = similarity(world, (world - middle) @ turn.T + middle)
        assert motion.error < 1e-9
        assert sides.is_symmetry(motion) == (k in turns)


def test_a_slide_or_another_scale_is_no_symmetry():
    sides = placement_of(one_board(6, 4))
    world = np.array([[0, 0, 0], [50, 0, 0], [50, 30, 0], [0, 30, 0]], float)
    assert not sides.is_symmetry(similarity(world, world + np.array([20.0, 0, 0])))
    assert not sides.is_symmetry(similarity(world, world * 1.2))


@given(st.integers(0, 10_000))
def test_similarity_recovers_a_random_one(seed):
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((6, 3)) * [1, 1, rng.integers(0, 2)]  # a plane too
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    scale, shift = rng.uniform(0.5, 2), rng.standard_normal(3)
    found = similarity(points, scale * points @ turn.T + shift)
    assert found.error < 1e-9
    assert found.scale == pytest.approx(scale)
    np.testing.assert_allclose(found.rotation, turn, atol=1e-6)
