"""What pictures are asked to show beside a view: a plane, or the ground below a rig.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cubicfish_cli.errors import UsageError
from cubicfish_cli.library.asked import StrPath, target_in

if TYPE_CHECKING:
    from cubicfish_cli.target import Target

_HIGHEST = 1e9


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """The plane of a board in each photo or shot, squarely from its front.

    Attributes:
        board: the name of one of the target's boards.
        target: the target, or its file.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.
        margin: how far the picture goes on beyond the outer corners, in the target's unit; by
            default a square.
        shot: of a rig: the shot of its calibration that says where the board lies; by default the
            shot itself.

    """

    board: str
    target: Target | StrPath
    pixels_per_unit: float | None = None
    margin: float | None = None
    shot: str | None = None

    def loaded(self) -> Target:
        """The target.

        Raises:
            TargetError: its file cannot be used.

        """
        return target_in(self.target)


@dataclass(frozen=True, kw_only=True)
class GroundOptions:
    """The ground below a rig, seen from above.

    Attributes:
        height: of the first camera above it, in the rig's unit.
        pitch_deg: how far up that camera looks; below 0 it looks down.
        roll_deg: how far it is rolled clockwise.
        pixels_per_unit: the picture's scale; by default its longer side is as long as the photos'.
        margin: how far the picture goes on beyond the cameras; by default three heights.

    Raises:
        UsageError: height or angles are beyond what a camera above ground can have.

    """

    height: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    pixels_per_unit: float | None = None
    margin: float | None = None

    def __post_init__(self) -> None:
        level = -90 <= self.pitch_deg <= 90 and -180 <= self.roll_deg <= 180
        if not 0 < self.height < _HIGHEST or not level:
            given = f"{self.height:g},{self.pitch_deg:g},{self.roll_deg:g}"
            raise UsageError(
                "--ground is HEIGHT,PITCH,ROLL: a height above 0, PITCH from -90 to 90 and ROLL "
                f"from -180 to 180 degrees, not {given}"
            )
