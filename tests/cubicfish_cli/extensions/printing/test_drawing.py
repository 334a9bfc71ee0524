"""The ink on paper: dark exactly where the renderer says so, each place once."""

import numpy as np
import pytest
from synthetic import checkerboard

from cubicfish.scene.faces import board_face
from tests.cubicfish.scene.test_faces import aprilgrid, charuco


def ink_rectangles(board):
    # Loaded with what writes PDF where it is used, not by every process that collects tests.
    from cubicfish_cli.extensions.printing import drawing

    return drawing.ink_rectangles(board)


BOARDS = {
    "checkerboard": checkerboard("a", 4, 3, 1.0),
    "charuco": charuco(),
    "charuco, light first": charuco(4, 3, first="light", dictionary="DICT_4X4_50", marker=0.7),
    "aprilgrid": aprilgrid(spacing=0.3),
    "aprilgrid of 16h5": aprilgrid(family="DICT_APRILTAG_16h5", start=2),
}


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_ink_is_where_the_renderer_has_it(board):
    wider = board_face(board, margin=0.5)
    points = np.random.default_rng(1).uniform(wider.lower, wider.upper, (2_000, 1, 2))
    ink = ink_rectangles(board)
    inside = ((points > ink[:, 0]) & (points < ink[:, 2])).all(axis=-1).sum(axis=1)
    assert set(inside.tolist()) == {0, 1}
    np.testing.assert_array_equal(inside == 1, wider.is_dark(points[:, 0]))


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_ink_that_touches_shares_its_edge_to_the_last_bit(board):
    # One path whose parts share edges is filled without a hair between them.
    ink = ink_rectangles(board)
    for axis in (0, 1):
        places = np.unique(ink[..., axis])
        assert np.diff(places).min() > 1e-3


def test_a_dark_square_is_one_rectangle():
    ink = ink_rectangles(checkerboard("a", 6, 4, 21.0))
    assert len(ink) == (7 * 5 + 1) // 2
    np.testing.assert_allclose(ink[:, 2] - ink[:, 0], 21.0, rtol=1e-12)
