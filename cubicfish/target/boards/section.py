"""One mapping of a target file: its values by key, each checked when it is read."""

import math
import re
from collections.abc import Callable, Iterable
from typing import Any, NoReturn

import numpy as np

from cubicfish.errors import TargetError
from cubicfish.target.boards.shape import BoardShape
from cubicfish.types import FloatArray
from cubicfish.units import times
from cubicfish.wording import did_you_mean, is_name, quoted

AXES_TOLERANCE = 1e-3
PLACE_KEYS = ("origin", "x_axis", "y_axis")
SHAPE_KEYS = ("bend", "twist", "stretch", "offsets")
_MAX_COUNT = 1000
_MIN_LENGTH, _MAX_LENGTH = 1e-9, 1e9
_MAX_STRETCH = 0.5
# Keys with which other tools count boards, and how target.yaml counts them.
_OTHER_COUNTS = ("squares", "columns", "cols", "rows", "size")
_CORNERS = "say corners: [columns, rows], counted where four squares meet"
_OFFSETS = "a list of [column, row, along x_axis, along y_axis, into the board]"


class Section:
    """One mapping of a target file."""

    def __init__(self, where: str, data: dict[str, Any], units: str = "") -> None:
        """Take the mapping.

        Args:
            where: what messages about its values begin with.
            data: the mapping.
            units: of its lengths.

        """
        self.where = where
        self.data = data
        self.units = units

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

    def checked(self, key: str, value: Any, fits: Callable[[Any], bool], must: str) -> Any:
        """A value that fits; another one is refused, and the message says what it ``must`` be."""
        if not fits(value):
            self.refuse(key, f"must be {must}, not {quoted(value)}")
        return value

    def text(self, key: str, hint: str) -> str:
        """Printable text of at most 100 characters."""
        value = self.required(key, hint)
        if is_number(value):
            self.refuse(key, f"must be text: write it in quotes, {key}: '{value}'")
        if not is_name(value) or len(value) > 100:
            self.refuse(key, "must be text of at most 100 characters, without blanks at its ends")
        return str(value)

    def choice(self, key: str, known: Iterable[str], hint: str) -> str:
        """One of some words."""
        value = self.text(key, hint)
        if value not in (known := tuple(known)):
            self.refuse(key, f"{quoted(value)} is not known: {did_you_mean(value, known)}")
        return value

    def length(self, key: str, hint: str) -> float:
        """A length above zero."""
        value = self.required(key, hint)
        if isinstance(value, str):
            value = self._with_unit(value)
        return float(self.checked(key, value, _is_positive, "a positive, finite number"))

    def _with_unit(self, text: str) -> float | str:
        """A length that says its unit, such as 25mm, in the target's; other text as it is."""
        found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([^\W\d_]+)\s*", text)
        in_units = times(found[2], self.units) if found else None
        return round(float(found[1]) * in_units, 12) if found and in_units else text

    def counts(self, key: str, what: str) -> tuple[int, int]:
        """Numbers along x and along y, two or more each."""
        value = self.required(key, hint=f"[columns, rows], {what}")
        if not isinstance(value, list) or len(value) != 2 or not all(map(_is_whole, value)):
            self.refuse(key, f"must be two whole numbers, [columns, rows], {what}")
        if not all(2 <= n <= _MAX_COUNT for n in value):
            self.refuse(key, f"{value} must both lie within 2 to {_MAX_COUNT} ({what})")
        return value[0], value[1]

    def flag(self, key: str) -> bool:
        """True or false; false where the key is missing."""
        value = self.data.get(key, False)
        return bool(self.checked(key, value, lambda own: isinstance(own, bool), "true or false"))

    def marker_id(self, key: str) -> int:
        """The id of a marker; 0 where the key is missing."""
        return int(self.checked(key, self.data.get(key, 0), _is_id, "a marker's id, 0 or more"))

    def numbers(self, key: str, limit: float) -> FloatArray:
        """Two numbers (2,) within ±limit, along x and along y; zeros where the key is missing."""
        value = self.data.get(key) or [0.0, 0.0]
        if not are_numbers(value, 2, limit):
            self.refuse(key, f"must be two finite numbers, [along x, along y], within ±{limit:g}")
        return np.array(value, float)

    def is_unplaced(self) -> bool:
        """Whether it says ``place: unknown``, and so no origin and no axes.

        Raises:
            TargetError: it says something else, or a place as well.

        """
        if "place" not in self.data:
            return False
        self.choice("place", ["unknown"], hint="unknown")
        for key in PLACE_KEYS:
            if key in self.data:
                self.refuse(key, "place: unknown is said too: leave one of them out")
        return True

    def place(self, *, alone: bool) -> dict[str, Any]:
        """Origin and orthonormal axes; a board that is alone lies in the world's z = 0 plane.

        Raises:
            TargetError: they are missing, or no axes of a plane.

        """
        own = {key: self.data[key] for key in PLACE_KEYS if self.data.get(key) is not None}
        hint = (
            "a target of several boards needs origin, x_axis and y_axis for each, or place: unknown"
        )
        if alone:
            hint = "x_axis and y_axis go together"
            flat = {} if own.keys() & {"x_axis", "y_axis"} else _FLAT
            own = {"origin": [0, 0, 0], **flat, **own}
        place = {}
        for key in PLACE_KEYS:
            if key not in own:
                self.required(key, hint)
            if not are_numbers(own[key], 3):
                self.refuse(key, "must be three finite numbers, [x, y, z]")
            place[key] = np.array(own[key], float)
        origin, *axes = place.values()
        for key, axis in zip(PLACE_KEYS[1:], axes, strict=True):
            norm = float(np.linalg.norm(axis))
            if abs(norm - 1) > AXES_TOLERANCE:
                self.refuse(key, f"must have length 1 (to {AXES_TOLERANCE:g}), not {norm:.6g}")
        cosine = float(axes[0] @ axes[1])
        if abs(cosine) > AXES_TOLERANCE:
            angle = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
            self.refuse("y_axis", f"must be at a right angle to x_axis, not at {angle:.2f} degrees")
        # The nearest orthonormal pair: the polar factor, which favours neither axis.
        left, _, right = np.linalg.svd(np.stack(axes), full_matrices=False)
        return dict(zip(PLACE_KEYS, (origin, *(left @ right)), strict=True))

    def shape(self, columns: int, rows: int) -> BoardShape | None:
        """The deformation of a board in a refined target; None without one.

        Raises:
            TargetError: a value is not usable.

        """
        if not any(self.data.get(key) is not None for key in SHAPE_KEYS):
            return None
        entries = self.data.get("offsets") or []
        if not isinstance(entries, list):
            self.refuse("offsets", f"must be {_OFFSETS}")
        offsets = np.zeros((rows, columns, 3))
        for entry in entries:
            fits = are_numbers(entry, 5) and all(map(_is_whole, entry[:2]))
            if not fits or not (0 <= entry[0] < columns and 0 <= entry[1] < rows):
                self.refuse("offsets", f"{quoted(entry)} does not fit: {_OFFSETS}")
            offsets[entry[1], entry[0]] = entry[2:]
        twist = self.data.get("twist", 0.0)
        return BoardShape(
            bend=self.numbers("bend", _MAX_LENGTH),
            twist=float(self.checked("twist", twist, _is_length, "a finite number")),
            stretch=self.numbers("stretch", _MAX_STRETCH),
            offsets=offsets,
        )


_FLAT = {"x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}


def is_number(value: object) -> bool:
    """Whether a value is a number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def are_numbers(value: object, count: int, limit: float = _MAX_LENGTH) -> bool:
    """Whether a value is a list of so many finite numbers within ±limit."""
    return (
        isinstance(value, list)
        and len(value) == count
        and all(is_number(one) and abs(one) <= limit for one in value)
    )


def _is_length(value: Any) -> bool:
    return is_number(value) and abs(value) <= _MAX_LENGTH


def _is_positive(value: Any) -> bool:
    return is_number(value) and _MIN_LENGTH <= value <= _MAX_LENGTH


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_id(value: Any) -> bool:
    return _is_whole(value) and 0 <= value < 1_000_000
