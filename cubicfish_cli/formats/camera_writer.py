"""A camera -> its camera.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.files import write_text
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.point_cubic import PointCamera
from cubicfish_cli.plain_yaml import plain_yaml_text
from cubicfish_cli.types import FloatArray

FORMAT_VERSION = 1
RADIAL_KEYS = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")


def save_camera(
    path: Path,
    camera: CubicCamera | PointCamera,
    *,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    overwrite: bool,
) -> None:
    """Write camera.yaml, numbers at full precision.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    write_text(path, camera_text(camera, fit=fit, made_by=made_by), overwrite=overwrite)


def camera_text(
    camera: CubicCamera | PointCamera,
    *,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    comment: str = "",
) -> str:
    """The text of a camera.yaml; ``comment`` is a line for people at its top."""
    is_point = isinstance(camera, PointCamera)
    record = {
        "cubicfish": FORMAT_VERSION,
        "image_size": [int(side) for side in camera.image_size],
        "lift": "point" if is_point else "ray",
        **(_point_record(camera) if isinstance(camera, PointCamera) else _ray_record(camera)),
        "fit": dict(fit),
        "made_by": dict(made_by),
    }
    return (f"# {comment}\n" if comment else "") + plain_yaml_text(record)


def _ray_record(camera: CubicCamera) -> dict[str, Any]:
    return {
        "frame": "camera",
        "P": unit_norm(camera.P).tolist(),
        "max_angle_deg": float(camera.max_angle_deg),
        "valid": np.round(camera.outline(), 3).tolist(),
        "radial": dict(zip(RADIAL_KEYS, camera.radial.parameters.tolist(), strict=True)),
    }


def _point_record(camera: PointCamera) -> dict[str, Any]:
    return {
        "frame": camera.frame,
        "P": unit_norm(camera.P).tolist(),
        "point_offset": camera.offset.tolist(),
        "point_scale": float(camera.scale),
        "point_reach": float(camera.reach),
        "point_null": camera.null.tolist(),
        "valid": np.round(camera.valid, 3).tolist(),
    }


def unit_norm(P: FloatArray) -> FloatArray:
    """P with Frobenius norm 1; left to the last bit when it has that already."""
    norm = np.linalg.norm(P)
    if abs(norm - 1) < 1e-12:
        return P
    P = P / np.abs(P).max()  # squares of tiny numbers vanish
    return np.asarray(P / np.linalg.norm(P))
