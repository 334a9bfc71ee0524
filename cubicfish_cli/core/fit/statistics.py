"""Reprojection errors in numbers. RMS is always sqrt(mean(dx² + dy²)) over corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtr

from cubicfish_cli.core.assess.fit_record import ErrorStatistics, PhotoRecord, PoseRecord
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray

_FEWEST_TO_COMPARE = 2


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


def likely_positive(
    values: FloatArray, mean: float | None = None, *, least_error: float = np.finfo(float).tiny
) -> float:
    """How likely the mean is positive of what such values (M,) are drawn from: Student's t, 0 to 1.

    With fewer than two nothing is known: 0.5.

    Args:
        values: (M,) the values.
        mean: a mean of them that is better than the plain one.
        least_error: no mean is known better than this.

    """
    if len(values) < _FEWEST_TO_COMPARE:
        return 0.5
    error = np.std(values, ddof=1) / np.sqrt(len(values))
    middle = np.mean(values) if mean is None else mean
    return float(stdtr(len(values) - 1, middle / max(error, least_error)))


def photo_records(
    names: Sequence[str],
    image: IntArray,
    residual: FloatArray,
    poses: Poses,
    tells_error: BoolArray,
) -> tuple[PhotoRecord, ...]:
    """Each photo's errors and its camera_from_world.

    Args:
        names: photos, in the order of ``poses``.
        image: (N,) photo of each residual.
        residual: (N, 2) pixels.
        poses: camera_from_world of each photo.
        tells_error: (N,) which residuals are errors; where a photo has none its errors are NaN.

    """
    vectors, shifts = poses.rotation_vector.tolist(), poses.translation.tolist()
    records = []
    for photo, name in enumerate(names):
        own = image == photo
        known, corners = residual[own & tells_error], int(own.sum())
        errors = ErrorStatistics(corners=corners)
        if len(known):
            errors = error_statistics(known, corners)
        pose = PoseRecord(rotation_vector=tuple(vectors[photo]), translation=tuple(shifts[photo]))
        records.append(PhotoRecord(image=name, **vars(errors), camera_from_world=pose))
    return tuple(records)
