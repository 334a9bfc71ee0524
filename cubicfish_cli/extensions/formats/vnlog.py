"""mrcal's ``corners.vnl``: the corners of many photos of one board, as mrgingham writes them.

::

    # filename x y level
    frame1.png 320.1 241.5 0
    frame1.png 355.8 241.9 0
    frame2.png - - -

A text table (vnlog): lines that start with ``##`` or ``#!`` are comments, the first other line with
``#`` names the columns: ``filename``, ``x``, ``y`` and maybe ``level`` or ``weight``, in any order.
A photo has either one row of dashes, when nothing was found in it, or one row for each corner of
the board, row by row from its first corner; a corner with a dash, or with x or y below 0, was not
found. ``level`` n is a corner found in the photo at 1/2ⁿ of its size: its error counts 1/2ⁿ as
much, and ``weight`` w makes it count w as much (mrcal's ``--corners-cache-has-weights``). Errors
are squared after that, so that the corner's weight here is w².

The file says neither the size of the photos nor which corner of the board comes first. mrgingham
numbers from the top left as the photo shows it, in each photo anew: a board that is alone in its
target may be turned from photo to photo. A calibration names a board that is seen from behind.
"""

import re
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cubicfish import CorrespondenceError, FloatArray, Observations, Target, UsageError, quoted
from cubicfish.files import Table, read_text

MAX_BYTES = 200_000_000
MAX_LINES = 5_000_000
_COLUMNS = ("filename", "x", "y")
_OPTIONAL = ("level", "weight")
_MAX_LEVEL = 12
# A dash, or a number below 0; what only looks like one is refused as no number.
_ABSENT = re.compile(r"-(?:[0-9.]+(?:[eE][-+]?[0-9]+)?)?").fullmatch


def read_vnlog(
    path: Path, target: Target, board: int, image_size: tuple[int, int] | None, only: str
) -> tuple[Observations, int]:
    """Read corners of photos that match, listing all photos; count those declared not found.

    Raises:
        UsageError: the size of the photos is not given.
        CorrespondenceError: the file cannot be used; one line.

    """
    if image_size is None:
        raise UsageError(f"{path} does not say how large the photos are: add --size WxH")
    table, one = _read_table(path), target.boards[board]
    images, image = table.codes("filename")
    _refuse_scattered(table, image)
    start, count = np.flatnonzero(np.diff(image, prepend=-1)), np.bincount(image)
    found, corners = _find_corners(table), one.columns * one.rows
    empty = (count == 1) & ~found[start]
    wrong = np.flatnonzero((count != corners) & ~empty)
    if wrong.size:
        first = wrong[0]
        table.refuse(
            start[first],
            f"{quoted(images[first])} has {count[first]} rows where the board has {corners} "
            "corners: does the target say how many there are?",
        )
    wanted = np.array([fnmatchcase(name, only) for name in images], bool)[image]
    used = found & wanted
    # Rows that are not used need not hold numbers.
    columns = {
        name: [cell if use else "1" for cell, use in zip(cells, used.tolist(), strict=True)]
        for name, cells in table.columns.items()
        if name != "filename"
    }
    table = replace(table, columns=columns)
    row, column = np.divmod(np.arange(len(image)) - start[image], one.columns)
    boards = np.full(len(image), board, np.intp)
    every = Observations(
        image_size=image_size,
        images=images,
        boards=target.board_names,
        image=image,
        board=boards,
        column=column,
        row=row,
        pixel=table.points("x", "y"),
        weight=_read_weights(table),
        world=target.world_points(boards, column, row),
        target=target,
    )
    return every.usable(table.refuse).select(used), int((wanted & ~found & ~empty[image]).sum())


def _read_table(path: Path) -> Table:
    """Read the rows as a table with the line numbers of the file."""
    text = read_text(path, max_bytes=MAX_BYTES, error=CorrespondenceError)
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
    rows = ["" if line.lstrip()[:1] in ("", "#") else _convert_to_csv(line) for line in lines]
    rows[legend] = Table.text([names]).rstrip("\n")
    table = Table.parse(
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


def _convert_to_csv(line: str) -> str:
    cells = line.split("#", 1)[0].split()
    return ",".join('"' + cell.replace('"', '""') + '"' for cell in cells)


def _refuse_scattered(table: Table, image: npt.NDArray[np.intp]) -> None:
    """Refuse a photo whose rows do not stand together: its corners are numbered by their order."""
    back = np.flatnonzero(np.diff(image) < 0)
    if back.size:
        name = table.columns["filename"][back[0] + 1]
        table.refuse(
            int(back[0]) + 1,
            f"rows of {quoted(name)} stand further up too, and the rows between are another "
            "photo's: sort them by photo, each photo's rows in their order",
        )


def _find_corners(table: Table) -> npt.NDArray[np.bool_]:
    """Return which rows are corners, as in mrcal: no dash, no coordinate or level below 0."""
    cells = [table.columns[name] for name in table.columns if name != "filename"]
    return np.array([not any(map(_ABSENT, row)) for row in zip(*cells, strict=True)], bool)


def _read_weights(table: Table) -> FloatArray:
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
