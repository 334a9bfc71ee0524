"""Reprojection errors in numbers. RMS is always sqrt(mean(dx² + dy²)) over corners.

The module tells which part of an error is noise, of all corners and of each photo's, and from which
size on an error is gross. Photos differ in sharpness and light, and a sheet bends in some. The part
of corners' errors that changes from each corner to the next is their own noise.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish.judge.fit_record import ErrorStatistics, PhotoRecord, PoseRecord
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import with_mean_weight_one
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# Median of the length of a 2D normal vector of unit standard deviation per component.
_MEDIAN_OF_RAYLEIGH = 1.17741
# The same for the 95th percentile.
_MOST, _MOST_OF_RAYLEIGH = 95, 2.44775
# The Huber loss leaves errors within this many standard deviations alone: all but three in ten
# thousand normal ones.
_HUBER_SIGMAS = 4.0
# While it is not known yet whether the wrong ones are the minority: photos of another lens, a board
# that moved.
_WIDE_SIGMAS = 8.0
_SMALLEST_HUBER_PX = 0.1
# A corner is dropped when it is off by more than both of these.
GROSS_PX = 3.0
_GROSS_SIGMAS = 12.0
# A fit so much worse than the corners' noise has errors that neighbouring corners share.
_BEYOND_NOISE = 1.5
ALIKE = 10
"""Corners of one photo share their errors: about so many of them count as one."""
_POSE = 6
# Fewer photos do not show how much photos differ.
_FEWEST_PHOTOS = 3
_RING_DEG = 10.0


def error_statistics(residual: FloatArray, corners: int | None = None) -> ErrorStatistics:
    """Statistics of residuals (N, 2), N at least 1; more corners may have been used."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    return ErrorStatistics(
        rms_px=rms_px(residual),
        median_px=float(np.median(length)),
        p95_px=float(np.percentile(length, 95)),
        max_px=float(length.max()),
        corners=len(length) if corners is None else corners,
    )


def rms_px(residual: FloatArray) -> float:
    """sqrt(mean(dx² + dy²)) of residuals (N, 2)."""
    return float(np.sqrt(np.mean(np.sum(residual * residual, axis=-1))))


def rings(theta: FloatArray, miss: FloatArray) -> list[dict[str, float]]:
    """Statistics of differences (N, 2) in rings of 10°, by angles from the axis (N,) in radians."""
    ring = (np.rad2deg(theta) // _RING_DEG).astype(int)
    return [
        {
            "from_deg": number * _RING_DEG,
            "to_deg": (number + 1) * _RING_DEG,
            "rms_px": rms_px(miss[ring == number]),
            "max_px": float(np.linalg.norm(miss[ring == number], axis=1).max()),
            "pixels": int((ring == number).sum()),
        }
        for number in np.unique(ring).tolist()
    ]


def photo_records(
    pairs: Observations, residual: FloatArray, poses: Poses
) -> tuple[PhotoRecord, ...]:
    """Each photo's errors and its camera_from_world.

    Args:
        pairs: pairs of the photos; a photo's errors are NaN where none of its pairs tells its
            error.
        residual: (N, 2) projection less pixel, pixels.
        poses: camera_from_world of each photo.

    """
    vectors, shifts = poses.rotation_vector.tolist(), poses.translation.tolist()
    records = []
    for photo, name in enumerate(pairs.images):
        own = pairs.image == photo
        known, corners = residual[own & pairs.error_known], int(own.sum())
        errors = ErrorStatistics(corners=corners)
        if len(known):
            errors = error_statistics(known, corners)
        pose = PoseRecord(rotation_vector=tuple(vectors[photo]), translation=tuple(shifts[photo]))
        records.append(PhotoRecord(image=name, **vars(errors), camera_from_world=pose))
    return tuple(records)


def noise_px(residual: FloatArray) -> float:
    """Robust standard deviation per component, from the median length: (N, 2) -> pixels."""
    if not len(residual):
        return 0.0
    return float(np.median(np.hypot(residual[:, 0], residual[:, 1])) / _MEDIAN_OF_RAYLEIGH)


def noise_by_photo(image: IntArray, residual: FloatArray, photos: int) -> FloatArray:
    """(M,) :func:`noise_px` of each photo's residuals (N, 2); ``image`` (N,) is non-decreasing."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    of_photos = np.split(length, np.searchsorted(image, np.arange(1, photos)))
    noise = np.array([np.median(own) if len(own) else 0.0 for own in of_photos])
    return noise / _MEDIAN_OF_RAYLEIGH


def tail_px(residual: FloatArray) -> float:
    """Standard deviation per component from the 95th percentile of residuals (N, 2), pixels.

    Real finders' errors have longer tails than a normal distribution of the median's.
    """
    if not len(residual):
        return 0.0
    length = np.hypot(residual[:, 0], residual[:, 1])
    return float(np.percentile(length, _MOST) / _MOST_OF_RAYLEIGH)


def huber_px(residual: FloatArray) -> float:
    """The length where the Huber loss turns linear, pixels: it follows the noise of residuals."""
    return max(_SMALLEST_HUBER_PX, _HUBER_SIGMAS * noise_px(residual))


def wide_px(residual: FloatArray) -> float:
    """The length where the Huber loss turns linear at first, pixels."""
    return max(_SMALLEST_HUBER_PX, _WIDE_SIGMAS * noise_px(residual))


def gross_px(residual: FloatArray) -> float:
    """The length from which on a residual is gross, pixels."""
    return max(GROSS_PX, _GROSS_SIGMAS * noise_px(residual))


def stray_px(noise: FloatArray) -> FloatArray:
    """The length from which on a corner's difference from its neighbours is no noise, pixels."""
    return np.maximum(_SMALLEST_HUBER_PX, _GROSS_SIGMAS * noise)


def neighbours(pairs: Observations) -> tuple[IntArray, IntArray]:
    """(N,) index of the corner in the next column, and in the next row; -1 where it is not seen."""
    right, down = _find_beside(pairs, [(1, 0), (0, 1)]).T
    return right, down


def around(pairs: Observations) -> IntArray:
    """(N, 8) indices of the corners around each on its board; -1 where they are not seen."""
    return _find_beside(pairs, [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])


def _find_beside(pairs: Observations, steps: Sequence[tuple[int, int]]) -> IntArray:
    """(N, K) index of the corner so many columns and rows on, in the same photo and board."""
    # One free column and row beyond the last, so that no step ends on another row or board.
    width, height = int(pairs.column.max()) + 2, int(pairs.row.max()) + 2
    view = pairs.image * max(len(pairs.boards), 1) + pairs.board
    key = (view * height + pairs.row) * width + pairs.column
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    wanted = key[:, None] + np.array([row * width + column for column, row in steps])
    place = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
    found = (ordered[place] == wanted) & (pairs.board >= 0)[:, None]
    return np.where(found, order[place], -1)


def local_noise_px(pairs: Observations, residual: FloatArray) -> float:
    """Standard deviation per coordinate of the part of residuals (N, 2) that is not smooth, pixels.

    The effect of a wrong lens, pose or target changes little from corner to corner, noise changes
    fully: second differences along the rows keep the noise and lose the rest. 0 when unknown.
    """
    if not len(residual) or (pairs.board < 0).any():
        return 0.0
    right, _ = neighbours(pairs)
    middle = np.flatnonzero(right >= 0)
    middle = middle[(right[right[middle]] >= 0) & pairs.error_known[middle]]
    if len(middle) < 20:
        return 0.0
    last = right[right[middle]]
    bend = residual[middle] - 2 * residual[right[middle]] + residual[last]
    # The median length of a 2D normal vector, and 1 + 4 + 1 variances.
    return float(np.median(np.hypot(bend[:, 0], bend[:, 1])) / 1.17741 / np.sqrt(6))


def times_noise(pairs: Observations, residual: FloatArray) -> float | None:
    """Ratio of residuals (N, 2) to the corners' own noise; None where that is not known."""
    noise = local_noise_px(pairs, residual)
    return noise_px(residual[pairs.error_known]) / noise if noise else None


def within_noise(pairs: Observations, residual: FloatArray) -> bool:
    """Whether residuals (N, 2) are no larger than the corners' own noise explains."""
    times = times_noise(pairs, residual)
    return times is not None and times < _BEYOND_NOISE


def photo_weights(pairs: Observations, residual: FloatArray) -> FloatArray:
    """(M,) weight of a corner of each photo, the mean over corners 1: one over its variance.

    Empirical Bayes: photos' log variances are drawn to their mean, by how much larger the scatter
    of so few independent errors is than the true differences of the photos. Photos that differ by
    no more than this scatter weigh the same, as much as a photo that tells no error does.

    Args:
        pairs: the pairs, with the weights that they came with.
        residual: (N, 2) projection less pixel, pixels, every photo's pose fitted.

    """
    photos, own = len(pairs.images), pairs.error_known
    of_photo = np.bincount(pairs.image, minlength=photos)
    count = np.bincount(pairs.image[own], minlength=photos)
    weighted = residual[own] * np.sqrt(pairs.weight[own])[:, None]
    noise, known = noise_by_photo(pairs.image[own], weighted, photos), count > 0
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
    """The pairs, with each photo's weights times :func:`photo_weights` of its residuals.

    Their mean is 1: priors and noise are measured by it, whatever weights the pairs came with.
    """
    weight = pairs.weight * photo_weights(pairs, residual)[pairs.image]
    return with_mean_weight_one(replace(pairs, weight=weight))
