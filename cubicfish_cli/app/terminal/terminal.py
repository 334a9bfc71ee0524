"""What the commands say: results to stdout, talk to stderr.

On a terminal lines are broken at blanks and a few words are coloured. Anywhere else a line stays a
line, whatever its length, and plain. ``NO_COLOR`` and ``FORCE_COLOR`` (https://no-color.org,
https://force-color.org) and ``TERM=dumb`` are kept to.

Tables on stdout: where a terminal is too narrow, columns are left out in the order that their
author chose and names go on below. Pipes and files get every column in full, a line a row.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import click

from cubicfish_cli.app.terminal.options import verbosity
from cubicfish_cli.app.terminal.streams import (
    Style,
    as_shown,
    can_redraw,
    cells,
    columns_of,
    echo,
    has_colour,
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


def print_next(*lines: str) -> None:
    """Print what to do next, in command lines, unless ``--quiet``."""
    if verbosity() >= 0:
        result()
        for line, before in zip(lines, ["Next: ", *["      "] * len(lines)], strict=False):
            result(before + line, whole=True)


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
        least: cells that it may be narrowed to, its words on lines below each other; 0 for never.

    """

    title: str
    drop: int = 0
    least: int = 0


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
    """Print a table to stdout whose columns all matter alike; the first may be narrowed."""
    columns = [Column(title=title, least=0 if i else 12) for i, title in enumerate(header)]
    print_columns(columns, [Row(cells=row) for row in rows])


def print_columns(given: Sequence[Column | str], rows: Sequence[Row]) -> None:
    """Print a table to stdout.

    Columns whose cells are all numbers (or empty, or a dash) are aligned to the right. A terminal
    has as many columns as it has room for; pipes and files get all of them, a line a row.

    Args:
        given: its columns, or only their titles.
        rows: its rows, each with one cell a column.

    """
    columns = [Column(title=one) if isinstance(one, str) else one for one in given]
    stream = sys.stdout
    room = columns_of(stream)
    rows = [row for row in rows if room is not None or not row.total]
    texts = [[_shown(cell, stream) for cell in row.cells] for row in rows]
    titles = [_shown(column.title, stream) for column in columns]
    widths = [max(map(cells, column)) for column in zip(titles, *texts, strict=True)]
    right = [all(map(_is_number, column)) for column in zip(*texts, strict=True)] or widths
    if room is None:
        for cell_texts, row in zip([titles, *texts], [None, *rows], strict=True):
            padded = [
                " " * (width - cells(text)) + text
                if to_right
                else text.ljust(len(text) + width - cells(text))
                for text, width, to_right in zip(cell_texts, widths, right, strict=True)
            ]
            style: Style | None = "strong" if row is None else None
            echo(painted(_GAP.join(padded).rstrip(), style, stream), stream)
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, len(_GAP), 0, 0), header_style="bold")
    kept = _kept(columns, widths, room)
    for i in kept:
        table.add_column(
            Text(titles[i]),
            justify="right" if right[i] else "left",
            no_wrap=not columns[i].least,
            overflow="fold",
        )
    for row, own in zip(rows, texts, strict=True):
        parts = [Text(own[i]) for i in kept]
        parts[-1].stylize(_RICH.get(row.style or "", ""))
        table.add_row(*parts, style="bold" if row.total else None)
    colour = has_colour(stream)
    console = Console(file=stream, width=room, force_terminal=colour, no_color=not colour)
    with console.capture() as shown:
        console.print(table)
    echo("\n".join(line.rstrip() for line in shown.get().rstrip("\n").split("\n")), stream)


_RICH = {"good": "green", "care": "yellow", "bad": "red"}


def _kept(columns: Sequence[Column], widths: Sequence[int], room: int) -> list[int]:
    """Which columns are kept where there are so many cells."""
    kept = list(range(len(columns)))
    least = [
        min(column.least or width, width) for column, width in zip(columns, widths, strict=True)
    ]
    while sum(least[i] + len(_GAP) for i in kept) - len(_GAP) > room:
        droppable = [i for i in kept if columns[i].drop]
        if not droppable:
            break
        kept.remove(max(droppable, key=lambda i: columns[i].drop))
    return kept


def _shown(text: str, stream: TextIO) -> str:
    return as_shown(safe(text), stream)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", ""))
    except ValueError:
        return cell in _EMPTY
    return True
