"""Options that say what a picture shows (a view, a plane, what a rig sees), and how it is made."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.options import (
    FILE,
    SIZE,
    FloatRange,
    IntRange,
    Parsed,
    bundle,
    option,
    record,
    refuse_given,
    rig_option,
    target_path,
)
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.library.asked_pictures import PlaneOptions
from cubicfish_cli.undistortion.options import KINDS, ViewOptions
from cubicfish_cli.wording import either

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.choose import SeenField


def _three(what: str, text: str) -> tuple[float, ...]:
    """Up to three numbers with commas between them; what is left out is 0."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 3 or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text!r} is not {what}")
    return (*numbers, 0.0, 0.0)[:3]


def _share(text: str) -> float | str:
    """A share, or a word for one."""
    try:
        return float(text)
    except ValueError:
        return text


view_options = bundle(
    ViewOptions,
    option(
        "--view KIND",
        f"What the result is: {either(KINDS)}. [default: perspective, in which straight "
        "lines are straight]",
        click.Choice(KINDS),
    ),
    option("--size", "Size of the result. [default: the photo's]", SIZE),
    option(
        "--hfov --fov DEG",
        "Field of view across the width. [default: perspective keeps the photo's scale "
        "in its middle, up to 120 along the longer side; others take --fit outer]",
        FloatRange(0, 360, min_open=True, unit="degrees"),
    ),
    option(
        "--vfov DEG",
        "Field of view down the height; with --hfov it sets the height.",
        FloatRange(0, 360, min_open=True, unit="degrees"),
    ),
    option(
        "--focal PX", "Focal length: pixels per radian in the middle.", FloatRange(0.01, 1_000_000)
    ),
    option(
        "--fit inner|outer|SHARE",
        "Field from what the camera sees: no empty pixel, nothing lost, or a share "
        "between (0 to 1).",
        Parsed("inner|outer|SHARE", _share),
    ),
    option(
        "--rotate YAW,PITCH,ROLL",
        "Look right, then up, then turn the view clockwise: degrees.",
        Parsed("YAW,PITCH,ROLL", partial(_three, "yaw,pitch,roll in degrees, such as -60,0,0")),
        ViewOptions.rotate_deg,
        show_default=False,
    ),
)


@record
class SceneOptions:
    """What the user asked to be shown, and of a rig; None where nothing was asked."""

    rig: Path | None = rig_option
    distance: float | None = option(
        "--distance UNITS",
        "Of a rig: how far away things are that the cameras' pictures join at. [default: far away]",
        FloatRange(0, min_open=True),
    )
    view: ViewOptions = view_options
    plane: str | None = option(
        "--plane BOARD", "The metric picture of a board's plane instead of a view; needs --target."
    )
    target: Path | None = option(
        "-t --target FILE",
        "The calibration target: a target.yaml, or one of Kalibr's target files. Where "
        "one is needed, ./target.yaml stands for it; for --plane.",
        FILE,
    )
    pixels_per_unit: float | None = option(
        "--pixels-per-unit N",
        "Scale of a plane: pixels per mm, or whatever the target's units are. [default: "
        "the largest that the photo has there]",
        FloatRange(1e-9, 1_000_000_000),
    )
    margin: float | None = option(
        "--margin UNITS",
        "Of a plane: how far it goes on beyond the outer corners. [default: a square]",
        FloatRange(0, 1_000_000),
    )

    def __post_init__(self) -> None:
        if self.rig is None and self.distance is not None:
            raise click.UsageError("--distance goes with --rig: name the rig.yaml")
        if self.plane is None:
            scale = {"--pixels-per-unit": self.pixels_per_unit, "--margin": self.margin}
            given = {name: value is not None for name, value in scale.items()}
            refuse_given("goes with --plane", given)
            return
        if self.rig is not None:
            raise click.UsageError("--plane is for the photos of one camera: leave it out")
        if self.view not in (ViewOptions(), ViewOptions(kind=KINDS[0])):
            raise click.UsageError(
                "--plane sets size and direction: leave out the view's options, or choose "
                "--pixels-per-unit and --margin"
            )
        if target_path(self.target) is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")

    @property
    def shown(self) -> Any:
        """What is to be shown, as the library takes it."""
        scale = {"pixels_per_unit": self.pixels_per_unit, "margin": self.margin}
        target = target_path(self.target)
        if self.plane is not None and target is not None:
            return PlaneOptions(board=self.plane, target=target, **scale)
        return self.view


scene_options = bundle(SceneOptions)


def say_what_is_unseen(seen: SeenField | None) -> None:
    """Tell the user where the camera's field ends before the view's does."""
    if seen is not None and not seen.is_whole:
        say(f"the camera sees {seen.describe()}: the rest is empty")


@record
class RenderingOptions:
    """What the user asked of the pixels."""

    interpolation: str = option(
        "--interpolation",
        "How pixels are read between pixels.",
        click.Choice(["nearest", "linear", "cubic", "lanczos"]),
        "linear",
    )
    quality: int | None = option(
        "--quality 1-100",
        "Of JPEG and lossy WebP files. [default: the photo's own]",
        IntRange(1, 100),
    )


rendering_options = bundle(RenderingOptions)


mask_option = option(
    "--mask FILE", "Also write where the result may be trusted: 255, and 0 elsewhere.", FILE
)

crf_option = option(
    "--crf 0-63", "Of videos: lower is better and larger. [default: 18]", IntRange(0, 63)
)
