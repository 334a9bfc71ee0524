"""Points as text, one a line: what ``project`` and ``unproject`` read and print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.wording import quoted

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Points that were read: values (N, columns), and whether a header stood above them."""

    values: npt.NDArray[np.float64]
    has_header: bool


def read_points(path: Path, columns: Sequence[str]) -> Points:
    """Read points of the named columns from a file, or from stdin for ``-``.

    Numbers are separated by commas, semicolons or blanks. A first line that is not numbers is a
    header; blank lines and lines that start with ``#`` are skipped; ``nan`` is a point that
    another step could not compute.

    Raises:
        CorrespondenceError: the file cannot be read or a line does not hold the numbers; the
            text names the file and the line.

    """
    import numpy as np

    name = "stdin" if str(path) == "-" else str(path)
    try:
        with click.open_file(str(path), encoding="utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise CorrespondenceError(f"{name} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise CorrespondenceError(f"{name} is not UTF-8 text: is it the right file?") from error
    has_header = False
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.replace(",", " ").replace(";", " ").split()
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows or has_header:
                raise CorrespondenceError(
                    f"{name}, line {number}: {quoted(line)} does not hold numbers only"
                ) from None
            has_header = True
            continue
        if len(row) != len(columns):
            raise CorrespondenceError(
                f"{name}, line {number}: {len(row)} numbers where {len(columns)} belong: "
                + ", ".join(columns)
            )
        rows.append(row)
    values = np.array(rows, float).reshape(-1, len(columns))
    return Points(values=values, has_header=has_header)


def print_points(points: npt.NDArray[np.float64], columns: Sequence[str] | None) -> None:
    """Print (N, columns) points as CSV to stdout, with a header when ``columns`` are named.

    Numbers are written so that they read back exactly.
    """
    lines = [",".join(columns)] if columns else []
    lines += [",".join(map(repr, row)) for row in points.tolist()]
    if lines:
        click.echo("\n".join(lines))
