"""corners.csv (named corners) and correspondences.csv (2D-3D pairs): read and written."""

import re
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish.errors import CorrespondenceError
from cubicfish.files.reading import MAX_COORDINATE, MAX_SIDE
from cubicfish.files.tables import Table
from cubicfish.files.whole_files import write_files
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import IntArray
from cubicfish.wording import quoted

CORNER_COLUMNS = ("image", "board", "column", "row", "x", "y")
PAIR_COLUMNS = ("image", "X", "Y", "Z", "x", "y")
_CERTAIN = "certain"
# The newest version of each kind of file that is read.
_VERSIONS = {"corners": 2, "correspondences": 1}
_SIZE = "([0-9]{1,6})[xX×]([0-9]{1,6})"


def load_corners(
    path: Path | str, target: Target | None = None, *, image_size: tuple[int, int] | None = None
) -> Observations:
    """Read ``corners.csv``: pixels (N, 2), names and world points of corners, sorted by photo.

    Without a target it is ``correspondences.csv``: points and pixels that need none.

    Args:
        path: the file; its first line is ``# cubicfish corners 2, image_size WxH``, or with a 1
            where there is no column ``certain``, or ``# cubicfish correspondences 1, ...``.
        target: the calibration target that the boards, columns and rows are of.
        image_size: (width, height), for files without that first line.

    Raises:
        CorrespondenceError: the file is malformed or does not fit the target; the text names
            the file and the line.

    """
    if target is None:
        return load_correspondences(Path(path), image_size=image_size)
    table = Table.read(
        Path(path),
        required=CORNER_COLUMNS,
        optional=("weight", _CERTAIN),
        error=CorrespondenceError,
    )
    size = _find_image_size(table, "corners", image_size)
    images, image = table.codes("image")
    boards, board = table.codes("board")
    found = Observations(
        **_read_certain(table),
        image_size=size,
        images=images,
        boards=boards,
        image=image,
        board=board,
        column=table.integers("column"),
        row=table.integers("row"),
        pixel=table.points("x", "y"),
        weight=table.floats("weight", 1.0),
    )
    return found.usable(table.refuse).with_target(target, table.refuse)


def save_corners(path: Path | str, corners: Observations, *, overwrite: bool = False) -> None:
    """Write ``corners.csv``, as :func:`corners_text` has it.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    write_files({Path(path): corners_text(corners)}, overwrite=overwrite)


def corners_text(corners: Observations) -> str:
    """The text of corners.csv, pixels (N, 2) a corner per line; numbers read back exactly.

    Where all names are certain, as they nearly always are, it is a file of version 1, which every
    reader understands; otherwise it is of version 2, with the column ``certain``.
    """
    columns = [
        _list_names(corners.images, corners.image),
        _list_names(corners.boards, corners.board),
        corners.column.tolist(),
        corners.row.tolist(),
        *corners.pixel.T.tolist(),
    ]
    header: tuple[str, ...] = CORNER_COLUMNS
    version = 1
    if not corners.certain.all():
        header, version = (*header, _CERTAIN), 2
        columns.append(corners.certain.astype(int).tolist())
    if (corners.weight != 1).any():
        header = (*header, "weight")
        columns.append(corners.weight.tolist())
    width, height = corners.image_size
    first = f"# cubicfish corners {version}, image_size {width}x{height}\n"
    return first + Table.text(chain([header], zip(*columns, strict=True)))


def load_correspondences(path: Path, *, image_size: tuple[int, int] | None = None) -> Observations:
    """Read ``correspondences.csv``; see :func:`load_corners`."""
    table = Table.read(path, required=PAIR_COLUMNS, optional=("weight",), error=CorrespondenceError)
    size = _find_image_size(table, "correspondences", image_size)
    images, image = table.codes("image")
    world = table.points("X", "Y", "Z")
    bad = np.flatnonzero((np.abs(world) > MAX_COORDINATE).any(axis=1))
    if bad.size:
        table.refuse(bad[0], f"X, Y, Z must lie within ±{MAX_COORDINATE:g}")
    found = Observations.without_names(
        image_size=size,
        images=images,
        image=image,
        world=world,
        column=np.arange(len(image), dtype=np.intp),
        pixel=table.points("x", "y"),
        weight=table.floats("weight", 1.0),
    )
    return found.usable(table.refuse).by_photo()


def _find_image_size(table: Table, kind: str, given: tuple[int, int] | None) -> tuple[int, int]:
    """The image size, from the file's first line, the caller, or both if they agree."""
    if not table.comment.startswith("cubicfish"):
        if given is None:
            raise CorrespondenceError(
                "the image size is not known",
                do="add {image_size}, or start the file with the line "
                f"'# cubicfish {kind} 1, image_size WxH'",
                about=table.name,
                apart=True,
                arguments={"image_size": "image_size=(W, H)"},
            )
        return given
    number = re.match(rf"cubicfish\s+{kind}\s+([0-9]{{1,9}})\b", table.comment)
    if number and int(number[1]) > _VERSIONS[kind]:
        raise CorrespondenceError(
            f"{table.name}, line 1: format {int(number[1])} is newer than {_VERSIONS[kind]}, the "
            "last one that is read here: use the cubicfish that wrote it, or a newer one"
        )
    version = f"[1-{_VERSIONS[kind]}]"
    first = re.fullmatch(rf"cubicfish\s+{kind}\s+{version}\s*,\s*image_size\s+(\S+)", table.comment)
    if first is None:
        raise CorrespondenceError(
            f"{table.name}, line 1: it must be '# cubicfish {kind} 1, image_size WxH', not "
            f"{quoted(table.comment)}: name another file"
        )
    size = re.fullmatch(_SIZE, first[1])
    stated = (int(size[1]), int(size[2])) if size else (0, 0)
    if not all(0 < side <= MAX_SIDE for side in stated):
        raise CorrespondenceError(
            f"{table.name}, line 1: {quoted(first[1])} is not an image size: write WIDTHxHEIGHT, "
            "such as 1280x800"
        )
    if given is not None and stated != given:
        raise CorrespondenceError(
            f"{table.name}, line 1: the image size is {stated[0]}x{stated[1]} here, "
            f"but {given[0]}x{given[1]} is expected"
        )
    return stated


def _read_certain(table: Table) -> dict[str, Any]:
    """Whether each name is certain, if the table has that column."""
    if _CERTAIN not in table.columns:
        return {}
    certain = table.integers(_CERTAIN)
    bad = np.flatnonzero((certain != 0) & (certain != 1))
    if bad.size:
        table.refuse(bad[0], f"{_CERTAIN} must be 1, or 0 where it may be another corner")
    return {_CERTAIN: certain == 1}


def _list_names(names: tuple[str, ...], index: IntArray) -> list[str]:
    return [names[i] for i in index.tolist()]
