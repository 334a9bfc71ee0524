"""The ink as polygons: dark exactly where the renderer says so, and in one piece where it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard

from cubicfish_cli.printing.canvas import ink_outlines
from tests.rendering.test_faces_markers import aprilgrid, charuco

BOARDS = {
    "checkerboard": checkerboard("a", 4, 3, 1.0),
    "charuco": charuco(),
    "charuco, light first": charuco(4, 3, first="light", dictionary="DICT_4X4_50", marker=0.7),
    "aprilgrid": aprilgrid(spacing=0.3),
    "aprilgrid of 16h5": aprilgrid(family="DICT_APRILTAG_16h5", start=2),
}


def winding(outlines, points):
    """How many times outlines go around points (N, 2): at the points' right, downs minus ups."""
    times = np.zeros(len(points), int)
    for outline in outlines:
        for (x, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            if x == x1:
                beside = (points[:, 1] >= min(y0, y1)) & (points[:, 1] < max(y0, y1))
                times += np.where(beside & (points[:, 0] < x), np.sign(y1 - y0).astype(int), 0)
    return times


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_ink_is_where_the_renderer_has_it(board):
    whole = board.face(margin=0.5)
    points = np.random.default_rng(1).uniform(whole.lower, whole.upper, (20_000, 2))
    times = winding(ink_outlines(whole, whole.lower, whole.upper), points)
    assert set(times.tolist()) == {0, 1}
    np.testing.assert_array_equal(times == 1, whole.is_dark(points))


@pytest.mark.slow
@given(
    st.sampled_from(list(BOARDS.values())),
    st.lists(st.floats(0, 1), min_size=4, max_size=4, unique=True),
    st.integers(0, 2**31),
)
def test_a_window_shows_its_part_and_no_more(board, ends, seed):
    whole = board.face(margin=0.2)
    extent = np.subtract(whole.upper, whole.lower)
    lower, upper = np.sort(np.reshape(ends, (2, 2)), axis=0) * extent + whole.lower
    if (upper - lower < 1e-6).any():
        return
    outlines = ink_outlines(whole, tuple(lower), tuple(upper))
    points = np.random.default_rng(seed).uniform(whole.lower, whole.upper, (300, 2))
    inside = ((points > lower) & (points < upper)).all(axis=1)
    np.testing.assert_array_equal(winding(outlines, points) == 1, inside & whole.is_dark(points))


def test_ink_that_touches_along_a_side_is_one_area():
    # A tag's frame and the modules that touch it are one outline, whose holes run the other way.
    whole = aprilgrid((2, 2)).face(margin=0.0)
    outlines = ink_outlines(whole, whole.lower, whole.upper)
    size = [np.ptp(outline, axis=0).max() for outline in outlines]
    assert sum(np.isclose(length, 1.0) for length in size) == 4
    # Every side lies between ink and paper: never inside the ink, where it could show.
    for outline in outlines:
        middle = (outline + np.roll(outline, -1, axis=0)) / 2
        along = np.roll(outline, -1, axis=0) - outline
        normal = np.stack([-along[:, 1], along[:, 0]], axis=-1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        # The middle of a long side may be where another square begins: step off along it.
        middle += 0.01 * along
        assert whole.is_dark(middle + 1e-3 * normal).all()
        assert not whole.is_dark(middle - 1e-3 * normal).any()


def test_squares_that_meet_at_a_corner_are_apart():
    whole = checkerboard("a", 6, 4, 21.0).face(margin=0.0)
    outlines = ink_outlines(whole, whole.lower, whole.upper)
    assert len(outlines) == (7 * 5 + 1) // 2
    for outline in outlines:
        assert outline.shape == (4, 2)
        np.testing.assert_allclose(np.ptp(outline, axis=0), 21.0, rtol=1e-12)


def test_outlines_have_no_points_along_their_sides():
    # A dark square is four points, though markers' modules cut its row and its column.
    whole = charuco(4, 4).face(margin=0.0)
    outlines = ink_outlines(whole, whole.lower, whole.upper)
    squares = [one for one in outlines if np.allclose(np.ptp(one, axis=0), 1.0)]
    assert len(squares) == 13
    assert all(one.shape == (4, 2) for one in squares)
