"""Standard output and error as they are: characters, how wide, whether they take colours."""

from __future__ import annotations

import codecs
import os
import re
import shutil
import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any, Literal, TextIO

import click

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


# Control, format (which turn the writing about), surrogates, ends of lines and paragraphs.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
# What our own words are made of beyond ASCII, for a terminal or a file without it.
_PLAIN = {
    "°": "deg",
    "²": "^2",
    "–": "-",
    "—": "-",
    "−": "-",
    "×": "x",
    "·": "*",
    "±": "+-",
    "…": "~",
    "→": "->",
    "√": "sqrt",
    "─": "-",
    "Φ": "Phi",
    "θ": "theta",
    "µ": "u",
    "μ": "u",
}
ERRORS = "cubicfish"


def register() -> None:
    """Make :data:`ERRORS` known as a way to write what an encoding lacks, as ASCII."""
    codecs.register_error(ERRORS, _in_ascii)


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    plain = [_PLAIN.get(c) or c.encode("ascii", "backslashreplace").decode() for c in lacking]
    return "".join(plain), error.end


def safe(text: str) -> str:
    """``text`` on one line, with what would steer a terminal escaped, such as ESC."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(repr(c)[1:-1] if unicodedata.category(c) in _STEERING else c for c in text)


def as_shown(text: str, stream: TextIO) -> str:
    """``text`` as the stream's encoding will have it, so that its width is known."""
    if text.isascii():
        return text
    encoding = getattr(stream, "encoding", None) or "utf-8"
    errors = getattr(stream, "errors", None) or "strict"
    try:
        return text.encode(encoding, errors).decode(encoding)
    except (UnicodeError, LookupError):
        return text


def cells(text: str) -> int:
    """How many cells of a terminal a text takes; characters of Chinese and emoji take two."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)


def cut_middle(text: str, most: int, ellipsis: str = "…") -> str:
    """``text`` in at most so many cells, its beginning and its end kept: names differ there."""
    if cells(text) <= most:
        return text
    room = most - cells(ellipsis)
    if room < 2:
        return cut_end(text, most, ellipsis)
    tail = _taken(reversed(text), room // 2)[::-1]
    while tail and cells(tail[0]) == 0:  # a mark whose letter was cut off
        tail = tail[1:]
    return _taken(iter(text), room - cells(tail)) + ellipsis + tail


def cut_end(text: str, most: int, ellipsis: str = "…") -> str:
    """``text`` in at most so many cells, its beginning kept."""
    if cells(text) <= most:
        return text
    return _taken(iter(text), max(0, most - cells(ellipsis))).rstrip() + ellipsis[:most]


def _taken(letters: Iterator[str], most: int) -> str:
    """As many of the letters as go into so many cells."""
    taken, room = [], most
    for letter in letters:
        room -= cells(letter)
        if room < 0:
            break
        taken.append(letter)
    return "".join(taken)
