"""Reading corner files of other detectors, in any known format.

A table of detections by photo and corner number, as scripts around Kalibr and Basalt write it.

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

Numbers are Kalibr's: on an aprilgrid row by row along x from the LOWEST row up, on a checkerboard
as OpenCV finds them; with ``tag_id``, four corners a tag: bottom left, bottom right, top right, top
left. Tags are called by their ids, which start at the board's
``first_marker``. Pixel (0, 0) is the middle of the top-left pixel, as in OpenCV; the file does not
say so, nor how large the photos are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.corner_files.detections import (
    Detections,
    named_corners,
    read_text,
    select_images,
)
from cubicfish_cli.corner_files.vnlog import read_vnlog
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.observations import Observations, no_such_board
from cubicfish_cli.tables import Table, csv_text, parse_table
from cubicfish_cli.target import Target
from cubicfish_cli.types import IntArray
from cubicfish_cli.wording import quoted

CornerFormat = Literal["mrcal", "kalibr"]
CORNER_FORMATS: tuple[CornerFormat, ...] = get_args(CornerFormat)
_SUFFIXES: dict[str, CornerFormat] = {".vnl": "mrcal", ".csv": "kalibr"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Read:
    """What was read.

    Attributes:
        corners: the corners.
        left_out: how many corners the files themselves declare as not found.
        empty: names of photos without any corner.

    """

    corners: Observations
    left_out: int
    empty: tuple[str, ...]


def read_corner_files(
    paths: Sequence[Path],
    target: Target,
    *,
    kind: CornerFormat | None = None,
    boards: Mapping[str, str] | None = None,
    image_size: tuple[int, int],
    only: str | None = None,
) -> Read:
    """Read the corners of one camera from files of other detectors.

    Args:
        paths: the files.
        target: the calibration target.
        kind: the files' format; by default it goes by their suffixes.
        boards: see :func:`~cubicfish_cli.corner_files.detections.named_corners`.
        image_size: (width, height) of the photos, which no such file states.
        only: a glob: only photos whose names match it.

    Raises:
        CorrespondenceError: a file cannot be read or does not fit; one line that names it.

    """
    boards = boards or {}
    files = [_read(path, kind, target, boards) for path in paths]
    _refuse_unknown_labels(files, boards)
    if only is not None:
        files = [select_images(found, only) for found in files]
        if not any(found.images for found in files):
            raise CorrespondenceError(f"no photo in the files is called like {quoted(only)}")
    _refuse_cameras(files)
    corners = named_corners(files, target, boards=boards, image_size=image_size)
    used = set(corners.images)
    return Read(
        corners=corners,
        left_out=sum(found.left_out for found in files),
        empty=tuple(name for found in files for name in found.images if name not in used),
    )


def _read(
    path: Path, kind: CornerFormat | None, target: Target, boards: Mapping[str, str]
) -> Detections:
    kind = kind or _SUFFIXES.get(path.suffix.lower())
    if kind is None:
        known = " or ".join(CORNER_FORMATS)
        raise CorrespondenceError(
            f"{path}: what detector wrote it is not known: add --format {known}"
        )
    if kind == "kalibr":
        return read_detections_csv(path)
    board = _only_board(path, target, boards.get(""))
    return read_vnlog(path, corners=board.columns * board.rows)


def _only_board(path: Path, target: Target, name: str | None) -> Board:
    """The board that a file which knows of one board only is about."""
    if name is None and len(target.boards) > 1:
        shown = ", ".join(quoted(name) for name in target.board_names[:8])
        raise CorrespondenceError(
            f"{path}: it is about one board, and which of the target's ({shown}) is not known: "
            "say so with --board NAME"
        )
    for board in target.boards:
        if name is None or board.name == name:
            return board
    raise CorrespondenceError(no_such_board(str(name), target))


def _refuse_unknown_labels(files: Sequence[Detections], boards: Mapping[str, str]) -> None:
    """A board that was named for a label that no file has is a slip."""
    labels = {label for found in files for label in found.labels}
    for label in boards:
        if label not in labels and labels:
            known = ", ".join(sorted(quoted(label) for label in labels if label)) or "none"
            what = f"board {quoted(label)}" if label else "corners without a board's number"
            raise CorrespondenceError(f"{files[0].path}: it has no {what}; its boards: {known}")


def _refuse_cameras(files: Sequence[Detections]) -> None:
    cameras = sorted(
        {name.split("/")[0] for found in files if found.cameras for name in found.images}
    )
    if len(cameras) > 1:
        raise CorrespondenceError(
            f"{files[0].path}: corners of {len(cameras)} cameras: choose one, such as with "
            f"--only '{quoted(cameras[0])[1:-1]}/*'"
        )


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
        images=images,
        image=image,
        labels=labels,
        label=np.zeros(len(image), np.intp) if label is None else label,
        number=_numbers(table),
        pixel=np.stack([table.floats("x"), table.floats("y")], axis=-1),
        weight=table.floats("weight") if "weight" in table.columns else np.ones(len(image)),
        left_out=0,
        by_tags="tag_id" in table.columns,
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
