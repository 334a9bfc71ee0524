"""Every type of board. A new one is a module beside this one, and a line here.

Nothing heavy is imported here: ``--help`` tells the names.
"""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """A type of board by its names.

    Attributes:
        module: of this folder.
        name: of its class.
        designed: whether ``cubicfish target print`` makes such boards.

    """

    module: str
    name: str
    designed: bool = True


ENTRIES = {
    "checkerboard": Entry("checkerboard", "Checkerboard"),
    "charuco": Entry("charuco", "Charuco"),
    "aprilgrid": Entry("aprilgrid", "AprilGrid"),
    "points": Entry("point_list", "PointList", designed=False),
}
DESIGNED = tuple(kind for kind, entry in ENTRIES.items() if entry.designed)
"""Types of which ``cubicfish target print`` makes boards."""
