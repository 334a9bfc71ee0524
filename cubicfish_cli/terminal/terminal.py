"""What the commands say: results to stdout, talk to stderr.

On a terminal lines are broken at blanks and a few words are coloured. Anywhere else a line stays a
line, whatever its length, and plain. ``NO_COLOR`` and ``FORCE_COLOR`` (https://no-color.org,
https://force-color.org) and ``TERM=dumb`` are kept to.

Tables on stdout: where a terminal is narrow, names go on below. Pipes and files get a line a row.
"""

import io
import json
import math
import os
import re
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal, TextIO

import click

from cubicfish_cli.terminal.parameters import verbosity

Style = Literal["good", "care", "bad", "strong"]

_STYLES: Mapping[Style, Mapping[str, Any]] = {
    "good": {"fg": "green"},
    "care": {"fg": "yellow"},
    "bad": {"fg": "red"},
    "strong": {"bold": True},
}
_FEWEST_COLUMNS = 20
_TALK: Mapping[str, Style] = {
    "warning:": "care",
    "note:": "strong",
    "left out:": "care",
    "failed:": "bad",
    "Error:": "bad",
}
_NO_TERMINAL = 100_000
"""Columns of a pipe or a file."""


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


def print_removed(paths: Iterable[Path]) -> None:
    """Say which files of an earlier calibration were removed, a line each."""
    for path in paths:
        print_message(f"removed {path}, which was of an earlier calibration")


def print_next(*lines: str) -> None:
    """Print what to do next, in command lines, unless ``--quiet``."""
    if verbosity() >= 0 and lines:
        result()
        for line, before in zip(lines, ["Next: ", *["      "] * len(lines)], strict=False):
            result(before + line, whole=True)


def apart() -> None:
    """Keep what follows apart from what was said on stderr, where both are on one terminal."""
    if columns_of(sys.stdout) is not None and verbosity() >= 0:
        result()


def print_message(text: str) -> None:
    """Tell the user on stderr, unless ``--quiet``."""
    if verbosity() >= 0:
        _print(text, sys.stderr, _find_talk_mark(text))


def detail(text: str) -> None:
    """Tell the user on stderr, with ``--verbose`` only."""
    if verbosity() > 0:
        _print(text, sys.stderr, _find_talk_mark(text))


def print_always(text: str) -> None:
    """Tell the user on stderr what also ``--quiet`` does not keep back."""
    _print(text, sys.stderr, _find_talk_mark(text))


def print_interrupted() -> None:
    """Answer Ctrl-C, in the place of the ^C that a terminal shows for it."""
    if can_redraw(sys.stderr):
        click.echo("\r\x1b[2K", file=sys.stderr, nl=False, color=True)
    click.echo("Interrupted.", err=True)


class Failure(click.ClickException):
    """The work could not be done: one line, and exit code 1."""

    def show(self, file: Any = None) -> None:
        """Print it, as all that is said."""
        print_always(f"Error: {self.format_message()}")


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object; what is not finite becomes null, since JSON has no NaN."""
    plain = _make_jsonable(value)
    text = json.dumps(plain, allow_nan=False, ensure_ascii=False)
    if safe(as_shown(text, sys.stdout)) != text:  # JSON has escapes of its own
        text = json.dumps(plain, allow_nan=False)
    echo(text, sys.stdout)


def _make_jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _make_jsonable(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_make_jsonable(item) for item in value]
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
    if mark is not None and has_colour(stream):
        words, style = mark
        shown = shown.replace(words, click.style(words, **_STYLES[style]), 1)
    echo(shown, stream)


def _find_talk_mark(text: str) -> tuple[str, Style] | None:
    return next((mark for mark in _TALK.items() if text.startswith(mark[0])), None)


def print_table(
    titles: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    styles: Sequence[Style] = (),
) -> None:
    """Print a table to stdout; columns of numbers, empty cells and dashes are aligned to the right.

    On a terminal what is no number goes on below where it does not fit. In pipes and files each row
    is a line.

    Args:
        titles: of its columns.
        rows: a cell a column.
        styles: of each row's last cell; none for plain ones.

    """
    stream = sys.stdout
    room, colour = columns_of(stream), has_colour(stream)
    texts = [[as_shown(safe(cell), stream) for cell in row] for row in (titles, *rows)]
    if room is None and not colour:  # rich takes as long to load as numpy
        echo("\n".join(_aligned(texts)), stream)
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for title, *cells in zip(*texts, strict=True):
        is_number = all(map(_is_number, cells))
        justify: Literal["left", "right"] = "right" if is_number else "left"
        table.add_column(Text(title), justify=justify, no_wrap=is_number, overflow="fold")
    for cells, style in zip_longest(texts[1:], styles):
        *parts, last = map(Text, cells)
        table.add_row(*parts, Text(last.plain, _STYLES[style]["fg"] if style else ""))
    width = room or _NO_TERMINAL
    console = Console(file=stream, width=width, force_terminal=colour, no_color=not colour)
    with console.capture() as shown:
        console.print(table)
    echo("\n".join(line.rstrip() for line in shown.get().rstrip("\n").split("\n")), stream)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Rows of a table, the first of titles, as lines."""
    columns = []
    for cells in zip(*rows, strict=True):
        widths = [*map(_width, cells)]
        spaces = [" " * (max(widths) - width) for width in widths]
        right = all(map(_is_number, cells[1:]))
        both = zip(cells, spaces, strict=True)
        columns.append([space + cell if right else cell + space for cell, space in both])
    return ("  ".join(row).rstrip() for row in zip(*columns, strict=True))


def _width(cell: str) -> int:
    """How many columns of a terminal a text takes."""
    if cell.isascii():
        return len(cell)
    from rich.cells import cell_len

    return cell_len(cell)


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"-?|-?[0-9][0-9.,]*(e[-+][0-9]+)?", cell) is not None


def columns_of(stream: TextIO) -> int | None:
    """How many columns a stream's terminal has; None where it is none."""
    if not stream.isatty():
        return None
    return max(shutil.get_terminal_size().columns, _FEWEST_COLUMNS)


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


def echo(text: str, stream: TextIO) -> None:
    """Print what is laid out and painted already; what cannot be said on stderr is not said."""
    try:
        click.echo(text, file=stream, color=True if has_colour(stream) else None)
    except BrokenPipeError:  # the reader has seen enough
        raise
    except OSError as error:
        lead_nowhere(stream)
        if stream is sys.stdout:
            raise OSError(error.errno, error.strerror, "standard output") from error


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


def open_closed_streams() -> None:
    """Open closed streams to nowhere, so that no file takes their place."""
    for descriptor in (_STDIN, _STDOUT, _STDERR):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest number that is free: this one, since those below are open.
            os.open(os.devnull, os.O_RDONLY if descriptor == _STDIN else os.O_WRONLY)
    sys.stdin = sys.stdin or os.fdopen(_STDIN, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(_STDOUT, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(_STDERR, "w", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=ERRORS)


def lead_nowhere(stream: TextIO) -> None:
    """Throw away what is written to a stream from now on, which cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
