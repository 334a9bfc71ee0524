"""Checks of shape and numbers for arrays that callers hand over."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.errors import CubicfishError
from cubicfish.files.reading import MAX_COORDINATE, MAX_SIDE
from cubicfish.types import BoolArray, FloatArray, IntArray
from cubicfish.wording import is_name, quoted


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Checks of arrays that a caller hands over; each raises the same class of error.

    Attributes:
        error: the class to raise; its text is one line that names the array and its place.

    """

    error: type[CubicfishError]

    def numbers(self, value: npt.ArrayLike, name: str, columns: int) -> FloatArray:
        """Finite real numbers (N, columns), or OpenCV's (N, 1, columns), as float64 (N, columns).

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else, or not within
                ±:data:`~.reading.MAX_COORDINATE`.

        """
        array = self._real(value, name)
        if array.ndim == 3 and array.shape[1:] == (1, columns):  # as OpenCV has its points
            array = array[:, 0]
        if array.ndim != 2 or array.shape[1] != columns:
            raise self.error(f"{name} has the shape {array.shape}, not (N, {columns})")
        bad = np.flatnonzero(~(np.abs(array) <= MAX_COORDINATE).all(axis=1))
        if bad.size:
            what = "is not finite: leave out corners that were not found"
            if np.isfinite(array[bad[0]]).all():
                what = f"is not within ±{MAX_COORDINATE:g}: are the units right?"
            raise self.error(f"{name}, row {bad[0]} {what}")
        return np.array(array, np.float64)  # the caller may change its own

    def column(self, value: npt.ArrayLike, name: str, rows: int) -> npt.NDArray[Any]:
        """Real numbers (rows,), of any type.

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else.

        """
        array = self._real(value, name)
        if array.shape != (rows,):
            raise self.error(f"{name} has the shape {array.shape}, not ({rows},)")
        return array

    def size(self, value: Sequence[int]) -> tuple[int, int]:
        """(width, height), pixels.

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else.

        """
        array = np.asarray(value) if not isinstance(value, str) else np.empty(0)
        if array.shape != (2,) or array.dtype.kind not in "iu" or array.min() < 1:
            raise self.error(
                "image_size must be two whole numbers above 0, (width, height), not "
                f"{quoted(value)}"
            )
        if array.max() > MAX_SIDE:
            raise self.error(f"image_size: a side may have {MAX_SIDE} pixels at most")
        return int(array[0]), int(array[1])

    def names(self, value: Sequence[str], name: str) -> tuple[str, ...]:
        """Printable names, each once.

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else.

        """
        names = () if isinstance(value, str) else tuple(value)
        if not names:
            raise self.error(f"{name} must be a list of names")
        for index, one in enumerate(names):
            if not is_name(one):
                what = f"must be printable text without blanks at its ends, not {quoted(one)}"
                raise self.error(f"{name}[{index}] {what}")
        if len(set(names)) < len(names):
            twice = next(one for index, one in enumerate(names) if one in names[:index])
            raise self.error(f"{name}: {quoted(twice)} is there twice")
        return names

    def flags(self, value: npt.ArrayLike, name: str, rows: int) -> BoolArray:
        """Booleans (rows,).

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else.

        """
        flags = np.asarray(value)
        if flags.shape != (rows,) or flags.dtype != bool:
            raise self.error(f"{name} must hold {rows} times True or False, as many as pixel")
        return flags.copy()

    def index(
        self, value: npt.ArrayLike, name: str, rows: int, least: int, count: int | None = None
    ) -> IntArray:
        """Whole numbers (rows,) from ``least`` on, below ``count`` where it is given.

        Raises:
            CubicfishError: of the class ``error``; ``value`` is something else.

        """
        index = self.column(value, name, rows)
        if (index != np.round(index)).any():
            raise self.error(f"{name} must hold whole numbers, counted from 0")
        if rows and (index.min() < least or (count is not None and index.max() >= count)):
            raise self.error(
                f"{name} must count from 0, and within what it counts: it goes from "
                f"{index.min():g} to {index.max():g}"
            )
        return index.astype(np.intp)

    def _real(self, value: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
        try:
            array = np.asarray(value)
        except ValueError as problem:  # rows of different lengths
            raise self.error(f"{name} is no array: its rows differ in length") from problem
        if array.dtype.kind not in "fiu":
            raise self.error(f"{name} must hold real numbers, not {array.dtype}")
        return array
