"""Growth: predict the neighbours of a grid's corners and look for them in the photo."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cubicfish_cli.detection.lattice import Lattice, LocalFit
from cubicfish_cli.detection.nearby import nearest
from cubicfish_cli.detection.pyramid import Pyramid
from cubicfish_cli.detection.saddle import fit_saddles
from cubicfish_cli.detection.squares import (
    LEAST_CONTRAST,
    NEIGHBOUR_STEPS,
    SEPARATION,
    edges_seen,
    measure_half_gap,
    quadrants,
)
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

_MOST_ROUNDS = 60
# A prediction extrapolates by one cell. From two rows it is linear, and near a board held close
# to the lens one square can be 1.6 times as long as the last; the next corner is a cell away.
_SEARCH = 0.5
# Leave-one-out: a corner that many cells from what its neighbours say is not a corner; more where
# the neighbours lie on one side only.
_OUTLIER = 0.15


def grow(pyramid: Pyramid, lattice: Lattice, free: cKDTree, most: int) -> bool:
    """Add corners to the lattice until nothing changes, or it has more than ``most`` corners.

    Args:
        pyramid: the photo.
        lattice: what grows.
        free: candidates to snap to.
        most: corners.

    Returns:
        Whether it may grow on.

    """
    for _ in range(_MOST_ROUNDS):
        if lattice.known.sum() > most:
            return True
        lattice.make_room()
        cells = lattice.frontier()
        if not len(cells) or not _grow_once(pyramid, lattice, free, cells):
            return False
    return False


def _grow_once(pyramid: Pyramid, lattice: Lattice, free: cKDTree, cells: IntArray) -> bool:
    fit = lattice.fit(cells)
    usable = fit.sound & pyramid.inside(fit.pixel, 2.0)
    cells, fit = cells[usable], fit.select(usable)
    if not len(cells):
        return False
    pixel, found = _look(pyramid, fit, free)
    found &= pyramid.inside(pixel, 2.0)
    found &= ~_crowded(lattice, pixel, fit)
    cells, pixel, fit = cells[found], pixel[found], fit.select(found)
    if not len(cells):
        return False
    good, contrast = looks_like_corner(pyramid, lattice, cells, pixel, fit)
    lattice.put(cells[good], pixel[good], contrast[good])
    return bool(good.any())


def _look(pyramid: Pyramid, fit: LocalFit, free: cKDTree) -> tuple[FloatArray, BoolArray]:
    """Nearest free candidate, else a saddle at the prediction."""
    pixel = fit.pixel.copy()
    found = np.zeros(len(pixel), bool)
    if free.n:
        _, index = nearest(pixel, free, 4)
        place = np.asarray(free.data)[index]
        away = fit.cells_away(place)
        best = away.argmin(1)
        rows = np.arange(len(pixel))
        found = away[rows, best] < _SEARCH
        pixel[found] = place[rows, best][found]
    rest = ~found
    if rest.any():
        half = np.clip(0.2 * fit.side[rest], 2.0, 6.0)
        saddle = fit_saddles(
            pyramid.levels[0], pixel[rest], half, np.maximum(0.3 * fit.side[rest], 1.0)
        )
        pixel[rest], found[rest] = saddle.pixel, saddle.ok
    return pixel, found


def _crowded(lattice: Lattice, pixel: FloatArray, fit: LocalFit) -> BoolArray:
    """Tell which positions lie on top of a corner that is there already, or of each other."""
    known = lattice.pixel[lattice.known]
    limit = 0.4 * fit.side
    crowded = nearest(pixel, known, 1)[0][:, 0] < limit
    if len(pixel) > 1:
        distance, index = nearest(pixel, pixel, 2)
        crowded |= (distance[:, 1] < limit) & (np.arange(len(pixel)) > index[:, 1])
        crowded |= (distance[:, 1] < limit) & (index[:, 0] != np.arange(len(pixel)))
    return crowded


def looks_like_corner(
    pyramid: Pyramid, lattice: Lattice, cells: IntArray, pixel: FloatArray, fit: LocalFit
) -> tuple[BoolArray, FloatArray]:
    """Test brightness of the four squares and of the edges to known neighbours."""
    sign = lattice.sign(cells)
    square = quadrants(pyramid, pixel, fit, sign, lattice.half_gap)
    around = cells[:, None] + NEIGHBOUR_STEPS
    neighbour = lattice.pixel[around[..., 0], around[..., 1]]
    expected = np.maximum(lattice.contrast_around(cells), 1e-6)
    # Light falls off steeply towards the rim, and shadows take part of it: only a corner's own
    # contrast says what its edges must show.
    own = np.maximum(square.contrast, 1e-6)
    good = square.separation > SEPARATION * own
    good &= own > np.maximum(LEAST_CONTRAST * expected, 3.0 * pyramid.noise)
    seen = edges_seen(
        pyramid, pixel, fit, sign, np.minimum(own, expected), neighbour, lattice.half_gap
    )
    good &= 2 * seen.sum(1) >= (~np.isnan(neighbour[..., 0])).sum(1)
    good &= seen.any(1)
    return good, square.contrast


def measure_contrast(pyramid: Pyramid, lattice: Lattice) -> None:
    """Set the gap of the lattice, and the contrast of all corners from the squares around them."""
    cells = lattice.cells()
    fit = lattice.fit(cells)
    pixel = lattice.at(cells)
    sign = lattice.sign(cells)
    lattice.half_gap = measure_half_gap(pyramid, pixel, fit, sign)
    contrast = quadrants(pyramid, pixel, fit, sign, lattice.half_gap).contrast
    lattice.put(cells, pixel, np.maximum(contrast, 0))


def clean(lattice: Lattice) -> None:
    """Drop corners that contradict their neighbours or have none."""
    lattice.make_room()
    lattice.clean(_OUTLIER)
