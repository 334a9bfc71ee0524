"""A grid as a whole: a board, or an accident of texture."""

import cv2
import numpy as np
import pytest

from cubicfish.find.detection.accept import (
    hang_together,
    is_beyond_chance,
    is_board,
    is_large_enough,
)
from cubicfish.find.detection.crossing import Crossings
from cubicfish.find.detection.lattice import Lattice
from cubicfish.find.detection.pyramid import enlarged, reduced


def judged(
    *,
    jitter=0.0,
    blur=1.0,
    contrast_change=0.0,
    shape=(4, 4),
    side=20.0,
    turn=0.0,
    gap=0.0,
    gap_by_colour=0.0,
    gap_scatter=0.0,
    shade=lambda cells: 1.0,
):
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones(shape, bool))
    pixel = 50 + side * cells + side * rng.normal(0, 1, cells.shape) * jitter
    count = len(cells)
    contrast = 100 * np.exp(contrast_change * rng.normal(0, 1, count)) * shade(cells)
    lattice = Lattice.from_cells(cells, pixel, contrast, 1)
    found = Crossings(
        pixel=pixel,
        ok=np.ones(count, bool),
        level=np.zeros((count, 4)),
        blur=np.full((count, 2), blur),
        turn=np.full(count, turn),
        gap=gap + gap_by_colour * (-1) ** cells.sum(1) + gap_scatter * rng.normal(0, 1, count),
        misfit=np.zeros(count),
        spread=np.zeros(count),
    )
    return is_board(lattice, lattice.cells(), found)


def test_a_regular_sharp_grid_is_a_board():
    assert judged()
    assert judged(jitter=0.01, blur=0.8, contrast_change=0.05, side=7.0)


FLAWS = [
    {"jitter": 0.12},
    {"blur": 3.5},
    {"contrast_change": 0.6},
    {"turn": 0.2},
    {"gap_scatter": 5.0},
    {"gap": -7.0},
]


def test_a_few_strands_across_a_wide_extent_are_no_board():
    cells = np.array([(k, k + j) for k in range(0, 60, 2) for j in (0, 1)])
    lattice = Lattice.from_cells(cells, 20.0 * cells, np.ones(len(cells)), 1)
    measures = {name: np.zeros(60) for name in ("turn", "gap", "misfit", "spread")}
    found = Crossings(
        pixel=20.0 * cells,
        ok=np.ones(60, bool),
        level=np.zeros((60, 4)),
        blur=np.ones((60, 2)),
        **measures,
    )
    assert not is_board(lattice, lattice.cells(), found)
    # The same corners, side by side.
    cells = np.argwhere(np.ones((6, 10)))
    beside = Lattice.from_cells(cells, 20.0 * cells, np.ones(len(cells)), 1)
    assert is_board(beside, beside.cells(), found)


def test_a_board_that_shadows_fall_across_is_one():
    """Two rows in the light, two in the dark: most corners are unlike the median around them."""
    flaws = {"jitter": 0.01, "blur": 1.5, "contrast_change": 0.03, "shape": (6, 4)}
    assert judged(shade=lambda cells: np.where(cells[:, 0] % 4 < 2, 1.0, 0.3), **flaws)


def test_gaps_that_are_alike_or_alike_by_colour_are_a_board_s():
    assert judged(gap=4.0)
    assert judged(gap_by_colour=4.0)


@pytest.mark.parametrize("flaw", FLAWS)
def test_each_flaw_alone_speaks_against_it(flaw):
    assert not judged(**flaw)


def test_a_large_grid_may_be_blurred_more_but_not_like_a_sine():
    assert not judged(blur=3.5)
    assert judged(blur=3.5, shape=(8, 8))
    assert not judged(blur=4.2, shape=(8, 8))


@pytest.mark.parametrize(("shape", "enough"), [((3, 3), True), ((2, 4), False), ((2, 5), True)])
def test_eight_corners_and_four_squares_are_the_least(shape, enough):
    cells = np.argwhere(np.ones(shape, bool))
    lattice = Lattice.from_cells(cells, 20.0 * cells, np.full(len(cells), 9.0), 1)
    assert is_large_enough(lattice) == enough


def test_a_reduced_photo_s_pixels_lead_back_to_the_photo_s():
    image = np.zeros((41, 50), np.float32)
    image[20:24, 32:36] = 1  # its middle is (33.5, 21.5)
    small = reduced(image, 4)
    y, x = np.nonzero(small)
    assert small.shape == (10, 12)
    assert np.allclose(enlarged(np.stack([x, y], -1).astype(float), 4), [[33.5, 21.5]])


@pytest.mark.slow
def test_what_random_cells_make_now_and_then_is_not_beyond_chance():
    cells = np.random.default_rng(3).random((2000, 2000)) < 0.5
    diagonal = (cells[1:, 1:] == cells[:-1, :-1]) & (cells[1:, :-1] == cells[:-1, 1:])
    crossing = diagonal & (cells[1:, 1:] != cells[1:, :-1])
    held = hang_together(crossing).astype(np.uint8)
    pieces = cv2.connectedComponentsWithStats(held, connectivity=4)[2][1:, cv2.CC_STAT_AREA]
    sizes = np.unique(pieces).tolist()
    assert np.sort(pieces)[-5:].min() >= 11
    assert not any(is_beyond_chance(size, int(crossing.sum())) for size in sizes)
    assert is_beyond_chance(30, int(crossing.sum()))


@pytest.mark.parametrize(("crossings", "enough"), [(0, 8), (8, 10), (50, 13), (8000, 20)])
def test_the_more_crossings_the_more_corners_are_needed(crossings, enough):
    assert is_beyond_chance(enough, crossings)
    assert not is_beyond_chance(enough - 2, crossings) or not crossings


def test_chains_between_two_parts_are_held_and_loose_ends_are_not():
    known = np.zeros((9, 12), bool)
    known[0:3, 0:3] = known[0:3, 8:11] = True
    known[1, 3:8] = True  # the chain
    parts = known.copy()
    known[5:7, 1] = known[3:5, 1] = True  # a loose end of four corners
    known[8, 11] = True  # alone
    assert np.array_equal(hang_together(known), parts)
