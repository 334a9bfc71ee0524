"""What each photo would have of its own, were every one taken through another lens.

Beside the fitted camera and its own pose, each photo is given a lens of its own as far as one
photo can have one: another scale, another centre, and a shear that grows from row to row. All of
it is linear where the fit stopped, so it costs one pass over the corners.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.linearise import huber_weight
from cubicfish_cli.core.fit.poses import Poses, cross_matrix
from cubicfish_cli.core.fit.refinement import TargetFit
from cubicfish_cli.core.fit.robust import wide_px
from cubicfish_cli.core.fit.subset import select_photos
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# What a photo may have of its own: scale, shift x, shift y; and a shift x, y that grows by rows.
TERMS = 5
LENS = slice(0, 3)
# Twice as many equations as unknowns, that are 6 of the pose and these.
_FEWEST_CORNERS = 12
_AT_A_TIME = 5000
# Two groups, or one photo, may look unlike the others by chance this often among right set-ups.
BY_CHANCE = 1e-6
# What is blamed must have been this share of the squared error, or it is not worth a word.
WORTH = 0.05
# Fewer photos do not show how much photos differ.
FEWEST_TOLD_APART = 5
# Pixels of a photo of 2000 that a person would notice.
_NOTICED_PX, _SIDE = 0.05, 2000.0
ROUGH_DECREASE = 1e-4
"""For fits that photos are only looked at beside."""


def noticed_px(pairs: Observations, of_2000: float = _NOTICED_PX) -> float:
    """Pixels that a person would notice, by those in a photo of 2000."""
    return of_2000 * max(1.0, max(pairs.image_size) / _SIDE)


def select_fit(fit: TargetFit, photos: IntArray) -> TargetFit:
    """The same fit with the poses, pairs and residuals of some photos only.

    Args:
        fit: of all photos, of any level; the target keeps the points that it has.
        photos: increasing indices of photos.

    """
    own = np.isin(fit.reference.pairs.image, photos)
    reference = replace(
        fit.reference,
        pairs=select_photos(fit.reference.pairs, photos),
        poses=fit.reference.poses[photos],
        residual=fit.reference.residual[own],
    )
    adjusted = fit.cubic.fit
    adjusted = replace(
        adjusted,
        poses=adjusted.poses[photos],
        residual=adjusted.residual[own],
        pairs=reference.pairs,
    )
    cubic = replace(fit.cubic, fit=adjusted)
    return replace(fit, reference=reference, cubic=cubic)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoLenses:
    """What each photo would have of its own, in pixels at ``reach`` from the centre.

    Attributes:
        photos: (K,) the photos with enough corners to tell.
        own: (K, 5) scale, shift x, shift y, shear x, shear y.
        information: (K, 5, 5) what it costs to be elsewhere: a squared error in pixels.
        squares: (K,) sum of squared errors of the photo with its own lens.
        numbers: (K,) how many free numbers are left in each photo.
        reach: half the shorter side, pixels.

    """

    photos: IntArray
    own: FloatArray
    information: FloatArray
    squares: FloatArray
    numbers: FloatArray
    reach: float

    def lens_information(self) -> FloatArray:
        """(K, 3, 3) information on scale and shift, the shear free: a Schur complement."""
        kept, rest = np.split(np.arange(TERMS), [LENS.stop])
        cross = self.information[:, kept[:, None], rest]
        inner = invertible(self.information[:, rest[:, None], rest])
        left = cross @ np.linalg.solve(inner, cross.transpose(0, 2, 1))
        return invertible(self.information[:, kept[:, None], kept] - left)


def mean_of(own: FloatArray, weight: FloatArray) -> FloatArray:
    """(M,) the mean of what photos (K, M) have, by what each can tell of it, (K, M, M)."""
    return np.asarray(np.linalg.solve(weight.sum(axis=0), np.einsum("kij,kj->i", weight, own)))


def invertible(information: FloatArray) -> FloatArray:
    """The same information (K, M, M), and next to none on what photos do not tell."""
    floor = 1e-9 * np.trace(information, axis1=1, axis2=2)[:, None, None]
    return np.asarray(information + floor * np.eye(information.shape[1]))


def lenses_of(fit: TargetFit) -> PhotoLenses:
    """What each photo of a fit would have of its own, the target as drawn or as fitted."""
    pairs = fit.reference.pairs
    return photo_lenses(fit.cubic.lens, fit.cubic.poses, pairs, pairs.world)


def photo_lenses(
    lens: FitLens, poses: Poses, pairs: Observations, world: FloatArray
) -> PhotoLenses:
    """What each photo would have of its own.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit.
        world: (N, 3) their world points, as fitted.

    """
    photos, triangles = _triangulate_photos(lens, poses, pairs, world)
    free = triangles[:, :-1, :-1]
    own = np.linalg.pinv(free, rcond=1e-9) @ triangles[:, :-1, -1:]
    off = triangles[:, :, -1:] - np.pad(free, ((0, 0), (0, 1), (0, 0))) @ own
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    return PhotoLenses(
        photos=photos,
        own=own[:, :, 0],
        information=free.transpose(0, 2, 1) @ free,
        squares=np.sum(off[:, :, 0] ** 2, axis=1),
        numbers=np.asarray(2.0 * counts[photos] - 6 - TERMS, float),
        reach=min(pairs.image_size) / 2,
    )


def _triangulate_photos(
    lens: FitLens, poses: Poses, pairs: Observations, world: FloatArray
) -> tuple[IntArray, FloatArray]:
    """All that there is to know of what each photo has of its own, beyond its pose.

    Returns:
        (K,) the photos with enough corners to tell, and (K, 6, 6) triangles (QR) of scale, shift
        x, shift y, shear x, shear y, and the miss: what the pose explains is taken out.

    """
    rows = []
    # In runs: the derivatives by the lens, that come with those by the point, are many.
    for start in range(0, len(pairs.image), _AT_A_TIME):
        run = slice(start, start + _AT_A_TIME)
        rows.append(_linearise(lens, poses, pairs, world, run))
    rows_of_all = np.concatenate(rows)
    # The loss of the fit: grossly wrong corners must not speak for a photo.
    miss = rows_of_all[:, :, -1]
    weight = pairs.weight * huber_weight(np.hypot(miss[:, 0], miss[:, 1]), wide_px(miss))
    rows_of_all *= np.sqrt(weight)[:, None, None]
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    stops, size = np.cumsum(counts), rows_of_all.shape[2]
    photos = np.flatnonzero(counts >= _FEWEST_CORNERS)
    triangles = np.empty((len(photos), size - 6, size - 6))
    for place, photo in enumerate(photos):
        own = rows_of_all[stops[photo] - counts[photo] : stops[photo]].reshape(-1, size)
        triangles[place] = np.asarray(np.linalg.qr(own, mode="r"))[6:, 6:]
    return photos.astype(np.intp), triangles


def _linearise(
    lens: FitLens, poses: Poses, pairs: Observations, world: FloatArray, run: slice
) -> FloatArray:
    """(n, 2, 12) derivatives by pose, scale, shift and shear, and the miss, all in pixels."""
    image = pairs.image[run]
    rotated = (poses.rotation[image] @ world[run, :, None])[:, :, 0]
    pixel, d_point, _ = lens.project_jacobian(rotated + poses.translation[image])
    middle = (np.array(pairs.image_size, float) - 1) / 2
    from_middle = (pixel - middle) / (min(pairs.image_size) / 2)
    return np.concatenate(
        [
            -d_point @ cross_matrix(rotated),
            d_point,
            from_middle[:, :, None],
            np.broadcast_to(np.eye(2), (len(pixel), 2, 2)),
            # A shift that grows from row to row.
            from_middle[:, 1, None, None] * np.eye(2),
            (pairs.pixel[run] - pixel)[:, :, None],
        ],
        axis=2,
    )
