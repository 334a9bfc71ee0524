"""frames.csv: every frame, its measures, and whether it was chosen."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli import __version__
from cubicfish_cli.films.source import Film

NAME = "frames.csv"
COLUMNS = ("film", "time", "sharpness", "motion", "corners", "gain", "chosen", "photo")
_MARK = "# cubicfish frames 1, "
_FIRST_BYTES = 1_000_000


@dataclass(frozen=True, kw_only=True)
class FrameRow:
    """A frame.

    Attributes:
        film: its film's path.
        time: seconds from the film's beginning.
        sharpness, motion: see :mod:`cubicfish_cli.films.measure`.
        corners: how many were found; None where nobody looked.
        gain: what it adds; None where it shows nothing, or nobody looked.
        why_not: why it was not chosen; "" where it was.
        photo: the name of the picture that was written; "" where none was.

    """

    film: str
    time: float
    sharpness: float
    motion: float
    corners: int | None
    gain: float | None
    why_not: str
    photo: str


def write_rows(path: Path, of: Mapping[str, Any], rows: Iterable[FrameRow]) -> None:
    """Write the table to a file that is a temporary one.

    Args:
        path: the file.
        of: what the choice depends on; see :func:`depends_on`.
        rows: every frame.

    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{_MARK}{json.dumps(of)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows:
            writer.writerow(
                (
                    row.film,
                    f"{row.time:.6f}",
                    f"{row.sharpness:.4f}",
                    f"{row.motion:.3f}",
                    "" if row.corners is None else row.corners,
                    "" if row.gain is None else f"{row.gain:.3f}",
                    row.why_not or "yes",
                    row.photo,
                )
            )


def photos_of_table(path: Path) -> list[str]:
    """Names of the pictures that were written beside a table; none where it cannot be read.

    A name that leads out of the folder is no name of a picture.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            if not file.readline(_FIRST_BYTES).startswith(_MARK):
                return []
            names = [row.get("photo") or "" for row in csv.DictReader(file)]
    except (OSError, ValueError, csv.Error):
        return []
    return [name for name in names if name and Path(name).name == name and name.endswith(".png")]


def depends_on(films: Sequence[Film], most: int, target_sha256: str | None) -> dict[str, Any]:
    """What a choice depends on: the films as they are now, how many may be chosen, the target."""
    return {
        "films": [[str(film.path.resolve()), *film.stamp] for film in films],
        "most": most,
        "target": target_sha256,
        "version": __version__,
    }


def is_of(path: Path, of: Mapping[str, Any]) -> bool:
    """Whether a table's choice depended on just this."""
    try:
        with path.open(encoding="utf-8") as file:
            line = file.readline(_FIRST_BYTES)
        return line.startswith(_MARK) and json.loads(line.removeprefix(_MARK)) == of
    except (OSError, ValueError):
        return False
