"""Some of many photos, that show as well as all of them whether a cause is worth a closer look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cubicfish_cli.fitting.refinement import ObjectFit
from cubicfish_cli.fitting.subset import select_photos
from cubicfish_cli.types import IntArray

_FEWEST = 30
_SHARE = 0.05


def enough_photos(count: int) -> int:
    """So many of ``count`` photos are looked at first: all of few, a small share of many."""
    return min(count, max(_FEWEST, round(_SHARE * count)))


def spread_out(photos: IntArray, most: int) -> IntArray:
    """At most so many of some photos, from all parts of their order."""
    if len(photos) <= most:
        return photos
    return photos[np.linspace(0, len(photos) - 1, most).round().astype(np.intp)]


def fit_of_few(fit: ObjectFit, photos: IntArray) -> ObjectFit:
    """The same fit with the poses, pairs and residuals of some photos only.

    Args:
        fit: of all photos, of any level; the object keeps the points that it has.
        photos: increasing indices of photos.

    """
    own = np.isin(fit.reference.pairs.image, photos)
    reference = replace(
        fit.reference,
        pairs=select_photos(fit.reference.pairs, photos),
        poses=fit.reference.poses[photos],
        residual=fit.reference.residual[own],
    )
    cubic = replace(fit.cubic, poses=fit.cubic.poses[photos], residual=fit.cubic.residual[own])
    return replace(fit, reference=reference, cubic=cubic)
