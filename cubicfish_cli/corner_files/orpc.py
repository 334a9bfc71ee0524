"""Deltille's ``.orpc``: the corners of one photo (Ha et al. 2017, the deltille_detector program).

::

    filename: run1/0000.png
    width: 1280
    height: 800
    num_corners: 341
    encoding: ascii
    0,17,1,526.90,552.47

Each line below the header is ``board,corner,ordered,x,y``: the board's number in the .dsc file; the
corner's number, row by row along the board's columns from its first corner; whether the board was
indexed (lines with 0 are left out: their numbers mean nothing); and the pixel, with (0, 0) at the
middle of the top-left pixel as in OpenCV.

Which of a board's four corners is its first is what the .dsc file says of its tags: corner (0, 0)
and the axes of that board in the target must be the same ones. Boards of triangles are no grids of
rows and columns and have no place in a target.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cubicfish_cli.corner_files.detections import Detections, read_text, rows_where
from cubicfish_cli.corner_files.observations_csv import parse_size
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.tables import parse_table
from cubicfish_cli.wording import quoted

MAX_BYTES = 4_000_000
_HEADER = ("filename", "width", "height", "num_corners", "encoding")
_COLUMNS = ("board", "corner", "ordered", "x", "y")


def read_orpc(path: Path) -> Detections:
    """Read one ``.orpc`` file.

    Raises:
        CorrespondenceError: the file is not one; one line that names the file and the line.

    """
    lines = read_text(path, max_bytes=MAX_BYTES).splitlines()
    header = {}
    for number, key in enumerate(_HEADER, start=1):
        line = lines[number - 1] if number <= len(lines) else ""
        name, colon, value = line.partition(":")
        if not colon or name.strip() != key or not value.strip():
            raise CorrespondenceError(
                f"{path}, line {number}: '{key}: ...' is expected here: is it an .orpc file?"
            )
        header[key] = value.strip()
    if header["encoding"] != "ascii":
        raise CorrespondenceError(
            f"{path}, line 5: encoding {quoted(header['encoding'])} is not read here: "
            "write the file with encoding ascii"
        )
    image = header["filename"]
    if not image.isprintable():
        raise CorrespondenceError(f"{path}, line 1: {quoted(image)} is not a file's name")
    try:
        size = parse_size(f"{header['width']}x{header['height']}")
    except CorrespondenceError as problem:
        raise CorrespondenceError(f"{path}, line 2: {problem}") from problem
    body = [line for line in lines[len(_HEADER) :] if line.strip()]
    if header["num_corners"] != str(len(body)):
        raise CorrespondenceError(
            f"{path}, line 4: num_corners is {quoted(header['num_corners'])}, but {len(body)} "
            "corners follow: is the file whole?"
        )
    if not body:
        return _nothing(path, image, size)
    # The names of the columns on the header's last line keep the numbers of all lines.
    text = "\n".join(["", "", "", "", ",".join(_COLUMNS), *lines[len(_HEADER) :]])
    table = parse_table(str(path), text, required=_COLUMNS, optional=(), error=CorrespondenceError)
    ordered = table.integers("ordered") != 0
    left_out = int((~ordered).sum())
    if not ordered.any():
        return _nothing(path, image, size, left_out)
    table = rows_where(table, ordered)
    labels, label = table.codes("board")
    return Detections(
        path=path,
        lines=np.array(table.lines, np.intp),
        image_size=size,
        images=(image,),
        image=np.zeros(len(table.lines), np.intp),
        labels=labels,
        label=label,
        number=table.integers("corner"),
        pixel=np.stack([table.floats("x"), table.floats("y")], axis=-1),
        weight=np.ones(len(table.lines)),
        left_out=left_out,
    )


def _nothing(path: Path, image: str, size: tuple[int, int], left_out: int = 0) -> Detections:
    nothing = np.zeros(0, np.intp)
    return Detections(
        path=path,
        lines=nothing,
        image_size=size,
        images=(image,),
        image=nothing,
        labels=(),
        label=nothing,
        number=nothing,
        pixel=np.zeros((0, 2)),
        weight=np.zeros(0),
        left_out=left_out,
    )
