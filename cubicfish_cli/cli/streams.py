"""Standard output and error as they are: how wide, whether they take colours, lines that fit."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from typing import Any, Literal, TextIO

import click

from cubicfish_cli.cli.characters import cells

Style = Literal["good", "care", "bad", "strong", "faint"]

_STYLES: Mapping[Style, Mapping[str, Any]] = {
    "good": {"fg": "green"},
    "care": {"fg": "yellow"},
    "bad": {"fg": "red", "bold": True},
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


def has_colour(stream: TextIO) -> bool:
    """Whether words may be painted."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return stream.isatty() and os.environ.get("TERM", "").lower() not in ("dumb", "unknown")


def painted(text: str, style: Style | None, stream: TextIO) -> str:
    """``text`` in a style, where the stream takes any."""
    if style is None or not text or not has_colour(stream):
        return text
    return click.style(text, **_STYLES[style])


def echo(text: str, stream: TextIO) -> None:
    """Print what is laid out and painted already."""
    click.echo(text, file=stream, color=True if has_colour(stream) else None)


def wrapped(line: str, columns: int) -> str:
    """A line broken at blanks, further lines below its last column of words.

    What is longer than a line, such as a path, stays whole.
    """
    if cells(line) <= columns:
        return line
    words = re.findall(r" *[^ ]+", line)
    indent = len(line) - len(line.lstrip(" "))
    hang = indent + 2
    gaps = [match.end() for match in re.finditer(r"(?<=[^ ]) {2,}", line)]
    if gaps and cells(line[: gaps[-1]]) <= columns // 2:
        hang = cells(line[: gaps[-1]])
    lines, row, used = [], words[0], cells(words[0])
    for word in words[1:]:
        if used + cells(word) > columns:
            lines.append(row)
            row = " " * hang + word.lstrip(" ")
            used = cells(row)
        else:
            row += word
            used += cells(word)
    return "\n".join([*lines, row])
