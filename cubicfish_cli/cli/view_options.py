"""Options that say what an undistorted picture shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import SIZE, Parsed, bundle, option
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.wording import either

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.choose import ChosenView, SeenField
    from cubicfish_cli.undistortion.view import Camera

KINDS = (
    "perspective",
    "cylindrical",
    "equirectangular",
    "epipolar-cylindrical",
    "epipolar-equirectangular",
    "stereographic",
    "equidistant",
    "cube",
)

# The widest --hfov and --vfov of each, and whether it may be as wide as that or must stay below.
# Known to the views too, which need numpy: a test holds them together.
WIDEST: Mapping[str, tuple[tuple[float, bool], tuple[float, bool]]] = {
    "perspective": ((180, False), (180, False)),
    "cylindrical": ((360, True), (180, False)),
    "equirectangular": ((360, True), (180, True)),
    "epipolar-cylindrical": ((180, False), (360, True)),
    "epipolar-equirectangular": ((180, True), (360, True)),
    "stereographic": ((360, False), (360, False)),
    "equidistant": ((360, True), (360, True)),
}


def _rotation(text: str) -> tuple[float, float, float]:
    """Yaw, pitch and roll in degrees; what is left out is 0."""
    try:
        angles = [float(part) for part in text.split(",")]
    except ValueError:
        angles = []
    if not 1 <= len(angles) <= 3 or not all(-360 <= angle <= 360 for angle in angles):
        raise ValueError(f"{text!r} is not yaw,pitch,roll in degrees, such as -60,0,0")
    yaw, pitch, roll = (*angles, 0.0, 0.0)[:3]
    return yaw, pitch, roll


def _share(text: str) -> float:
    """``inner``, ``outer`` or a share between them -> 0 to 1."""
    try:
        share = float({"inner": "0", "outer": "1"}.get(text, text))
    except ValueError:
        share = -1.0
    if not 0 <= share <= 1:
        raise ValueError(f"{text!r} is not 'inner', 'outer' or a share from 0 to 1")
    return share


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """What the user asked of the view; None where nothing was asked."""

    kind: str
    size: tuple[int, int] | None
    hfov_deg: float | None
    vfov_deg: float | None
    focal: float | None
    fit: float | None
    rotate: tuple[float, float, float]
    layout: str | None

    def __post_init__(self) -> None:
        given = {
            "--hfov": self.hfov_deg,
            "--vfov": self.vfov_deg,
            "--focal": self.focal,
            "--fit": self.fit,
        }
        names = [name for name, value in given.items() if value is not None]
        if self.kind == "cube":
            if names:
                raise click.UsageError(
                    f"the faces of a cube have 90° each: leave out {names[0]}, or choose --size"
                )
            if self.size and self.layout != "cross" and self.size[0] != self.size[1]:
                raise click.UsageError("a cube's faces are square: give --size as NxN")
        elif self.layout is not None:
            raise click.UsageError("--layout is for --view cube")
        if len(names) > 1 and (set(names) != {"--hfov", "--vfov"} or self.size is not None):
            raise click.UsageError(
                f"{' and '.join(names)}{' and --size' * (set(names) == {'--hfov', '--vfov'})} "
                "say the same thing twice: leave one out"
            )
        for axis, name in enumerate(("--hfov", "--vfov")):
            angle = given[name]
            if angle is not None and not _shows(self.kind, axis, angle):
                raise click.UsageError(_too_wide(self.kind, axis, f"{name} {angle:g}", angle))

    @property
    def is_asked(self) -> bool:
        """Whether anything was asked at all."""
        asked = (self.size, self.hfov_deg, self.vfov_deg, self.focal, self.fit, self.layout)
        return self.kind != "perspective" or any(self.rotate) or asked != (None,) * len(asked)

    @property
    def leaves_field_open(self) -> bool:
        """Whether neither size nor field were asked."""
        asked = (self.size, self.hfov_deg, self.vfov_deg, self.focal, self.fit)
        return asked == (None,) * len(asked)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the pictures that a photo becomes; one without a name unless it is a cube."""
        if self.kind == "cube" and self.layout != "cross":
            from cubicfish_cli.undistortion.cube import FACES

            return tuple(FACES)
        return ("",)

    def chosen(self, camera: Camera) -> ChosenView:
        """The view of this camera.

        Raises:
            ViewError: the view is not one that can be rendered.

        """
        from cubicfish_cli.undistortion.choose import chosen_view

        return chosen_view(
            camera,
            self.kind,
            self.rotate,
            size=self.size,
            cross=self.layout == "cross",
            hfov_deg=self.hfov_deg,
            vfov_deg=self.vfov_deg,
            focal=self.focal,
            share=self.fit,
        )


def say_what_is_unseen(seen: SeenField | None) -> None:
    """Tell the user where the camera's field ends before the view's does."""
    if seen is not None and not seen.is_whole:
        say(f"the camera sees {seen.describe()}: the rest is empty")


def _shows(kind: str, axis: int, angle_deg: float) -> bool:
    limit, closed = WIDEST[kind][axis]
    return angle_deg < limit or (closed and angle_deg == limit)


def _too_wide(kind: str, axis: int, option: str, angle_deg: float) -> str:
    limit, closed = WIDEST[kind][axis]
    most = f"{limit:g}° at most" if closed else f"less than {limit:g}°"
    flat = "about 120 or less, or " * (kind == "perspective")
    view = f"{'an' if kind.startswith('e') else 'a'} {kind} view"
    way = ("across", "down")[axis]
    others = [
        name
        for name in WIDEST
        if _shows(name, axis, angle_deg) and kind.startswith("epi") >= name.startswith("epi")
    ]
    return f"{option} is too wide: {view} shows {most} {way}: choose {flat}--view {either(others)}"


view_options = bundle(
    "view",
    ViewOptions,
    option(
        "--view KIND",
        f"What the result is: {either(KINDS)}. [default: perspective, in which straight "
        "lines are straight]",
        click.Choice(KINDS),
        "perspective",
        show_default=False,
        to="kind",
    ),
    option("--size", "Size of the result. [default: the photo's]", SIZE),
    option(
        "--hfov --fov DEG",
        "Field of view across the width. [default: perspective keeps the photo's scale "
        "in its middle, up to 120 along the longer side; others take --fit outer]",
        FloatRange(0, 360, min_open=True, unit="degrees"),
        to="hfov_deg",
    ),
    option(
        "--vfov DEG",
        "Field of view down the height; with --hfov it sets the height.",
        FloatRange(0, 360, min_open=True, unit="degrees"),
        to="vfov_deg",
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
        Parsed("YAW,PITCH,ROLL", _rotation),
        (0.0, 0.0, 0.0),
        show_default=False,
    ),
    option(
        "--layout",
        "A cube as six pictures or as one. [default: files]",
        click.Choice(["files", "cross"]),
    ),
)
