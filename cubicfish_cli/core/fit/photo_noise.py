"""How much each photo says: photos differ in sharpness and light, and a sheet bends in some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cubicfish_cli.core.fit.robust import noise_by_photo
from cubicfish_cli.core.fit.subset import with_mean_weight_one
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray

ALIKE = 10
"""Corners of one photo share their errors: about so many of them say what one would."""
_POSE = 6
# Fewer photos do not show how much photos differ.
_FEWEST_PHOTOS = 3


def photo_weights(pairs: Observations, residual: FloatArray) -> FloatArray:
    """(M,) what a corner of each photo weighs, the mean over corners 1: one over its variance.

    Empirical Bayes: photos' log variances are drawn to their mean, by as much as the scatter that
    so few independent errors leave is larger than what photos truly differ by. Photos that
    differ by no more than this scatter weigh the same, as much as a photo that tells no error does.

    Args:
        pairs: the pairs, with the weights that they came with.
        residual: (N, 2) projection less pixel, pixels, every photo's pose fitted.

    """
    photos, own = len(pairs.images), pairs.tells_error
    of_photo = np.bincount(pairs.image, minlength=photos)
    count = np.bincount(pairs.image[own], minlength=photos)
    told = residual[own] * np.sqrt(pairs.weight[own])[:, None]
    noise, known = noise_by_photo(pairs.image[own], told, photos), count > 0
    if known.sum() < _FEWEST_PHOTOS or not noise[known].all():
        return np.ones(photos)
    count, noise = count[known], noise[known]
    free = np.maximum(2 * count - _POSE, 1)
    variance = np.log(np.square(noise) * 2 * count / free)
    scatter = 2 * ALIKE / free
    apart = max(float(np.var(variance, ddof=1) - scatter.mean()), 0.0)
    if not apart:
        return np.ones(photos)
    mean = np.average(variance, weights=1 / (apart + scatter))
    weight = np.ones(photos)
    weight[known] = np.exp((mean - variance) * apart / (apart + scatter))
    return np.asarray(weight * of_photo.sum() / (weight @ of_photo))


def weighed(pairs: Observations, residual: FloatArray) -> Observations:
    """The pairs, each photo's weights times what :func:`photo_weights` says of its residuals.

    Their mean is 1: priors and noise are measured by it, whatever weights the pairs came with.
    """
    weight = pairs.weight * photo_weights(pairs, residual)[pairs.image]
    return with_mean_weight_one(replace(pairs, weight=weight))
