"""Corners that other detectors found: files of any kind that is known, joined to one table."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from cubicfish import CorrespondenceError, Observations, Target, quoted
from cubicfish.files import read_bytes
from cubicfish_cli.extensions.formats.board_tables import read_calib_data, read_photonvision
from cubicfish_cli.extensions.formats.vnlog import MAX_BYTES, read_vnlog

Reader = Callable[[Path, Target, int, tuple[int, int] | None, str], tuple[Observations, int]]
"""(file, target, index of its board, size of the photos, glob of their names) -> corners of the
photos of such names, and how many of them the file declares as not found."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedCorners:
    """Corners of another detector's files.

    Attributes:
        corners: the corners.
        left_out: how many corners the files themselves declare as not found.
        empty: names of photos without any corner.
        file: the corners.csv that was written; None if none was.

    """

    corners: Observations
    left_out: int
    empty: tuple[str, ...]
    file: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish corners --json`` prints.

        Keys:
            file: the table of corners
            image_size: [width, height]
            images: how many photos have corners
            corners: how many corners were taken over
            left_out: how many the files say were not found
            empty_images: photos without corners

        """
        return {
            "file": self.file,
            "image_size": self.corners.image_size,
            "images": len(self.corners.images),
            "corners": len(self.corners.pixel),
            "left_out": self.left_out,
            "empty_images": self.empty,
        }


def read_corner_files(
    paths: Sequence[Path],
    target: Target,
    *,
    image_size: tuple[int, int] | None = None,
    board: str | None = None,
    only: str | None = None,
) -> ImportedCorners:
    """Read the corners of one camera.

    Args:
        paths: the files, of different photos.
        target: the calibration target.
        image_size: (width, height) of the photos, for files that do not say.
        board: the name of the board in the photos; may be left out of a target of one board.
        only: a glob: only photos whose names match it.

    Raises:
        UsageError: the size of the photos is not known.
        CorrespondenceError: a file cannot be read or does not fit the target or the others; one
            line that names it and, where it is about one corner, where that is.

    """
    index, pattern = _find_board_index(paths[0], target, board), only or "*"
    parts: list[Observations] = []
    left_out, there = 0, set[str]()
    for path in paths:
        part, missing = _choose_reader(path)(path, target, index, image_size, pattern)
        for size in (image_size, *(one.image_size for one in parts)):
            if size not in (None, part.image_size):
                raise CorrespondenceError(
                    "{}: its photos have {}x{} pixels, not {}x{}".format(
                        path, *part.image_size, *size
                    )
                )
        for name in part.images:
            if name in there:
                raise CorrespondenceError(
                    f"{path}: another file holds the corners of {quoted(name)} already: "
                    "leave one of them out"
                )
        there.update(part.images)
        parts.append(part)
        left_out += missing
    joined = Observations.joined(parts)
    wanted = [name for name in joined.images if fnmatchcase(name, pattern)]
    if not wanted:
        raise CorrespondenceError(f"no photo in the files is called like {quoted(pattern)}")
    if not len(joined.image):
        raise CorrespondenceError(f"{paths[0]}: no corner in it is declared as found")
    corners, _ = joined.only_seen()
    empty = tuple(name for name in wanted if name not in corners.images)
    return ImportedCorners(corners=corners, left_out=left_out, empty=empty)


def _choose_reader(path: Path) -> Reader:
    """Return what reads a file, by its first bytes."""
    first = read_bytes(path, max_bytes=MAX_BYTES, error=CorrespondenceError)[:16]
    if first.startswith(b"MATLAB "):
        return read_calib_data
    return read_photonvision if first.lstrip().startswith(b"{") else read_vnlog


def _find_board_index(path: Path, target: Target, name: str | None) -> int:
    """Return the index of the target's board in the files' photos."""
    if name is None and len(target.boards) > 1:
        shown = ", ".join(quoted(name) for name in target.board_names[:8])
        raise CorrespondenceError(
            f"{path}: it is about one board, and which of the target's ({shown}) is not known: "
            "say so with --board NAME"
        )
    return 0 if name is None else target.boards.index(target.board(name))
