"""A camera as two tables: the pixel of each direction, the direction of each pixel; also as USD.

As NVIDIA's RTX cameras take them, with x to the right, y up and the view along -z. Directions are
laid out on a square by an octahedron, what lies straight ahead in the middle. What the camera does
not see looks straight back in the first table, and is off the picture in the second.

USD cameras whose lenses are tables, as text (.usda): NVIDIA's OmniLensDistortionLutAPI.

USD's cameras have x to the right, y up and look along -z; so has the rig's frame here, which is the
first camera's. Matrices stand to the right of rows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.angles import unit_rays
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.types import FloatArray

Floats = npt.NDArray[np.float32]

_BACK = np.array([0.0, 0.0, 1.0])
_OFF = -1.0
_LEAST_SIDE = 1024
_ROWS_PER_BLOCK = 64
_CHECKS = 20_000
_FLIP = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class LensTables:
    """A camera as tables.

    Attributes:
        enter: (H, W, 3) unit directions of the photo's pixels.
        leave: (N, N, 2) shares of the picture's width and height of directions.
        rms_px, max_px: what is lost between entries, by the worse of the two tables, wherever all
            entries about a place are seen.

    """

    enter: Floats
    leave: Floats
    rms_px: float
    max_px: float


def lens_tables(camera: CubicCamera) -> LensTables:
    """The tables of a camera, with about as many entries as its photos have pixels."""
    width, height = camera.image_size
    side = max(_LEAST_SIDE, width, height)
    enter = np.empty((height, width, 3), np.float32)
    for top in range(0, height, _ROWS_PER_BLOCK):
        rows = np.arange(top, min(height, top + _ROWS_PER_BLOCK))
        pixel = np.stack(np.meshgrid(np.arange(width), rows), axis=-1).astype(float)
        rays = camera.unproject(pixel) * _FLIP
        enter[rows] = np.where(np.isfinite(rays), rays, _BACK)
    leave = np.empty((side, side, 2), np.float32)
    for top in range(0, side, _ROWS_PER_BLOCK):
        rows = np.arange(top, min(side, top + _ROWS_PER_BLOCK))
        place = np.stack(np.meshgrid(np.arange(side), rows), axis=-1)
        shares = _shares(camera, octahedral_rays((2 * place + 1) / side - 1) * _FLIP)
        leave[rows] = np.where(np.isfinite(shares), shares, _OFF)
    misses = [_enter_miss(camera, enter), _leave_miss(camera, leave)]
    return LensTables(
        enter=enter,
        leave=leave,
        rms_px=max(float(np.sqrt(np.mean(miss**2))) for miss in misses),
        max_px=max(float(miss.max()) for miss in misses),
    )


def octahedral_rays(place: FloatArray) -> FloatArray:
    """Places on the square from -1 to 1 (..., 2) -> unit directions (..., 3), -z in the middle."""
    x, y = np.moveaxis(np.asarray(place, float), -1, 0)
    z = 1 - np.abs(x) - np.abs(y)
    behind = z < 0
    folded_x = (1 - np.abs(y)) * np.copysign(1.0, x)
    folded_y = (1 - np.abs(x)) * np.copysign(1.0, y)
    x, y = np.where(behind, folded_x, x), np.where(behind, folded_y, y)
    return unit_rays(np.stack([x, y, -z], axis=-1))


def octahedral_place(rays: FloatArray) -> FloatArray:
    """The inverse of :func:`octahedral_rays`."""
    x, y, z = np.moveaxis(rays / np.abs(rays).sum(axis=-1, keepdims=True), -1, 0)
    behind = z > 0
    folded_x = (1 - np.abs(y)) * np.copysign(1.0, x)
    folded_y = (1 - np.abs(x)) * np.copysign(1.0, y)
    return np.stack([np.where(behind, folded_x, x), np.where(behind, folded_y, y)], axis=-1)


def _shares(camera: CubicCamera, rays: FloatArray) -> FloatArray:
    return (camera.project(rays) + 0.5) / np.array(camera.image_size)


def _between(table: Floats, place: FloatArray, seen: npt.NDArray[np.bool_]) -> FloatArray:
    """Entries of a table at places (N, 2) between its own; NaN where not all about it are seen."""
    x, y = (np.ascontiguousarray(place[:, axis][:, None], np.float32) for axis in (0, 1))
    found = cv2.remap(table, x, y, cv2.INTER_LINEAR)[:, 0]
    whole = cv2.remap(seen.astype(np.float32), x, y, cv2.INTER_LINEAR)[:, 0]
    return np.where(whole[:, None] > 1 - 1e-6, found, np.nan).astype(float)


def _enter_miss(camera: CubicCamera, enter: Floats) -> FloatArray:
    rng = np.random.default_rng(0)
    place = rng.uniform(0, np.array(camera.image_size) - 1, (_CHECKS, 2))
    place = np.rint(place * 32) / 32  # what cv2.remap knows of places
    rays = _between(enter, place, enter[..., 2] < 1)
    return _miss(camera.project(rays * _FLIP) - place)


def _leave_miss(camera: CubicCamera, leave: Floats) -> FloatArray:
    side = len(leave)
    rays = cone_rays(np.deg2rad(camera.max_angle_deg), _CHECKS) * _FLIP
    place = np.rint(((octahedral_place(rays) + 1) * side - 1) / 2 * 32) / 32
    shares = _between(leave, place, leave[..., 0] >= 0)
    at = octahedral_rays((2 * place + 1) / side - 1) * _FLIP
    return _miss((shares - _shares(camera, at)) * np.array(camera.image_size))


def _miss(offset: FloatArray) -> FloatArray:
    length = np.linalg.norm(offset, axis=1)
    return np.asarray(length[np.isfinite(length)])


@dataclass(frozen=True, kw_only=True, eq=False)
class TableCamera:
    """A camera of a USD file.

    Attributes:
        name: of the camera.
        image_size: (width, height) of its photos, pixels.
        rotation: (3, 3) of rig_from_camera.
        translation: (3,) of rig_from_camera.
        enter: the file of the directions of pixels.
        leave: the file of the pixels of directions.
        note: how the tables were made, a line each.

    """

    name: str
    image_size: tuple[int, int]
    rotation: FloatArray
    translation: FloatArray
    enter: str
    leave: str
    note: Sequence[str]


def usd_text(cameras: Sequence[TableCamera], metres: float | None) -> str:
    """A stage with the cameras below one transform; ``metres`` in its unit of length, if known."""
    unit = [] if metres is None else [f"    metersPerUnit = {metres!r}"]
    lines = ["#usda 1.0", "(", '    defaultPrim = "rig"', *unit, '    upAxis = "Y"', ")", ""]
    lines += ['def Xform "rig"', "{"]
    for one in cameras:
        lines += _camera_lines(one)
    return "\n".join([*lines, "}", ""])


def prim_name(name: str) -> str:
    """A camera's name as USD allows it."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if re.match(r"[A-Za-z_]", plain) else f"camera_{plain}"


def _camera_lines(one: TableCamera) -> list[str]:
    whole = np.eye(4)
    whole[:3, :3] = (np.diag(_FLIP) @ one.rotation @ np.diag(_FLIP)).T
    whole[3, :3] = np.diag(_FLIP) @ one.translation
    rows = ", ".join("(" + ", ".join(map(repr, row)) + ")" for row in (whole + 0.0).tolist())
    width, height = (float(side) for side in one.image_size)
    lut = "omni:lensdistortion:lut"
    return [
        *(f"    # {line}" for line in one.note),
        f'    def Camera "{prim_name(one.name)}" (',
        '        prepend apiSchemas = ["OmniLensDistortionLutAPI"]',
        "    )",
        "    {",
        f"        matrix4d xformOp:transform = ( {rows} )",
        '        uniform token[] xformOpOrder = ["xformOp:transform"]',
        '        token omni:lensdistortion:model = "lut"',
        f"        float {lut}:nominalWidth = {width!r}",
        f"        float {lut}:nominalHeight = {height!r}",
        # The tables have the principal point in them: this must be the middle.
        f"        float2 {lut}:opticalCenter = ({width / 2!r}, {height / 2!r})",
        f"        asset {lut}:rayEnterDirectionTexture = @{one.enter}@",
        f"        asset {lut}:rayExitPositionTexture = @{one.leave}@",
        "    }",
    ]
