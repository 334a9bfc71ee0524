"""Options that say how pixels are made, and what photos the maps are for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import Parsed, bundle, option

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.images import Rendering

COLOURS = {"black": (0.0, 0.0, 0.0), "white": (1.0, 1.0, 1.0), "grey": (0.5, 0.5, 0.5)}


def _colour(text: str) -> tuple[float, float, float]:
    if text in COLOURS:
        return COLOURS[text]
    if not re.fullmatch(r"#?[0-9A-Fa-f]{6}", text):
        raise ValueError(f"{text!r} is not {', '.join(COLOURS)} or #RRGGBB")
    red, green, blue = (int(text[-6:][at : at + 2], 16) / 255 for at in (0, 2, 4))
    return red, green, blue


def _crop(text: str) -> Crop:
    from cubicfish_cli.undistortion.frames import parse_crop

    return parse_crop(text)


crop_option = option(
    "--crop WxH+X+Y",
    "The photos are this part of the calibrated photo (or an exact rescale of it).",
    Parsed("WxH+X+Y", _crop),
)


@dataclass(frozen=True, kw_only=True)
class RenderingOptions:
    """What the user asked of the pixels."""

    interpolation: str
    border: tuple[float, float, float]
    quality: int | None

    def rendering(self) -> Rendering:
        """For the library."""
        from cubicfish_cli.undistortion.images import Rendering

        return Rendering(interpolation=self.interpolation, border=self.border, quality=self.quality)


rendering_options = bundle(
    "pixels",
    RenderingOptions,
    option(
        "--interpolation",
        "How pixels are read between pixels.",
        click.Choice(["nearest", "linear", "cubic", "lanczos"]),
        "linear",
    ),
    option(
        "--border",
        "What the camera does not see: black, white, grey or #RRGGBB. [default: black]",
        Parsed("COLOUR", _colour),
        (0.0, 0.0, 0.0),
        show_default=False,
    ),
    option(
        "--quality 1-100",
        "Of JPEG and lossy WebP files. [default: the photo's own]",
        IntRange(1, 100),
    ),
)
