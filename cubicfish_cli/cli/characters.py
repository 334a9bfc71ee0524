"""Which characters a terminal gets: none that steer it, and none that it cannot show."""

from __future__ import annotations

import codecs
import unicodedata
from collections.abc import Iterator
from typing import TextIO

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
