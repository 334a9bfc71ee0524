"""Options that say how pictures, videos and masks are made, and what photos maps are for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import FloatRange, IntRange
from cubicfish_cli.cli.options import FILE, Parsed, bundle, option, record

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.frames import Crop


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


@record
class RenderingOptions:
    """What the user asked of the pixels."""

    interpolation: str = option(
        "--interpolation",
        "How pixels are read between pixels.",
        click.Choice(["nearest", "linear", "cubic", "lanczos"]),
        "linear",
    )
    border: tuple[float, float, float] = option(
        "--border",
        "What the camera does not see: black, white, grey or #RRGGBB. [default: black]",
        Parsed("COLOUR", _colour),
        (0.0, 0.0, 0.0),
        show_default=False,
    )
    quality: int | None = option(
        "--quality 1-100",
        "Of JPEG and lossy WebP files. [default: the photo's own]",
        IntRange(1, 100),
    )


rendering_options = bundle(RenderingOptions)


@record
class MaskOptions:
    """What the user asked of a mask; None where nothing was asked."""

    mask: Path | None = option(
        "--mask FILE", "Also write where the result may be trusted: 255, and 0 elsewhere.", FILE
    )
    mask_limit: float | None = option(
        "--mask-limit PX",
        "With --mask: 0 also where the camera's own uncertainty is above this, in pixels of the "
        "photo as calibrated.",
        FloatRange(0, min_open=True),
    )


mask_options = bundle(MaskOptions)


@record
class EncodingOptions:
    """What the user asked of a video."""

    codec: str | None = option(
        "--codec NAME",
        "Of videos, as FFmpeg calls it: libx265, libvpx-vp9, ffv1. [default: libx264]",
    )
    crf: int | None = option(
        "--crf 0-63", "Of videos: lower is better and larger. [default: 18]", IntRange(0, 63)
    )
    preset: str | None = option("--preset NAME", "Of the video encoder, such as fast or slow.")


encoding_options = bundle(EncodingOptions)
