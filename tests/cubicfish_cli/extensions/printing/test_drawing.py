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


@pytest.mark.parametrize("kind", ["corner", "board"])
def test_rulers_run_along_x_and_y_and_what_to_join_stays_on_the_sheet(kind):
    from cubicfish_cli.extensions.printing import drawing
    from cubicfish_cli.extensions.printing.command import PrintOptions
    from cubicfish_cli.extensions.printing.objects import design
    from cubicfish_cli.extensions.printing.paper import paper

    _, pages = design(PrintOptions(kind=kind), paper("A4"), margin=5.0)
    for page in pages:
        axes = drawing._draw(page, "").axes[0]
        face = board_face(page.board, margin=0.0)
        lower, upper = np.array(face.lower) + page.shift, np.array(face.upper) + page.shift
        ways = []
        for ticks in axes.collections:
            turned = ticks.get_transform() - axes.transData
            ends = turned.transform(np.concatenate(ticks.get_segments())).reshape(-1, 2, 2)
            outside = (ends < lower).any(axis=(1, 2)) | (ends > upper).any(axis=(1, 2))
            assert outside.all()  # beside the print
            ways.append(int(np.ptp(ends[:, 0], axis=0).argmax()))
            gaps = np.abs(np.diff(ends[:, 0, ways[-1]]))
            np.testing.assert_allclose(gaps, 1.0, atol=1e-9)
            places = [cut.place for side, cut in page.cuts.items() if side in ("left", "right")]
            assert not any(np.abs(ends[..., 0] - place).min() < 5 for place in places)
        assert sorted(ways) == [0, 1]
        for text in axes.texts:
            for side, cut in page.cuts.items():
                if f"the {cut.side} edge of {cut.board}" in text.get_text():
                    place = text.get_position()[side in ("top", "bottom")]
                    within = place > cut.place if side in ("left", "top") else place < cut.place
                    assert within
