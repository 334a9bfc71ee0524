"""The families of markers that boards carry."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

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
        DICTIONARIES: name of each marker family -> how many markers it has.
        dictionary: name of the marker family as cv2.aruco spells it (``DICT_...``).
        side: side of a marker, in the target's units.
        first: id of the board's first marker.
        count: how many markers the board carries; ids are ``first .. first + count - 1``.
        inverted: whether they are light on dark: on a ``charuco`` board they are in its dark
            squares then.

    """

    DICTIONARIES: ClassVar[Mapping[str, int]] = MARKER_DICTIONARIES

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


def modules_along(dictionary: str) -> int:
    """How many modules a dictionary's markers have along a side, without their frame."""
    if (square := re.search(r"_(\d)X", dictionary)) is not None:
        return int(square[1])
    bits = re.search(r"_(\d+)h", dictionary)
    return 5 if bits is None else math.isqrt(int(bits[1]))
