"""Cameras as USD: a stage, and for each camera two tables that hold any lens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

import numpy as np

from cubicfish_cli import __version__
from cubicfish_cli.errors import FitError
from cubicfish_cli.files import Content
from cubicfish_cli.formats.camera_format import METRES, Pose
from cubicfish_cli.formats.usd_text import TableCamera, prim_name, usd_text
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.undistortion.lens_tables import LensTables, lens_tables
from cubicfish_cli.undistortion.map_formats import write_float_exr


def usd_paths(folder: Path, names: Iterable[str]) -> list[Path]:
    """The stage, and the two tables of each camera by its name."""
    return [folder / "rig.usda", *(folder / file for name in names for file in _tables(name))]


def _tables(name: str) -> tuple[str, str]:
    return f"{prim_name(name)}_enter.exr", f"{prim_name(name)}_leave.exr"


def usd_files(
    folder: Path,
    cameras: Sequence[tuple[str, CubicCamera, Pose | None]],
    units: str | None,
    *,
    max_error: float,
    working: Callable[[str], AbstractContextManager[None]],
) -> tuple[dict[Path, Content], dict[str, tuple[LensTables, str]]]:
    """The stage and the tables.

    Args:
        folder: where.
        cameras: name, camera and camera_from_rig of each; None where there is no rig.
        units: of lengths.
        max_error: of what is lost between the tables' entries, pixels.
        working: shows what is done, in words.

    Returns:
        What :func:`write_files` writes, and of each camera its tables and how near they come.

    Raises:
        FitError: more is lost; the text names the camera.

    """
    placed, made = [], {}
    files: dict[Path, Content] = {}
    stage = usd_paths(folder, ())[0]
    for name, camera, place in cameras:
        with working(f"Making the tables of {name}"):
            tables = lens_tables(camera)
        if not tables.max_px <= max_error:
            raise FitError(
                f"camera {name}: the tables miss it by up to {tables.max_px:.2f} px between their "
                f"entries, more than the {max_error:g} px of --max-error: raise it"
            )
        error = (
            f"conversion error: RMS {tables.rms_px:.4f} px, largest {tables.max_px:.4f} px between "
            f"pixels, up to {camera.max_angle_deg:.1f} degrees from the axis"
        )
        made[name] = tables, error
        rotation, translation = (np.eye(3), np.zeros(3)) if place is None else place
        enter, leave = _tables(name)
        placed.append(
            TableCamera(
                name=name,
                image_size=camera.image_size,
                rotation=rotation.T,
                translation=-rotation.T @ translation,
                enter=enter,
                leave=leave,
                note=[f"cubicfish {__version__}: the camera at every pixel", error],
            )
        )
        flat = np.zeros(tables.leave.shape[:2], np.float32)
        leaving = (*np.moveaxis(tables.leave, -1, 0), flat)
        for file, channels in ((enter, np.moveaxis(tables.enter, -1, 0)), (leave, leaving)):
            planes = {
                key: np.ascontiguousarray(one) for key, one in zip("RGB", channels, strict=True)
            }
            files[folder / file] = partial(write_float_exr, channels=planes)
    return {stage: usd_text(placed, METRES.get(units or "")), **files}, made
