"""The families of markers that boards carry, and how their markers are printed."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.types import BoolArray, IntArray
from cubicfish_cli.core.wording import did_you_mean, quoted

if TYPE_CHECKING:
    from cubicfish_cli.core.boards.section import Section


# Number of markers in each family, as cv2.aruco.getPredefinedDictionary has them.
MARKER_DICTIONARIES: dict[str, int] = {
    **{f"DICT_{n}X{n}_{count}": count for n in (4, 5, 6, 7) for count in (50, 100, 250, 1000)},
    "DICT_ARUCO_ORIGINAL": 1024,
    "DICT_ARUCO_MIP_36h12": 250,
    "DICT_APRILTAG_16h5": 30,
    "DICT_APRILTAG_25h9": 35,
    "DICT_APRILTAG_36h10": 2320,
    "DICT_APRILTAG_36h11": 587,
}
TAG_FAMILIES = {
    name.replace("DICT_APRILTAG_", "tag"): name
    for name in MARKER_DICTIONARIES
    if name.startswith("DICT_APRILTAG_")
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Markers:
    """The markers printed on a ``charuco`` or ``aprilgrid`` board.

    Attributes:
        dictionary: name of the marker family as cv2.aruco spells it (``DICT_...``).
        side: side of a marker, in the target's units.
        first: id of the board's first marker.
        count: how many markers the board carries; ids are ``first .. first + count - 1``.
        inverted: whether they are light on dark: on a ``charuco`` board they are in its dark
            squares then.

    """

    dictionary: str
    side: float
    first: int
    count: int
    inverted: bool = False


def alike(dictionary: str) -> list[str]:
    """The dictionaries that begin with the same markers, the smallest first."""
    stem, _, count = dictionary.rpartition("_")
    if not count.isdigit():
        return [dictionary]
    return [one for one in MARKER_DICTIONARIES if one.startswith(f"{stem}_")]


def read_markers(section: Section, dictionary: str, side: float, count: int) -> Markers:
    """The markers of a board that carries ``count``, from its ``first_marker`` on.

    Raises:
        TargetError: the family has too few of them.

    """
    first = section.marker_id("first_marker")
    available = MARKER_DICTIONARIES[dictionary]
    if first + count > available:
        section.refuse(
            "first_marker",
            f"the board carries {count} markers, ids {first} to {first + count - 1}, "
            f"but {dictionary} has only {available}: choose a larger family",
        )
    return Markers(dictionary=dictionary, side=side, first=first, count=count)


def known_family(
    kind: str, name: str, fitting: Collection[str], known: Iterable[str], count: int
) -> str:
    """The family of ``count`` markers that was named for new boards of a type.

    Raises:
        TargetError: it is not among the ``fitting`` ones, or has too few markers.

    """
    if name not in fitting:
        raise TargetError(
            f"--dictionary {quoted(name)} is no family of markers for a board of type {kind}: "
            f"{did_you_mean(name, known)}"
        )
    if MARKER_DICTIONARIES[name] < count:
        raise TargetError(
            f"these boards carry {count} markers, but {name} has only {MARKER_DICTIONARIES[name]}: "
            "take another --dictionary, or larger squares"
        )
    return name


def marker_ink(markers: Markers, ids: IntArray, border: int) -> BoolArray:
    """Which modules of markers are black: ids (N,) -> (N, S, S), as ``cv2.aruco`` prints them.

    ``border`` is the width of the black frame in modules; it is part of S.
    """
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, markers.dictionary))
    side = dictionary.markerSize + 2 * border
    return np.array(
        [
            cv2.aruco.generateImageMarker(dictionary, int(one), side, borderBits=border) == 0
            for one in ids
        ]
    ).reshape(-1, side, side)


def table_ink(
    table: BoolArray, cell: npt.NDArray[Any], module: npt.NDArray[Any], inside: BoolArray
) -> BoolArray:
    """Whether there is ink in modules of cells (..., 2): in a table (rows, columns, S, S) of all.

    False where ``inside`` (...) is; cells and modules may be anything there.
    """
    x, y = np.where(inside[..., None], cell, 0).astype(np.intp).reshape(-1, 2).T
    u, v = np.where(inside[..., None], module, 0).astype(np.intp).reshape(-1, 2).T
    # Rounding may put a position on the last edge one module too far.
    last = table.shape[-1] - 1
    ink = table[y, x, np.minimum(v, last), np.minimum(u, last)]
    return np.asarray(inside & ink.reshape(inside.shape))


def marker_modules(markers: Markers, border: int) -> int:
    """How many modules a marker has along each side, its frame included."""
    return int(marker_ink(markers, np.empty(0, np.intp), border).shape[-1])
