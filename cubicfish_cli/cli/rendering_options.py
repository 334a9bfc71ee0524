"""Options that say how pixels are made, and what photos the maps are for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import bundle

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.images import Rendering

COLOURS = {"black": (0.0, 0.0, 0.0), "white": (1.0, 1.0, 1.0), "grey": (0.5, 0.5, 0.5)}


class ColourType(click.ParamType):
    """``black``, ``white``, ``grey`` or ``#RRGGBB`` -> red, green and blue from 0 to 1."""

    name = "COLOUR"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        """Parse, or fail as a usage error."""
        if isinstance(value, tuple):
            return value
        if value in COLOURS:
            return COLOURS[value]
        if not re.fullmatch(r"#?[0-9A-Fa-f]{6}", value):
            self.fail(f"{value!r} is not {', '.join(COLOURS)} or #RRGGBB", param, ctx)
        red, green, blue = (int(value[-6:][at : at + 2], 16) / 255 for at in (0, 2, 4))
        return red, green, blue


class CropType(click.ParamType):
    """``WIDTHxHEIGHT+X+Y`` -> Crop."""

    name = "WxH+X+Y"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Crop:
        """Parse, or fail as a usage error."""
        if ctx is not None and ctx.resilient_parsing:
            return value  # a shell completes the line: nothing uses it, and numpy takes time
        from cubicfish_cli.errors import ViewError
        from cubicfish_cli.undistortion.frames import parse_crop

        try:
            return parse_crop(str(value))
        except ViewError as error:
            self.fail(str(error), param, ctx)


crop_option = click.option(
    "--crop",
    type=CropType(),
    metavar="WxH+X+Y",
    help="The photos are this part of the calibrated photo (or an exact rescale of it).",
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
    click.option(
        "--interpolation",
        type=click.Choice(["nearest", "linear", "cubic", "lanczos"]),
        default="linear",
        help="How pixels are read between pixels. [default: linear]",
    ),
    click.option(
        "--border",
        type=ColourType(),
        default=(0.0, 0.0, 0.0),
        help="What the camera does not see: black, white, grey or #RRGGBB. [default: black]",
    ),
    click.option(
        "--quality",
        type=IntRange(1, 100),
        metavar="1-100",
        help="Of JPEG and lossy WebP files. [default: the photo's own]",
    ),
)
