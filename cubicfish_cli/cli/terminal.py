"""What the commands say: results to stdout, talk to stderr.

On a terminal lines are broken at blanks and a few words are coloured. Anywhere else a line stays a
line, whatever its length, and plain. ``NO_COLOR`` and ``FORCE_COLOR`` (https://no-color.org,
https://force-color.org) and ``TERM=dumb`` are kept to.

Tables on stdout: aligned columns of plain text, fitted to the terminal where there is one.

Where a terminal is too narrow, columns are left out in the order that their author chose and long
cells are cut; what still does not fit is printed row by row, a line a cell. Pipes and files get
every column in full, whatever the width.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TextIO

import click

from cubicfish_cli.cli.options import verbosity
from cubicfish_cli.cli.streams import (
    Style,
    as_shown,
    can_redraw,
    cells,
    columns_of,
    cut_end,
    cut_middle,
    echo,
    painted,
    safe,
    wrapped,
)

_TALK: Mapping[str, Style] = {
    "warning:": "care",
    "note:": "strong",
    "left out:": "care",
    "failed:": "bad",
    "Error:": "bad",
}


def result(text: str = "", *, mark: tuple[str, Style] | None = None, whole: bool = False) -> None:
    """Print lines of the result to stdout.

    Args:
        text: one line or several.
        mark: words to paint where they first are, and how.
        whole: a command line or the like, which can be copied only if it is not broken.

    """
    _print(text, sys.stdout, mark, whole=whole)


def print_wrote(paths: Iterable[Path]) -> None:
    """Print which files were written, a line each."""
    for path in paths:
        result(f"wrote {path}")


def apart() -> None:
    """Keep what follows apart from what was said on stderr, where both are on one terminal."""
    if columns_of(sys.stdout) is not None and verbosity() >= 0:
        result()


def say(text: str) -> None:
    """Tell the user on stderr, unless ``--quiet``."""
    if verbosity() >= 0:
        _print(text, sys.stderr, _talk_mark(text))


def detail(text: str) -> None:
    """Tell the user on stderr, with ``--verbose`` only."""
    if verbosity() > 0:
        _print(text, sys.stderr, _talk_mark(text))


def tell(text: str) -> None:
    """Tell the user on stderr what also ``--quiet`` does not keep back."""
    _print(text, sys.stderr, _talk_mark(text))


def say_interrupted() -> None:
    """Answer Ctrl-C, in the place of the ^C that a terminal shows for it."""
    if can_redraw(sys.stderr):
        click.echo("\r\x1b[2K", file=sys.stderr, nl=False, color=True)
    click.echo("Interrupted.", err=True)


class Failure(click.ClickException):
    """The work could not be done: one line, and exit code 1."""

    def show(self, file: Any = None) -> None:
        """Print it, as all that is said."""
        tell(f"Error: {self.format_message()}")


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object; what is not finite becomes null, since JSON has no NaN."""
    plain = _jsonable(value)
    text = json.dumps(plain, allow_nan=False, ensure_ascii=False)
    if safe(as_shown(text, sys.stdout)) != text:  # JSON has escapes of its own
        text = json.dumps(plain, allow_nan=False)
    click.echo(text)


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return str(value)


def _print(
    text: str, stream: TextIO, mark: tuple[str, Style] | None, *, whole: bool = False
) -> None:
    columns = None if whole else columns_of(stream)
    lines = [safe(line) for line in text.split("\n")]
    if columns is not None:
        lines = [wrapped(line, columns) for line in lines]
    shown = "\n".join(lines)
    if mark is not None:
        words, style = mark
        shown = shown.replace(words, painted(words, style, stream), 1)
    echo(shown, stream)


def _talk_mark(text: str) -> tuple[str, Style] | None:
    for word, style in _TALK.items():
        if text.startswith(word):
            return word, style
    return None


_GAP = "  "
_EMPTY = ("", "-")


@dataclass(frozen=True, kw_only=True)
class Column:
    """What a table knows of a column.

    Attributes:
        title: above it.
        drop: left out where room is short, the highest first; 0 for never.
        least: cells that it may be cut to; 0 for never cut.
        most: cells that it may take on a terminal.
        cut: where it is cut.

    """

    title: str
    drop: int = 0
    least: int = 0
    most: int = 1000
    cut: Literal["middle", "end"] = "middle"


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table.

    Attributes:
        cells: one per column.
        style: of the last cell.
        total: whether it sums up the others; only a terminal shows it.

    """

    cells: Sequence[str]
    style: Style | None = None
    total: bool = False


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table to stdout whose columns all matter alike; names in the first may be cut."""
    columns = [Column(title=title, least=0 if i else 12) for i, title in enumerate(header)]
    print_columns(columns, [Row(cells=row) for row in rows])


def print_columns(given: Sequence[Column | str], rows: Sequence[Row]) -> None:
    """Print a table to stdout.

    Columns whose cells are all numbers (or empty, or a dash) are aligned to the right.

    Args:
        given: its columns, or only their titles.
        rows: its rows, each with one cell a column.

    """
    columns = [Column(title=one) if isinstance(one, str) else one for one in given]
    stream = sys.stdout
    room = columns_of(stream)
    rows = [
        replace(row, cells=[_shown(cell, stream) for cell in row.cells])
        for row in rows
        if room is not None or not row.total
    ]
    kept = fitting(columns, rows, room)
    columns = [columns[i] for i in kept]
    rows = [replace(row, cells=[row.cells[i] for i in kept]) for row in rows]
    widths = _widths(columns, rows, room)
    if room is not None and _taken(widths) > room:
        _print_cards(columns, rows, room, stream)
        return
    right = _numbers([row.cells for row in rows], len(columns))
    titles = Row(cells=[_shown(column.title, stream) for column in columns])
    echo(painted(_line(titles, columns, widths, right, stream), "strong", stream), stream)
    for row in rows:
        if row.total:
            echo(painted(as_shown("─", stream) * _taken(widths), "faint", stream), stream)
        echo(_line(row, columns, widths, right, stream), stream)


def fitting(columns: Sequence[Column], rows: Sequence[Row], room: int | None) -> list[int]:
    """Which columns are kept where there are so many cells; all without a limit."""
    kept = list(range(len(columns)))
    while room is not None:
        own = [columns[i] for i in kept]
        least = [
            min(column.least or width, width)
            for column, width in zip(own, _natural(own, rows, kept), strict=True)
        ]
        droppable = [i for i in kept if columns[i].drop]
        if _taken(least) <= room or not droppable:
            break
        kept.remove(max(droppable, key=lambda i: columns[i].drop))
    return kept


def _natural(columns: Sequence[Column], rows: Sequence[Row], kept: Sequence[int]) -> list[int]:
    return [
        max([cells(column.title), *(cells(safe(row.cells[i])) for row in rows)])
        for column, i in zip(columns, kept, strict=True)
    ]


def _widths(columns: Sequence[Column], rows: Sequence[Row], room: int | None) -> list[int]:
    """The columns' widths: what is left over goes to those that were cut, in their order."""
    natural = _natural(columns, rows, range(len(columns)))
    if room is None:
        return natural
    natural = [
        max(cells(column.title), min(width, column.most)) if column.least else width
        for column, width in zip(columns, natural, strict=True)
    ]
    widths = [
        min(column.least or width, width) for column, width in zip(columns, natural, strict=True)
    ]
    for i, width in enumerate(natural):
        widths[i] += max(0, min(width - widths[i], room - _taken(widths)))
    return widths


def _taken(widths: Sequence[int]) -> int:
    return sum(widths) + len(_GAP) * max(0, len(widths) - 1)


def _line(
    row: Row,
    columns: Sequence[Column],
    widths: Sequence[int],
    right: Sequence[bool],
    stream: TextIO,
) -> str:
    parts = []
    for i, (text, column, width) in enumerate(zip(row.cells, columns, widths, strict=True)):
        cut = cut_middle if column.cut == "middle" else cut_end
        shown = cut(text, width, as_shown("…", stream))
        blank = " " * (width - cells(shown))
        if i == len(columns) - 1:
            shown, blank = painted(shown, row.style, stream), blank if right[i] else ""
        parts.append(blank + shown if right[i] else shown + blank)
    return _GAP.join(parts).rstrip()


def _print_cards(columns: Sequence[Column], rows: Sequence[Row], room: int, stream: TextIO) -> None:
    """Print a row as lines of title and cell, the first cell above them."""
    label = max([cells(column.title) for column in columns[1:]], default=0)
    ellipsis = as_shown("…", stream)
    for row in rows:
        echo(painted(cut_middle(row.cells[0], room, ellipsis), "strong", stream), stream)
        for i, (column, text) in enumerate(zip(columns[1:], row.cells[1:], strict=True)):
            shown = cut_end(text, max(8, room - label - 4), ellipsis)
            if i == len(columns) - 2:
                shown = painted(shown, row.style, stream)
            title = _shown(column.title, stream)
            echo(f"  {title}{' ' * (label - cells(column.title))}  {shown}".rstrip(), stream)


def _shown(text: str, stream: TextIO) -> str:
    return as_shown(safe(text), stream)


def _numbers(rows: Sequence[Sequence[str]], count: int) -> list[bool]:
    return [all(_is_number(row[i]) for row in rows) for i in range(count)]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", ""))
    except ValueError:
        return cell in _EMPTY
    return True
