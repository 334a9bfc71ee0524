"""One mapping of a target file with its line, so that errors can name the place."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NoReturn

import numpy as np

from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.wording import did_you_mean, quoted

MAX_COUNT = 1000
MIN_LENGTH, MAX_LENGTH = 1e-9, 1e9
# How other tools count boards, and how it is done here.
_OTHER_COUNTS = ("squares", "columns", "cols", "rows", "size")
_CORNERS = "say corners: [columns, rows], counted where four squares meet"


class Section:
    """One mapping of a target file: values by key, each checked as it is asked for."""

    def __init__(self, where: str, data: dict[str, Any]) -> None:
        """``where`` stands at the head of what is said about a value."""
        self.where = where
        self.data = data

    def refuse(self, key: str, what: str) -> NoReturn:
        """Refuse the value of a key.

        Raises:
            TargetError: always.

        """
        raise TargetError(f"{self.where}, {key}: {what}")

    def allow_only(self, keys: Iterable[str], owner: str) -> None:
        """Refuse the mapping if it has another key."""
        keys = tuple(keys)
        for key in self.data:
            if key not in keys:
                counts = key in _OTHER_COUNTS and "corners" in keys
                meant = _CORNERS if counts else did_you_mean(key, keys)
                raise TargetError(f"{self.where}: unknown key {quoted(key)} for {owner}: {meant}")

    def required(self, key: str, hint: str) -> Any:
        """The value of a key that must be there."""
        if self.data.get(key) is None:
            raise TargetError(f"{self.where}: {key} is missing: {hint}")
        return self.data[key]

    def text(self, key: str, hint: str) -> str:
        """Printable text of at most 100 characters."""
        value = self.required(key, hint)
        if isinstance(value, int | float) and not isinstance(value, bool):
            self.refuse(key, f"must be text: write it in quotes, {key}: '{value}'")
        if not isinstance(value, str):
            self.refuse(key, "must be text")
        if not value.strip() or value != value.strip():
            self.refuse(key, "must be text that does not start or end with a blank")
        if not value.isprintable() or len(value) > 100:
            self.refuse(key, "must be printable text of at most 100 characters")
        return value

    def choice(self, key: str, known: Iterable[str], hint: str) -> str:
        """One of some words."""
        value = self.text(key, hint)
        if value not in (known := tuple(known)):
            self.refuse(key, f"{quoted(value)} is not known: {did_you_mean(value, known)}")
        return value

    def length(self, key: str, hint: str) -> float:
        """A length above zero."""
        value = self.required(key, hint)
        if not is_number(value) or not MIN_LENGTH <= value <= MAX_LENGTH:
            self.refuse(key, f"must be a positive, finite number, not {quoted(value)}")
        return float(value)

    def number(self, key: str) -> float:
        """A number of the size of a length, 0 where there is none."""
        value = self.data.get(key, 0.0)
        if not is_number(value) or not abs(value) <= MAX_LENGTH:
            self.refuse(key, f"must be a finite number, not {quoted(value)}")
        return float(value)

    def counts(self, key: str, what: str) -> tuple[int, int]:
        """How many along x and along y, two or more of each."""
        value = self.required(key, hint=f"[columns, rows], {what}")
        if not isinstance(value, list) or len(value) != 2 or not all(map(_is_whole, value)):
            self.refuse(key, f"must be two whole numbers, [columns, rows], {what}")
        if not all(2 <= n <= MAX_COUNT for n in value):
            self.refuse(key, f"{value} must both lie within 2 to {MAX_COUNT} ({what})")
        return value[0], value[1]

    def flag(self, key: str) -> bool:
        """True or false, false where nothing is said."""
        value = self.data.get(key, False)
        if not isinstance(value, bool):
            self.refuse(key, f"must be true or false, not {quoted(value)}")
        return value

    def marker_id(self, key: str) -> int:
        """The id of a marker, 0 where there is none."""
        value = self.data.get(key, 0)
        if not _is_whole(value) or not 0 <= value < 1_000_000:
            self.refuse(key, f"must be a marker's id, 0 or more, not {quoted(value)}")
        return int(value)

    def pair(self, key: str, limit: float) -> FloatArray:
        """Two numbers (2,) within ±limit, zeros where there are none."""
        value = self.data.get(key) or [0.0, 0.0]
        if (
            not isinstance(value, list)
            or len(value) != 2
            or not all(is_number(x) and abs(x) <= limit for x in value)
        ):
            self.refuse(key, f"must be two finite numbers, [along x, along y], within ±{limit:g}")
        return np.array(value, float)

    def vector(self, key: str, hint: str) -> FloatArray:
        """Three numbers (3,)."""
        value = self.required(key, hint)
        if not is_point(value):
            self.refuse(key, "must be three finite numbers, [x, y, z]")
        return np.array(value, float)


def is_number(value: object) -> bool:
    """Whether a value is a number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_point(value: object) -> bool:
    """Whether a value is a list of three lengths."""
    return (
        isinstance(value, list)
        and len(value) == 3
        and all(is_number(x) and abs(x) <= MAX_LENGTH for x in value)
    )


def is_place(value: object, count: int) -> bool:
    """Whether a value is a column, or a row, of ``count``."""
    return _is_whole(value) and 0 <= value < count  # type: ignore[operator]


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
