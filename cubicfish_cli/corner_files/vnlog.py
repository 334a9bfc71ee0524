"""mrcal's ``corners.vnl``: the corners of many photos of one board, as mrgingham writes them.

::

    # filename x y level
    frame1.png 320.1 241.5 0
    frame1.png 355.8 241.9 0
    frame2.png - - -

A text table (vnlog): lines that start with ``##`` or ``#!`` are remarks, the first other line with
``#`` names the columns: ``filename``, ``x``, ``y`` and maybe ``level`` or ``weight``, in any order.
A photo has either one row of dashes, when nothing was found in it, or one row for each corner of
the board, row by row from its first corner; a corner with a dash, or with x or y below 0, was not
found. ``level`` n is a corner found in the photo at 1/2ⁿ of its size: its error counts 1/2ⁿ as
much, and ``weight`` w makes it count w as much (mrcal's ``--corners-cache-has-weights``). Errors
are squared after that, so that the corner's weight here is w².

The file says neither the size of the photos nor which corner of the board comes first. mrgingham
numbers from the top left as the photo shows it, in each photo anew: a board that is alone in its
target may be turned from photo to photo, but must not look mirrored.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cubicfish_cli.corner_files.detections import Detections, read_text, rows_where
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.tables import Table, csv_text, parse_table
from cubicfish_cli.types import FloatArray, IntArray
from cubicfish_cli.wording import quoted

MAX_BYTES = 200_000_000
MAX_LINES = 5_000_000
_COLUMNS = ("filename", "x", "y")
_OPTIONAL = ("level", "weight")
_MAX_LEVEL = 12
# A dash, or a number below 0; what only looks like one is refused as no number.
_ABSENT = re.compile(r"-(?:[0-9.]+(?:[eE][-+]?[0-9]+)?)?").fullmatch


def read_vnlog(path: Path, *, corners: int) -> Detections:
    """Read one ``corners.vnl``.

    Args:
        path: the file.
        corners: how many corners the board has; every photo has as many rows.

    Raises:
        CorrespondenceError: the file is not one, or a photo has another number of rows; one line
            that names the file and the line.

    """
    table = _table(path)
    images, image = table.codes("filename")
    _refuse_scattered(table, image)
    start = np.flatnonzero(np.diff(image, prepend=-1))
    count = np.diff(np.append(start, len(image)))
    found = _found(table)
    empty = (count == 1) & ~found[start]
    wrong = np.flatnonzero((count != corners) & ~empty)
    if wrong.size:
        first = wrong[0]
        table.refuse(
            start[first],
            f"{quoted(images[first])} has {count[first]} rows where the board has {corners} "
            "corners: does the target say how many there are?",
        )
    number = np.arange(len(image)) - start[image]
    left_out = int((~found & ~empty[image]).sum())
    table = rows_where(table, found)
    return Detections(
        path=path,
        lines=np.array(table.lines, np.intp),
        images=images,
        image=image[found],
        labels=("",),
        label=np.zeros(int(found.sum()), np.intp),
        number=number[found].astype(np.intp),
        pixel=np.stack([table.floats("x"), table.floats("y")], axis=-1),
        weight=_weights(table),
        left_out=left_out,
    )


def _table(path: Path) -> Table:
    """The rows as a table whose lines are the file's own."""
    text = read_text(path, max_bytes=MAX_BYTES)
    if text.count("\n") + text.count("\r") > MAX_LINES:
        raise CorrespondenceError(
            f"{path} has more than {MAX_LINES:,} lines: is it the right file?"
        )
    lines = text.splitlines()
    legend = next((i for i, line in enumerate(lines) if re.match(r"\s*#(?![#!])", line)), None)
    if legend is None or any(line.strip()[:1] not in ("", "#") for line in lines[:legend]):
        raise CorrespondenceError(
            f"{path}: a line '# filename x y level' must come before the corners: "
            "is it a vnlog of corners?"
        )
    names = lines[legend].replace("#", " ", 1).split()
    rows = ["" if line.lstrip()[:1] in ("", "#") else _as_csv(line) for line in lines]
    rows[legend] = csv_text([names]).rstrip("\n")
    table = parse_table(
        str(path),
        "\n".join(rows),
        required=_COLUMNS,
        optional=_OPTIONAL,
        error=CorrespondenceError,
    )
    if {*_OPTIONAL} <= set(table.columns):
        raise CorrespondenceError(
            f"{path}, line {legend + 1}: both level and weight: keep one of the columns"
        )
    return table


def _as_csv(line: str) -> str:
    cells = line.split("#", 1)[0].split()
    return ",".join('"' + cell.replace('"', '""') + '"' for cell in cells)


def _refuse_scattered(table: Table, image: IntArray) -> None:
    """A photo's corners are numbered by their order: they must stand together."""
    back = np.flatnonzero(np.diff(image) < 0)
    if back.size:
        name = table.columns["filename"][back[0] + 1]
        table.refuse(
            int(back[0]) + 1,
            f"rows of {quoted(name)} stand further up too, and the rows between are another "
            "photo's: sort them by photo, each photo's rows in their order",
        )


def _found(table: Table) -> npt.NDArray[np.bool_]:
    """Which rows are corners, as mrcal has it: no dash, no coordinate or level below 0."""
    cells = [table.columns[name] for name in table.columns if name != "filename"]
    return np.array([not any(map(_ABSENT, row)) for row in zip(*cells, strict=True)], bool)


def _weights(table: Table) -> FloatArray:
    if "weight" in table.columns:
        weight = table.floats("weight")
        return weight * weight
    if "level" not in table.columns:
        return np.ones(len(table.lines))
    level = table.floats("level")
    bad = np.flatnonzero((level > _MAX_LEVEL) | (level != np.floor(level)))
    if bad.size:
        table.refuse(
            bad[0],
            f"level must be a whole number up to {_MAX_LEVEL}, or '-': for weights, name the "
            "column weight",
        )
    return np.asarray(0.25**level)
