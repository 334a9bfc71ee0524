"""What the commands say: results to stdout, talk to stderr.

On a terminal lines are broken at blanks and a few words are coloured. Anywhere else a line stays a
line, whatever its length, and plain. ``NO_COLOR`` and ``FORCE_COLOR`` (https://no-color.org,
https://force-color.org) and ``TERM=dumb`` are kept to.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TextIO

import click

from cubicfish_cli.cli.options import verbosity
from cubicfish_cli.cli.streams import (
    Style,
    as_shown,
    can_redraw,
    columns_of,
    echo,
    painted,
    safe,
    wrapped,
)
from cubicfish_cli.cli.table import print_table

__all__ = [
    "Failure",
    "apart",
    "detail",
    "print_json",
    "print_table",
    "print_wrote",
    "result",
    "say",
    "say_interrupted",
    "tell",
]

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
