"""What pictures are asked to show beside a view: a plane.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cubicfish_cli.library.asked import StrPath, target_in

if TYPE_CHECKING:
    from cubicfish_cli.target import Target


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """The plane of a board in each photo, squarely from its front.

    Attributes:
        board: the name of one of the target's boards.
        target: the target, or its file.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.
        margin: how far the picture goes on beyond the outer corners, in the target's unit; by
            default a square.

    """

    board: str
    target: Target | StrPath
    pixels_per_unit: float | None = None
    margin: float | None = None

    def loaded(self) -> Target:
        """The target.

        Raises:
            TargetError: its file cannot be used.

        """
        return target_in(self.target)
