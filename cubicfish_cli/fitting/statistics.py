"""Reprojection errors in numbers. RMS is always sqrt(mean(dx² + dy²)) over corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import stdtr

from cubicfish_cli.assess.records import recorded_mappings
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.observations import MAX_COORDINATE
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

_FEWEST_TO_COMPARE = 2
_LENGTHS = ("rms_px", "median_px", "p95_px", "max_px")


@dataclass(frozen=True, kw_only=True)
class ErrorStatistics:
    """Lengths of reprojection errors, pixels.

    Attributes:
        rms_px: sqrt(mean(dx² + dy²)).
        median_px, p95_px, max_px: median, 95th percentile and largest length.
        corners: how many corners were counted.

    """

    rms_px: float
    median_px: float
    p95_px: float
    max_px: float
    corners: int

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return asdict(self)


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
) -> list[dict[str, Any]]:
    """One plain record per photo: its errors and its camera_from_world.

    Args:
        names: photos, in the order of ``poses``.
        image: (N,) photo of each residual.
        residual: (N, 2) pixels.
        poses: camera_from_world of each photo.
        tells_error: (N,) which residuals are errors; where a photo has none its errors are None.

    """
    records = []
    vectors = poses.rotation_vector
    for photo, name in enumerate(names):
        own = image == photo
        known, corners = residual[own & tells_error], int(own.sum())
        errors: dict[str, Any] = {"corners": 0}
        if len(known):
            errors = error_statistics(known, corners).as_record()
        elif corners:
            errors = {**dict.fromkeys(_LENGTHS), "corners": corners}
        records.append(
            {
                "image": name,
                **errors,
                "camera_from_world": {
                    "rotation_vector": vectors[photo].tolist(),
                    "translation": poses.translation[photo].tolist(),
                },
            }
        )
    return records


def photos_on_record(fit: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What a camera file says of each photo: :func:`photo_records`, or whatever stands there."""
    return recorded_mappings(fit.get("per_image"))


def poses_on_record(fit: Mapping[str, Any]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """camera_from_world by photo, of those whose :func:`photo_records` have one.

    Args:
        fit: what a camera file says of its fit; what is no pose is passed over.

    Returns:
        Rotation vectors (3,) in radians and translations (3,).

    """
    poses = {}
    for record in photos_on_record(fit):
        pose = record.get("camera_from_world")
        if isinstance(pose, Mapping):
            turn, shift = _three(pose.get("rotation_vector")), _three(pose.get("translation"))
            if turn is not None and shift is not None:
                poses[str(record.get("image"))] = turn, shift
    return poses


def _three(value: object) -> FloatArray | None:
    numbers = value if isinstance(value, list) else []
    good = [
        float(x)
        for x in numbers
        if isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= MAX_COORDINATE
    ]
    return np.array(good) if len(good) == len(numbers) == 3 else None
