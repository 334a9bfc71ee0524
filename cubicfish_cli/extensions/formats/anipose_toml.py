"""Anipose's calibration.toml, which FreeMoCap, caliscope and Pose2Sim read as well.

Each camera is a table: ``matrix`` and ``distortions`` are those of cv2.fisheye if ``fisheye`` is
true, else cv2's own; ``rotation`` (a rotation vector) and ``translation`` (metres) take points from
the rig's frame, which is the first camera's, to the camera's. Pixel (0, 0) is the middle of the
first pixel. Tables are read in the order of their names.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish.models import RadialCamera
from cubicfish_cli.extensions.formats.lenses import PinholeLens, matrix_rows
from cubicfish_cli.foreign.file_contents import LensRig, PlacedLens


@dataclass(frozen=True, kw_only=True, eq=False)
class BrownLens(PinholeLens):
    """OpenCV's pinhole lens with the five numbers that all of these programs take."""

    name = "brown"
    label = "pinhole of five numbers"

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the one without distortion."""
        return (cls.near(radial, d=np.zeros(5)),)


def anipose_text(one: PlacedLens) -> str:
    """Write a lens as a calibration.toml of one camera, in its own frame."""
    return _write_text(one.note, {"cam_0": _make_table(one, 1.0)})


def anipose_rig_text(rig: LensRig) -> str:
    """Write lenses as a calibration.toml.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    metres, digits = rig.metres, len(str(len(rig.lenses) - 1))
    notes = [f"{_write_value(one.name)}: {line}" for one in rig.lenses for line in one.note]
    tables = {f"cam_{n:0{digits}}": _make_table(one, metres) for n, one in enumerate(rig.lenses)}
    return _write_text(notes, tables)


def _make_table(one: PlacedLens, metres: float) -> dict[str, Any]:
    lens = one.lens
    return {
        "name": one.name,
        "size": list(lens.image_size),
        "matrix": matrix_rows(lens),
        "distortions": (lens.k if isinstance(lens, RadialCamera) else lens.d).tolist(),
        "rotation": Rotation.from_matrix(one.rotation).as_rotvec().tolist(),
        "translation": (one.translation * metres + 0.0).tolist(),
        "fisheye": isinstance(lens, RadialCamera),
    }


def _write_text(note: Sequence[str], tables: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [f"# {line}" for line in note]
    for name, table in tables.items():
        lines += [
            "",
            f"[{name}]",
            *(f"{key} = {_write_value(value)}" for key, value in table.items()),
        ]
    return "\n".join([*lines, "", "[metadata]", "adjusted = true", ""])


def _write_value(value: Any) -> str:
    """Write a value: text, flags and lists are the same in JSON and TOML, but for one character."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
