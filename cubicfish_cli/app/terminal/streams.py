"""Standard output and error: closed or full, their characters, how wide they are, colours."""

from __future__ import annotations

import io
import os
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Mapping
from typing import Any, Literal, TextIO

import click

Style = Literal["good", "care", "bad", "strong"]

_STYLES: Mapping[Style, Mapping[str, Any]] = {
    "good": {"fg": "green"},
    "care": {"fg": "yellow"},
    "bad": {"fg": "red"},
    "strong": {"bold": True},
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
    """A line broken at blanks, its further lines indented; longer words, as paths, stay whole."""
    return textwrap.fill(
        line,
        columns,
        subsequent_indent=" " * (len(line) - len(line.lstrip()) + 4),
        break_long_words=False,
        break_on_hyphens=False,
    )


# Control, format (which turn the writing about), surrogates, ends of lines and paragraphs.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
ERRORS = "backslashreplace"
"""How characters are written that a stream's encoding lacks."""


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


_STDIN, _STDOUT, _STDERR = 0, 1, 2


class _Talk(io.FileIO):
    """Standard error: what cannot be said is not said."""

    def write(self, data: Any, /) -> int:
        """As a file does, whatever happens."""
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


class _Results(io.FileIO):
    """Standard output: that it cannot be written is an error, once."""

    lost = False

    def write(self, data: Any, /) -> int:
        """As a file does.

        Raises:
            OSError: it cannot be written, for the first time; the error names the stream.

        """
        if self.lost:
            return memoryview(data).nbytes
        try:
            return super().write(data)
        except BrokenPipeError:  # the reader has seen enough
            raise
        except OSError as error:
            self.lost = True
            raise OSError(error.errno, error.strerror, "standard output") from error


def settle_streams() -> None:
    """Open closed streams to nowhere, so that no file takes their place, and guard the others."""
    for descriptor in (_STDIN, _STDOUT, _STDERR):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest number that is free: this one, since those below are open.
            os.open(os.devnull, os.O_RDONLY if descriptor == _STDIN else os.O_WRONLY)
    if sys.stdin is None:
        sys.stdin = io.TextIOWrapper(io.FileIO(_STDIN, closefd=False), encoding="utf-8")
    sys.stdout = _guarded(sys.stdout, _Results, _STDOUT)
    sys.stderr = _guarded(sys.stderr, _Talk, _STDERR)


def _guarded(stream: TextIO | None, kind: type[io.FileIO], descriptor: int) -> TextIO:
    if stream is not None and not isinstance(stream, io.TextIOWrapper):
        return stream  # somebody's own
    if stream is not None and stream.isatty():  # Windows writes to consoles in its own way
        stream.reconfigure(errors=ERRORS)
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(kind(descriptor, "wb", closefd=False)),
        encoding="utf-8" if stream is None else stream.encoding,
        errors=ERRORS,
        newline=None,
        line_buffering=descriptor == _STDERR,
    )
