"""How simulated pictures look, and how a simulated film is taken.

Nothing is loaded for it, so that a command line can check it before anything is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cubicfish_cli.errors import UsageError

FORMATS = ("jpg", "png")
"""Of photos; the first is the usual one."""
OUTSIDE_LENSES = ("moving-pupil", "mirror", "equisolid", "orthographic")
"""The lenses that :mod:`cubicfish_cli.rendering.outside` makes, by name."""
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

    @property
    def open_s(self) -> float:
        """How long each row is open, seconds."""
        return self.shutter_ms / 1000

    @property
    def readout_s(self) -> float:
        """How long after the first row the last one begins, seconds."""
        return self.readout_ms / 1000
