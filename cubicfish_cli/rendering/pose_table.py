"""Poses of photos as a CSV table: camera_from_world, a row a photo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.rendering.pose import Pose
from cubicfish_cli.tables import csv_text, read_table

POSE_COLUMNS = ("image", "rx", "ry", "rz", "tx", "ty", "tz")
_MOST = 1e9


def pose_table_text(poses: Mapping[str, Pose]) -> str:
    """Poses by photo as CSV; numbers read back exactly.

    ``rx, ry, rz`` are the rotation vector in radians and ``tx, ty, tz`` the translation, in the
    target's units.
    """
    rows = [
        (name, *np.asarray(rotation, float).tolist(), *np.asarray(translation, float).tolist())
        for name, (rotation, translation) in poses.items()
    ]
    return "# cubicfish poses 1, camera_from_world\n" + csv_text([POSE_COLUMNS, *rows])


def load_poses(path: Path) -> dict[str, Pose]:
    """Read poses by photo, in the file's order.

    Raises:
        CorrespondenceError: the file cannot be read, is no such table, or names a photo twice;
            the text names the file and the line.

    """
    table = read_table(path, required=POSE_COLUMNS, optional=(), error=CorrespondenceError)
    names, code = table.codes("image")
    numbers = np.stack([table.floats(column) for column in POSE_COLUMNS[1:]], axis=-1)
    for row, values in enumerate(numbers):
        if (code[:row] == code[row]).any():
            table.refuse(row, f"{names[code[row]]} is there twice: give each photo one pose")
        if np.abs(values).max() > _MOST:
            table.refuse(row, f"the pose must lie within ±{_MOST:g}")
    return {names[code[row]]: (values[:3], values[3:]) for row, values in enumerate(numbers)}
