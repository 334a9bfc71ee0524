"""Standard output and error as they are: how wide, whether they take colours, lines that fit."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Mapping
from typing import Any, Literal, TextIO

import click

from cubicfish_cli.cli.characters import cells

Style = Literal["good", "care", "bad", "strong", "faint"]

_STYLES: Mapping[Style, Mapping[str, Any]] = {
    "good": {"fg": "green"},
    "care": {"fg": "yellow"},
    "bad": {"fg": "red"},
    "strong": {"bold": True},
    "faint": {"dim": True},
}
_FEWEST_COLUMNS = 20


def columns_of(stream: TextIO) -> int | None:
    """How many columns a stream's terminal has; None where it is none."""
    if not stream.isatty():
        return None
    try:
        columns = int(os.environ["COLUMNS"])
    except (KeyError, ValueError):
        try:
            columns = os.get_terminal_size(stream.fileno()).columns
        except (OSError, ValueError):
            columns = 0
    return max(columns, _FEWEST_COLUMNS) if columns > 0 else shutil.get_terminal_size().columns


def text_width(most: int) -> int:
    """How wide paragraphs on stdout may be: as its terminal is, and at most so many cells."""
    columns = columns_of(sys.stdout)
    return most if columns is None else min(most, columns)


def can_redraw(stream: TextIO) -> bool:
    """Whether a stream is a terminal that can wipe a line and write it anew."""
    return stream.isatty() and os.environ.get("TERM", "").lower() not in ("dumb", "unknown", "")


def has_colour(stream: TextIO) -> bool:
    """Whether words may be painted."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return can_redraw(stream)


def painted(text: str, style: Style | None, stream: TextIO) -> str:
    """``text`` in a style, where the stream takes any."""
    if style is None or not text or not has_colour(stream):
        return text
    return click.style(text, **_STYLES[style])


def echo(text: str, stream: TextIO) -> None:
    """Print what is laid out and painted already."""
    click.echo(text, file=stream, color=True if has_colour(stream) else None)


def wrapped(line: str, columns: int) -> str:
    """A line broken at blanks, its further lines indented.

    Where words stand in columns, two or more blanks apart, further lines begin below the last of
    them, or all of that stands below the others where it would be too narrow. What is longer than
    a line, such as a path, stays whole.
    """
    if cells(line) <= columns:
        return line
    indent = len(line) - len(line.lstrip(" "))
    gaps = [match.end() for match in re.finditer(r"(?<=[^ ]) {2,}", line)]
    head, rest = (line[: gaps[-1]], line[gaps[-1] :]) if gaps else ("", line)
    if gaps and cells(head) <= columns // 2:
        return _filled(head, rest, cells(head), columns)
    if gaps and cells(head.rstrip(" ")) <= columns:
        below = _filled(" " * (indent + 4), rest, indent + 4, columns)
        return f"{head.rstrip(' ')}\n{below}"
    return _filled("", line, indent + 2, columns)


def _filled(row: str, text: str, hang: int, columns: int) -> str:
    """Words after the beginning of a row, and in rows below it."""
    # A number stays with its unit.
    first, *words = re.findall(r" *[^ ]+(?: (?:%|px)(?=[ ,;:.)]|$))?", text) or [""]
    lines, row = [], row + first
    for word in words:
        if cells(row) + cells(word) > columns and hang + cells(word.lstrip(" ")) <= columns:
            lines.append(row)
            row = " " * hang + word.lstrip(" ")
        else:
            row += word
    return "\n".join([*lines, row])
