"""Pictures of what was found: each board in its own colour, red what was left out."""

import numpy as np
import pytest

from cubicfish_cli.correspondences import Corners
from cubicfish_cli.detection.grids import FoundGrids, Grid
from cubicfish_cli.naming.decide import Verdict
from cubicfish_cli.naming.detect import PhotoReport
from cubicfish_cli.naming.draw import draw_found
from cubicfish_cli.naming.name_grids import GridReport, Place

CELLS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


def grid(left: float) -> Grid:
    return Grid(
        cells=CELLS,
        pixel=CELLS * 20.0 + [left, 60],
        parity=1,
        step=20.0,
        contrast=np.ones(4),
    )


def fate(verdict: Verdict, place: Place | None) -> GridReport:
    return GridReport(verdict=verdict, place=place, corners=4, size=(2, 2), ratio=9.0, rms_px=0.1)


@pytest.fixture
def report() -> PhotoReport:
    grids = FoundGrids(
        grids=(grid(20), grid(120), grid(220)),
        refused=np.empty((0, 2)),
        image_size=(300, 100),
    )
    return PhotoReport(
        name="a.png",
        problem=None,
        found=grids,
        grids=(
            fate(Verdict.NAMED, Place(board=0, turn=0, column=0, row=0)),
            fate(Verdict.NAMED, Place(board=1, turn=0, column=0, row=0)),
            fate(Verdict.NO_FIT, None),
        ),
    )


def corners(*images: str) -> Corners:
    return Corners(
        image_size=(300, 100),
        images=images,
        boards=("floor", "wänd"),
        image=np.zeros(8, np.intp),
        board=np.repeat([0, 1], 4),
        column=np.tile(CELLS[:, 0], 2),
        row=np.tile(CELLS[:, 1], 2),
        pixel=np.concatenate([CELLS * 20.0 + [20, 60], CELLS * 20.0 + [120, 60]]),
        weight=np.ones(8),
    )


def hue(picture: np.ndarray, left: int) -> np.ndarray:
    """The colour of the line between a grid's corners (0, 1) and (1, 1)."""
    return picture[80, left + 10].astype(int)


def test_boards_have_their_own_colours_and_what_is_left_out_is_red(report: PhotoReport) -> None:
    drawn = draw_found(np.full((100, 300), 200, np.uint8), report, corners("a.png"))
    assert drawn.shape == (100, 300, 3)
    assert drawn.dtype == np.uint8
    np.testing.assert_array_equal(drawn[5, 5], [120, 120, 120])
    one, other, red = (hue(drawn, left) for left in (20, 120, 220))
    assert np.abs(one - other).max() > 100
    assert red[2] > red[0] + 100
    assert red[2] > red[1] + 100
    assert min(one[1], 255) > 100  # neither board is red
    # Names stand above the first corners of named boards only.
    above = np.ptp(drawn[40:56].astype(int), axis=2)
    assert (above[:, 20:80] > 40).any()
    assert not (above[:, 220:280] > 40).any()


def test_a_photo_without_named_corners_is_drawn_too(report: PhotoReport) -> None:
    drawn = draw_found(np.full((100, 300), 40_000, np.uint16), report, corners("b.png"))
    np.testing.assert_allclose(drawn[5, 5], 0.6 * 40_000 / 257, atol=1)
    assert np.ptp(hue(drawn, 20)) == 0
    assert np.ptp(hue(drawn, 220)) > 100
