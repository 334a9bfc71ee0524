"""How simulated pictures look.

Nothing is loaded for it, so that a command line can check it before anything is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cubicfish_cli.core.errors import UsageError

FORMATS = ("jpg", "png")
"""Of photos; the first is the usual one."""
LOOKS: Mapping[str, tuple[float, float]] = {
    "noise": (0, 100),
    "blur": (0, 50),
    "vignetting": (0, 0.8),
    "exposure": (0.02, 4),
}
"""The least and the most of each, which help shows too."""


@dataclass(frozen=True, kw_only=True)
class LookOptions:
    """How simulated pictures look, and from where they are taken.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels of 255, at most 100.
        blur: standard deviation of the lens's blur, pixels, at most 50.
        vignetting: share of the light that is lost 90° from the axis, at most 0.8.
        exposure: 1 is a well-lit picture, 0.2 a dark one; 0.02 to 4, and overexposed ones bleed.
        seed: another one gives other poses and other noise, the same one the same.

    Raises:
        UsageError: one is out of its bounds.

    """

    noise: float = 2.0
    blur: float = 0.7
    vignetting: float = 0.4
    exposure: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (least, most) in LOOKS.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise UsageError(f"{name} must be from {least:g} to {most:g}, not {value}")
