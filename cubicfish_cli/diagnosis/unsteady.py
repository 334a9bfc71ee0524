"""Photos that differ from each other without falling into groups: what changed between all of them.

A loose sheet bends anew in every photo, autofocus moves the lens along its axis and optical
stabilisation across it. Each is fitted to every photo beside the camera, to first order, and the
one that explains most is named. None makes a camera wrong: it is a mean of all photos.
"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.diagnosis.photo_lenses import own_triangles
from cubicfish_cli.fitting.refinement import ObjectFit
from cubicfish_cli.fitting.subset import flatness
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

_FEWEST_PHOTOS = 5
# What changes takes this share of the mean squared error away, free numbers counted.
_CLEAR_MARGIN = 0.4
# In so many photos it must do so in each; in some, what changes is as in the mean by chance.
_MANY = 0.4
# Pixels of a photo of 2000 from which on it is worth a word.
_NOTICED_PX, _SIDE = 0.1, 2000.0
_FLAT = 1e-3  # a refined sheet is bent a little


def unsteady(fit: ObjectFit) -> list[Finding]:
    """What seems to change from photo to photo, as a note; empty where nothing clearly does."""
    pairs, poses = fit.reference.pairs, fit.cubic.poses
    world = fit.cubic.fit.world.points
    flat = flatness(world) < _FLAT
    bend = _bends(world) if flat else np.zeros((len(world), 3, 0))

    def bent(run: slice, d_point: FloatArray, _: FloatArray) -> FloatArray:
        return np.asarray(d_point @ poses.rotation[pairs.image[run]] @ bend[run])

    photos, triangles = own_triangles(fit.cubic.lens, poses, pairs, world, bent)
    if len(photos) < _FEWEST_PHOTOS:
        return []
    terms = {Code.AUTOFOCUS: slice(0, 1), Code.STABILISATION: slice(1, 3)}
    if flat:
        terms[Code.SHEET_BENDS] = slice(3, 6)
    equations = 2 * np.bincount(pairs.image, minlength=len(pairs.images))[photos] - 6
    before = np.sum(triangles[:, :, -1] ** 2, axis=1)
    squares = {cause: np.zeros(len(photos)) for cause in terms}
    for place, left in enumerate(triangles):
        for cause, columns in terms.items():
            step = np.linalg.lstsq(left[:, columns], left[:, -1], rcond=1e-9)[0]
            squares[cause][place] = np.sum((left[:, -1] - left[:, columns] @ step) ** 2)
    variance = float(before.sum() / equations.sum())
    left_free = {cause: equations - (one.stop - one.start) for cause, one in terms.items()}
    each = {cause: float(squares[cause].sum() / left_free[cause].sum()) for cause in terms}
    cause = min(each, key=lambda one: each[one])
    change_px = float(np.sqrt(2 * max(variance - each[cause], 0.0)))
    # In many photos, not in a few that are odd.
    own_share = squares[cause] / left_free[cause] * equations / np.maximum(before, 1e-300)
    if max(each[cause] / variance, float(np.quantile(own_share, _MANY))) > 1 - _CLEAR_MARGIN:
        return []
    if change_px < _NOTICED_PX * max(1.0, max(pairs.image_size) / _SIDE):
        return []
    told = Finding(
        code=cause,
        figures={
            "size_px": change_px,
            "before_px": float(np.sqrt(2 * variance)),
            "after_px": float(np.sqrt(2 * each[cause])),
        },
    )
    return [told]


def _bends(world: FloatArray) -> FloatArray:
    """(N, 3, 3) how the points of a flat board move when it bends in three ways: x², xy and y²."""
    off = world - world.mean(axis=0)
    axes = np.linalg.svd(off, full_matrices=False)[2]
    plane = off @ axes[:2].T
    x, y = (plane / np.abs(plane).max(axis=0)).T
    return np.asarray(axes[2][None, :, None] * np.stack([x * x, x * y, y * y], axis=-1)[:, None])
