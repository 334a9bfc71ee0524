"""A table of detections by photo and corner number, as scripts around Kalibr and Basalt write it.

Kalibr itself writes no corners. A table is read here whose first line names its columns, in any
order and case, with or without a ``#`` before it and a unit such as ``[ns]`` after a name:

=========  ==========================================================================
photo      ``image``, ``filename``, ``timestamp``, ``timestamp_ns`` or ``ts``
corner     ``corner_id``, ``point_id`` or ``id``: its number on the board; or ``tag_id``
           with ``corner_index`` or ``corner_idx`` (0 to 3), an aprilgrid's tag and corner
pixel      ``x`` or ``u`` or ``kp_x``, and ``y`` or ``v`` or ``kp_y``
camera     ``camera``, ``cam`` or ``cam_id``; may be missing
board      ``board``, ``board_id`` or ``target_id``; may be missing
weight     ``weight`` of the corner's squared error; may be missing
=========  ==========================================================================

Other columns are refused. With a camera column, photos are called ``cam<camera>/<photo>``.

Numbers are Kalibr's unless said otherwise: on an aprilgrid row by row along x from the LOWEST row
up (``rows-from-bottom``), on a checkerboard as OpenCV finds them (``rows``); with ``tag_id``, four
corners a tag: bottom left, bottom right, top right, top left. Basalt's ``corner_id`` is
4 · tag + corner (``tags``). Tags are called by their ids, which start at the board's
``first_marker``. Pixel (0, 0) is the middle of the top-left pixel, as in OpenCV; the file does not
say so, nor how large the photos are.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from cubicfish_cli.corner_files.detections import Detections, read_text
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.tables import Table, csv_text, parse_table
from cubicfish_cli.types import IntArray

MAX_BYTES = 200_000_000
_NAMES = {
    "image": ("image", "filename", "timestamp", "timestamp_ns", "ts"),
    "corner_id": ("corner_id", "point_id", "id"),
    "tag_id": ("tag_id",),
    "corner_index": ("corner_index", "corner_idx"),
    "x": ("x", "u", "kp_x"),
    "y": ("y", "v", "kp_y"),
    "camera": ("camera", "cam", "cam_id"),
    "board": ("board", "board_id", "target_id"),
    "weight": ("weight",),
}
_OWN = {alias: own for own, aliases in _NAMES.items() for alias in aliases}
_MAX_ID = 10_000_000


def read_detections_csv(path: Path) -> Detections:
    """Read one table of detections.

    Raises:
        CorrespondenceError: the file is not such a table; one line that names the file and the
            line.

    """
    table = _table(path)
    if "camera" in table.columns:
        table = _with_camera(table)
    images, image = table.codes("image")
    labels, label = table.codes("board") if "board" in table.columns else (("",), None)
    return Detections(
        path=path,
        lines=np.array(table.lines, np.intp),
        image_size=None,
        images=images,
        image=image,
        labels=labels,
        label=np.zeros(len(image), np.intp) if label is None else label,
        number=_numbers(table),
        pixel=np.stack([table.floats("x"), table.floats("y")], axis=-1),
        weight=table.floats("weight") if "weight" in table.columns else np.ones(len(image)),
        left_out=0,
        numbering="tags" if "tag_id" in table.columns else None,
        cameras="camera" in table.columns,
    )


def _table(path: Path) -> Table:
    header, newline, body = read_text(path, max_bytes=MAX_BYTES).partition("\n")
    names = [_own_name(cell) for cell in header.strip().lstrip("#").split(",")]
    tags = "tag_id" in names
    corner = ("tag_id", "corner_index") if tags else ("corner_id",)
    return parse_table(
        str(path),
        csv_text([names]).rstrip("\n") + newline + body,
        required=("image", *corner, "x", "y"),
        optional=("camera", "board", "weight"),
        error=CorrespondenceError,
    )


def _own_name(cell: str) -> str:
    """``Timestamp [ns]`` -> ``image``; what is not known stays as it is."""
    name = re.sub(r"\s*\[(\w+)\]", r"_\1", cell.strip().strip('"')).lower().replace(" ", "_")
    return _OWN.get(name, cell.strip())


def _with_camera(table: Table) -> Table:
    names = [
        f"cam{camera.strip().removeprefix('cam')}/{image.strip()}"
        for camera, image in zip(table.columns["camera"], table.columns["image"], strict=True)
    ]
    return replace(table, columns={**table.columns, "image": names})


def _numbers(table: Table) -> IntArray:
    if "corner_id" in table.columns:
        return table.integers("corner_id")
    tag, corner = table.integers("tag_id"), table.integers("corner_index")
    bad = np.flatnonzero((corner < 0) | (corner > 3) | (tag < 0) | (tag > _MAX_ID))
    if bad.size:
        table.refuse(bad[0], "tag_id must be 0 or more, and corner_index 0, 1, 2 or 3")
    return 4 * tag + corner
