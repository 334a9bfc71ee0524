"""Choosing some of the pairs, and scaling the world so that lengths are of order 1."""

from dataclasses import replace

import numpy as np

from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray


def select(pairs: Observations, keep: BoolArray) -> tuple[Observations, IntArray]:
    """Select the pairs where ``keep`` (N,) is true; photos without any are left out.

    Returns:
        The pairs, and for each of their photos its index in ``pairs.images``.

    """
    return pairs.select(keep).only_seen()


def select_photos(pairs: Observations, photos: IntArray) -> Observations:
    """The pairs of the photos with these indices."""
    return pairs.of_photos(photos)


def world_scale(pairs: Observations) -> float:
    """Typical distance of the world points from their middle, in the target's units."""
    return float(np.sqrt(np.mean(np.var(pairs.world, axis=0).sum()))) or 1.0


def middle(pairs: Observations) -> FloatArray:
    """Middle of the world points (3,): where a fit has its origin, wherever the user's is.

    Surveyors count from an origin that may be a million times farther away than the target is
    wide. Rounding takes as many digits from a fit as its points are times their extent from the
    origin, and turns about one that is far away are nearly shifts.
    """
    return np.asarray(pairs.world.mean(axis=0))


def with_mean_weight_one(pairs: Observations) -> Observations:
    """The same pairs with weights whose mean is 1: weights are relative, and have no unit.

    It is called before the fit, once for all photos: a factor on all weights would look like less
    noise.
    """
    return replace(pairs, weight=pairs.weight / pairs.weight.mean())


def flatness(world: FloatArray) -> float:
    """Ratio of the third to the first extent of points (N, 3): 0 on a plane."""
    if len(world) < 3:
        return 0.0
    extent = np.linalg.svd(world - world.mean(axis=0), compute_uv=False)
    return float(extent[2] / extent[0]) if extent[0] > 0 else 0.0
