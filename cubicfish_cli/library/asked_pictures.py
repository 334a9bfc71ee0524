"""What pictures are asked to show beside a view (a plane, the ground), and how simulated ones look.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

from collections.abc import Mapping
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


LOOKS: Mapping[str, tuple[float, float]] = {
    "noise": (0, 100),
    "blur": (0, 50),
    "vignetting": (0, 0.8),
    "exposure": (0.02, 4),
}
FILMS: Mapping[str, tuple[float, float]] = {
    "seconds": (0.1, 3600),
    "rate": (1, 240),
    "shutter_ms": (0, 1000),
    "readout_ms": (0, 1000),
}
"""The least and the most of each, which help shows too."""


def _refuse_beyond(given: object, bounds: Mapping[str, tuple[float, float]]) -> None:
    for name, (least, most) in bounds.items():
        value = getattr(given, name)
        if not least <= value <= most:
            raise UsageError(f"{name} must be from {least:g} to {most:g}, not {value}")


@dataclass(frozen=True, kw_only=True)
class LookOptions:
    """How simulated pictures look, and from where they are taken.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels of 255, at most 100.
        blur: standard deviation of the lens's blur, pixels, at most 50.
        vignetting: share of the light that is lost 90° from the axis, at most 0.8.
        exposure: 1 is a well-lit picture, 0.2 a dark one; 0.02 to 4, and overexposed ones bleed.
        seed: another one gives other poses, other motion and other noise, the same one the same.

    Raises:
        UsageError: one is out of its bounds.

    """

    noise: float = 2.0
    blur: float = 0.7
    vignetting: float = 0.4
    exposure: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        _refuse_beyond(self, LOOKS)


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """A film of a hand that moves a target in front of the camera.

    Attributes:
        seconds: how long it is, 0.1 to 3600.
        rate: frames per second, 1 to 240.
        shutter_ms: for how long each row gathers light, milliseconds up to 1000.
        readout_ms: how long after the first row the last one is read, milliseconds up to 1000;
            0 is a global shutter.

    Raises:
        UsageError: one is out of its bounds.

    """

    seconds: float
    rate: float = 30.0
    shutter_ms: float = 8.0
    readout_ms: float = 15.0

    def __post_init__(self) -> None:
        _refuse_beyond(self, FILMS)
