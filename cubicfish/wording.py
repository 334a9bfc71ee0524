"""Pieces of error messages: quoting a user's words safely, and suggesting the nearest known one."""

import difflib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

LONGEST_QUOTE = 60
_LONGEST_LINE = 100
_FEW = 3
_MOST_NAMES = 6


def quoted(value: object) -> str:
    """``value`` in quotes on one line: control characters escaped, long text cut short."""
    text = value if isinstance(value, str) else repr(value)
    if len(text) > LONGEST_QUOTE:
        text = text[: LONGEST_QUOTE - 3] + "..."
    return f"'{shown(text)}'"


def shown(path: str | os.PathLike[str]) -> str:
    """A path for a message of one line: control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in os.fspath(path))


def is_name(value: object) -> bool:
    """Whether something is printable text that does not start or end with a blank."""
    return isinstance(value, str) and value.isprintable() and value == value.strip() != ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``did you mean 'x'?`` when a known word is near, else the list of the known words."""
    known = list(known)
    lower = {name.lower(): name for name in reversed(known)}
    near = difflib.get_close_matches(word[:LONGEST_QUOTE].lower(), lower, n=1, cutoff=0.6)
    if near:
        return f"did you mean {quoted(lower[near[0]])}?"
    first = ", ".join(quoted(name)[1:-1] for name in known[:12])
    more = f", and {len(known) - 12} more" if len(known) > 12 else ""
    return f"known: {first}{more}"


def listed(names: Sequence[str], more: str = "", *, word: str = "and") -> str:
    """``a``, ``a and b``, ``a, b and c``; of many the first, and how many more there are.

    Args:
        names: at least one.
        more: what they are, in the plural, such as ``photos``, where not all need to be named.
        word: what stands before the last one.

    """
    if more and len(names) > _MOST_NAMES:
        few = _MOST_NAMES - 2
        names = [*names[:few], f"{len(names) - few} more {more}"]
    return f" {word} ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


class Brief:
    """A dataclass that shows itself in one short line, its arrays by their shapes alone."""

    def __repr__(self) -> str:
        """Its name and its fields, as far as there is room."""
        record: Any = self
        parts = (f"{one.name} {_shorten(getattr(self, one.name))}" for one in fields(record))
        line = f"<{type(self).__name__}: {', '.join(parts)}>"
        return line if len(line) <= _LONGEST_LINE else line[: _LONGEST_LINE - 2] + "…>"


def _shorten(value: object) -> str:
    if hasattr(value, "shape"):
        return "x".join(map(str, value.shape)) or str(value)
    if isinstance(value, tuple | list | Mapping):
        plain = len(value) <= _FEW and all(isinstance(one, str | int | float) for one in value)
        return repr(value) if plain else str(len(value))
    return type(value).__name__ if is_dataclass(value) else repr(value)
