"""Reprojection errors in numbers. RMS is always sqrt(mean(dx² + dy²)) over corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.fitting.poses import Poses

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


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


def error_statistics(residual: FloatArray) -> ErrorStatistics:
    """Statistics of residuals (N, 2), N at least 1."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    return ErrorStatistics(
        rms_px=rms_px(residual),
        median_px=float(np.median(length)),
        p95_px=float(np.percentile(length, 95)),
        max_px=float(length.max()),
        corners=len(length),
    )


def rms_px(residual: FloatArray) -> float:
    """sqrt(mean(dx² + dy²)) of residuals (N, 2)."""
    return float(np.sqrt(np.mean(np.sum(residual * residual, axis=-1))))


def photo_records(
    names: Sequence[str], image: IntArray, residual: FloatArray, poses: Poses
) -> list[dict[str, Any]]:
    """One plain record a photo: its errors and its camera_from_world.

    Args:
        names: photos, in the order of ``poses``.
        image: (N,) photo of each residual.
        residual: (N, 2) pixels.
        poses: camera_from_world of each photo.

    """
    records = []
    vectors = poses.rotation_vector
    for photo, name in enumerate(names):
        own = residual[image == photo]
        errors = error_statistics(own).as_record() if len(own) else {"corners": 0}
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
