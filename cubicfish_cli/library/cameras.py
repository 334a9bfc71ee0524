"""Cameras and refined objects -> files that the command line reads too."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.files import write_text
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.formats.camera_yaml import CameraFile
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.target import Target, target_text


def save_camera(
    path: str | os.PathLike[str],
    camera: Calibrated | CubicCamera,
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
    if isinstance(camera, CubicCamera):
        camera = CameraFile(camera=camera, fit={}, made_by={})
    if not isinstance(camera, Calibrated):
        raise CameraFileError(f"{type(camera).__name__} is no camera that can be saved")
    camera.save(path, made_by=made_by, overwrite=overwrite)


def save_target(path: str | os.PathLike[str], target: Target, *, overwrite: bool = False) -> None:
    """Write an object, such as the one that a calibration refined, as ``target.yaml``.

    Lengths are in the target's own unit.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    write_text(Path(path), target_text(target), overwrite=overwrite)
