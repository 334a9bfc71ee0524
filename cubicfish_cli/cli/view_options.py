"""Options that say what a picture shows: a view, the plane of a board, what a rig sees."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import (
    FILE,
    SIZE,
    Parsed,
    bundle,
    option,
    record,
    rig_option,
    target_path,
)
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.wording import either

if TYPE_CHECKING:
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.library.views import PlanesOfPhotos
    from cubicfish_cli.target import Target
    from cubicfish_cli.undistortion.choose import ChosenView, SeenField
    from cubicfish_cli.undistortion.frames import Crop
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


@record
class ViewOptions:
    """What the user asked of the view; None where nothing was asked."""

    kind: str = option(
        "--view KIND",
        f"What the result is: {either(KINDS)}. [default: perspective, in which straight "
        "lines are straight]",
        click.Choice(KINDS),
        "perspective",
        show_default=False,
    )
    size: tuple[int, int] | None = option(
        "--size", "Size of the result. [default: the photo's]", SIZE
    )
    hfov_deg: float | None = option(
        "--hfov --fov DEG",
        "Field of view across the width. [default: perspective keeps the photo's scale "
        "in its middle, up to 120 along the longer side; others take --fit outer]",
        FloatRange(0, 360, min_open=True, unit="degrees"),
    )
    vfov_deg: float | None = option(
        "--vfov DEG",
        "Field of view down the height; with --hfov it sets the height.",
        FloatRange(0, 360, min_open=True, unit="degrees"),
    )
    focal: float | None = option(
        "--focal PX", "Focal length: pixels per radian in the middle.", FloatRange(0.01, 1_000_000)
    )
    fit: float | None = option(
        "--fit inner|outer|SHARE",
        "Field from what the camera sees: no empty pixel, nothing lost, or a share "
        "between (0 to 1).",
        Parsed("inner|outer|SHARE", _share),
    )
    rotate: tuple[float, float, float] = option(
        "--rotate YAW,PITCH,ROLL",
        "Look right, then up, then turn the view clockwise: degrees.",
        Parsed("YAW,PITCH,ROLL", _rotation),
        (0.0, 0.0, 0.0),
        show_default=False,
    )
    layout: str | None = option(
        "--layout",
        "A cube as six pictures or as one. [default: files]",
        click.Choice(["files", "cross"]),
    )

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


view_options = bundle(ViewOptions)


@record
class PlaneOptions:
    """What the user asked of a board's plane; ``board`` is None where nothing was asked."""

    board: str | None = option(
        "--plane BOARD", "The metric picture of a board's plane instead of a view; needs --target."
    )
    target: Path | None = option(
        "-t --target FILE",
        "The calibration target: a target.yaml, or one of Kalibr's target files. Where "
        "one is needed, ./target.yaml stands for it; for --plane.",
        FILE,
    )
    pixels_a_unit: float | None = option(
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

    def check(self, view: ViewOptions) -> None:
        """Refuse what does not go together."""
        if self.board is None:
            if self.pixels_a_unit is not None or self.margin is not None:
                raise click.UsageError("--pixels-per-unit and --margin go with --plane")
            return
        if target_path(self.target) is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")
        if view.is_asked:
            raise click.UsageError(
                "--plane sets size and direction by the board: leave out the view's options, "
                "or choose --pixels-per-unit and --margin"
            )

    def loaded(self) -> Target:
        """The target.

        Raises:
            click.UsageError: none was named, and none is there.
            TargetError: its file cannot be used.

        """
        from cubicfish_cli.target import load_target

        path = target_path(self.target)
        if path is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")
        return load_target(path)

    def views(self, loaded: CameraFile | PointCameraFile, crop: Crop | None) -> PlanesOfPhotos:
        """The board's plane in each photo.

        Raises:
            TargetError: the target is not usable.
            click.UsageError: it has no such board, or the board has no plane.

        """
        from cubicfish_cli.errors import ViewError
        from cubicfish_cli.library.views import PlanesOfPhotos

        target = self.loaded()
        try:
            return PlanesOfPhotos(
                loaded,
                crop,
                target,
                str(self.board),
                pixels_per_unit=self.pixels_a_unit,
                margin=self.margin,
            )
        except ViewError as problem:
            raise click.UsageError(str(problem)) from None


plane_options = bundle(PlaneOptions)


def _ground(text: str) -> tuple[float, float, float]:
    """Height, and pitch and roll in degrees; what is left out is 0."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not 1 <= len(values) <= 3 or not 0 < values[0] < 1e9:
        raise ValueError(f"{text!r} is not HEIGHT,PITCH,ROLL, such as 1200,-10,0")
    height, pitch, roll = (*values, 0.0, 0.0)[:3]
    if not (-90 <= pitch <= 90 and -180 <= roll <= 180):
        raise ValueError(f"{text!r}: PITCH is from -90 to 90, and ROLL from -180 to 180 degrees")
    return height, pitch, roll


@record
class RigOptions:
    """What the user asked of a rig; None where nothing was asked."""

    rig: Path | None = rig_option
    ground: tuple[float, float, float] | None = option(
        "--ground HEIGHT[,PITCH[,ROLL]]",
        "Of a rig: the ground from above. It is HEIGHT below the first camera, which looks "
        "PITCH degrees up (below 0: down) and is rolled ROLL degrees clockwise. With --plane it is "
        "where that board lies.",
        Parsed("HEIGHT[,PITCH[,ROLL]]", _ground),
    )
    shot: str | None = option(
        "--shot NAME",
        "Of a rig, with --plane: the shot of rig.yaml that says where the board lies. "
        "[default: the shot itself]",
    )
    distance: float | None = option(
        "--distance UNITS",
        "Of a rig: how far away things are that the cameras' pictures join at. [default: far away]",
        FloatRange(0, min_open=True),
    )

    @property
    def is_asked(self) -> bool:
        """Whether a rig is meant at all, and options that need one without it are refused.

        Raises:
            click.UsageError: there is such an option and no ``--rig``.

        """
        given = {"--ground": self.ground, "--shot": self.shot, "--distance": self.distance}
        names = [name for name, value in given.items() if value is not None]
        if self.rig is None and names:
            raise click.UsageError(f"{names[0]} goes with --rig: name the rig.yaml")
        return self.rig is not None


rig_options = bundle(RigOptions)
