import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard

from cubicfish.geometry import similarity
from cubicfish.target.placement import TURNS, placement_of
from cubicfish.target.target import Target


def one_board(columns: int, rows: int) -> Target:
    return Target(units="mm", boards=(checkerboard("b", columns, rows, 10.0),))


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
        assert (sides.landing(motion.rotation, motion.shift) is not None) == (k in turns)


def test_a_slide_or_another_scale_is_no_symmetry():
    sides = placement_of(one_board(6, 4))
    assert sides.landing(np.eye(3), np.array([20.0, 0, 0])) is None
    assert sides.landing(1.2 * np.eye(3), np.zeros(3)) is None


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
