"""Cameras and refined objects -> files that the command line reads too."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cubicfish_cli import __version__
from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.files import write_text
from cubicfish_cli.fitting.calibrate import Calibration
from cubicfish_cli.formats import camera_yaml
from cubicfish_cli.formats.camera_yaml import CameraFile
from cubicfish_cli.formats.target_yaml import target_text
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.target import Target
from cubicfish_cli.wording import quoted

_MAX_DEPTH = 8  # the reader takes no more than a few levels


def save_camera(
    path: str | os.PathLike[str],
    camera: Calibration | CameraFile | CubicCamera,
    *,
    made_by: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write ``camera.yaml``, which :func:`load_camera` and every command read.

    Args:
        path: the file.
        camera: a fit, whose errors in pixels and poses go into the file too, or a camera alone.
        made_by: plain data on where it comes from; the version is added.
        overwrite: whether an existing file may be replaced.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.
        CameraFileError: ``made_by`` is not plain data, or ``camera`` is no camera.

    """
    if isinstance(camera, Calibration):
        model, fit, known = camera.camera, camera.as_record(), {}
    elif isinstance(camera, CameraFile):
        model, fit, known = camera.camera, dict(camera.fit), dict(camera.made_by)
    elif isinstance(camera, CubicCamera):
        model, fit, known = camera, {}, {}
    else:
        raise CameraFileError(f"{type(camera).__name__} is no camera that can be saved")
    record = {"version": __version__, **known, **_plain(made_by or {})}
    text = camera_yaml.camera_text(model, fit=fit, made_by=record)
    write_text(Path(path), text, overwrite=overwrite)


def _plain(value: Any, depth: int = 0) -> Any:
    """Data that YAML holds without more ado.

    Raises:
        CameraFileError: they are of another kind.

    """
    if depth < _MAX_DEPTH:
        if value is None or isinstance(value, str | bool | int):
            return value
        if isinstance(value, float) and math.isfinite(value):
            return float(value)
        if isinstance(value, list | tuple):
            return [_plain(part, depth + 1) for part in value]
        if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            return {key: _plain(part, depth + 1) for key, part in value.items()}
    raise CameraFileError(
        f"made_by holds {quoted(value)}: it may hold text, finite numbers, lists and mappings"
    )


def save_target(path: str | os.PathLike[str], target: Target, *, overwrite: bool = False) -> None:
    """Write an object, such as the one that a calibration refined, as ``target.yaml``.

    Lengths are in the target's own unit.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    write_text(Path(path), target_text(target), overwrite=overwrite)
