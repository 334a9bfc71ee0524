"""Poses of photos as a table: a rotation vector in radians, and a translation."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cubicfish import CorrespondenceError, FloatArray
from cubicfish.files import Table

Pose = tuple[FloatArray, FloatArray]
"""camera_from_world: rotation vector (3,) in radians, translation (3,) in the target's units."""
_COLUMNS = ("image", "rx", "ry", "rz", "tx", "ty", "tz")
_MOST = 1e9


def pose_table_text(poses: Mapping[str, Pose]) -> str:
    """Write poses by photo as CSV text; numbers read back exactly.

    ``rx, ry, rz`` are the rotation vector in radians and ``tx, ty, tz`` the translation, in the
    target's units.
    """
    rows = [
        (name, *np.asarray(rotation, float).tolist(), *np.asarray(translation, float).tolist())
        for name, (rotation, translation) in poses.items()
    ]
    return "# cubicfish poses 1, camera_from_world\n" + Table.text([_COLUMNS, *rows])


def load_poses(path: Path) -> dict[str, Pose]:
    """Read poses by photo, in the file's order.

    Raises:
        CorrespondenceError: the file cannot be read, is no such table, or names a photo twice;
            the text names the file and the line.

    """
    table = Table.read(path, required=_COLUMNS, optional=(), error=CorrespondenceError)
    names, code = table.codes("image")
    numbers = np.stack([table.floats(column) for column in _COLUMNS[1:]], axis=-1)
    for row, values in enumerate(numbers):
        if (code[:row] == code[row]).any():
            table.refuse(row, f"{names[code[row]]} is there twice: give each photo one pose")
        if np.abs(values).max() > _MOST:
            table.refuse(row, f"the pose must lie within ±{_MOST:g}")
    return {names[code[row]]: (values[:3], values[3:]) for row, values in enumerate(numbers)}
