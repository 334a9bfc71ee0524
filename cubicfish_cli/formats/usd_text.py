"""USD cameras whose lenses are tables, as text (.usda): NVIDIA's OmniLensDistortionLutAPI.

USD's cameras have x to the right, y up and look along -z; so has the rig's frame here, which is the
first camera's. Matrices stand to the right of rows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.types import FloatArray

_FLIP = np.diag([1.0, -1.0, -1.0])


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
    whole[:3, :3] = (_FLIP @ one.rotation @ _FLIP).T
    whole[3, :3] = _FLIP @ one.translation
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
