"""What pictures are asked to show (a view, a plane, the ground), and how simulated ones look.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cubicfish_cli.errors import UsageError
from cubicfish_cli.library.asked import StrPath, target_in
from cubicfish_cli.undistortion.limits import WIDEST
from cubicfish_cli.wording import did_you_mean, either, quoted

if TYPE_CHECKING:
    from cubicfish_cli.target import Target
    from cubicfish_cli.undistortion.choose import ChosenView, Share
    from cubicfish_cli.undistortion.view import Camera

KINDS = (*WIDEST, "cube")


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """A view of any camera's photos, as the options of ``cubicfish undistort`` ask for it.

    Attributes:
        kind: one of those of :func:`build_view`, or ``cube``; by default ``perspective``, and of a
            rig ``equirectangular``.
        size: (width, height) of the picture or of each face of a cube, pixels.
        hfov_deg, vfov_deg, focal, fit, rotate_deg: as for :func:`build_view`.
        layout: of a cube: six ``files``, or one ``cross``.

    Raises:
        UsageError: something is asked twice, or of a kind that does not have it.

    """

    kind: str | None = None
    size: tuple[int, int] | None = None
    hfov_deg: float | None = None
    vfov_deg: float | None = None
    focal: float | None = None
    fit: Share | None = None
    rotate_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    layout: str | None = None

    def __post_init__(self) -> None:
        kind = self.kind or KINDS[0]
        if kind not in KINDS:
            raise UsageError(f"unknown kind of view {quoted(kind)}: {did_you_mean(kind, KINDS)}")
        given = {
            "--hfov": self.hfov_deg,
            "--vfov": self.vfov_deg,
            "--focal": self.focal,
            "--fit": self.fit,
        }
        names = [name for name, value in given.items() if value is not None]
        if kind == "cube":
            if names:
                raise UsageError(
                    f"the faces of a cube have 90° each: leave out {names[0]}, or choose --size"
                )
            if self.size and self.layout != "cross" and self.size[0] != self.size[1]:
                raise UsageError("a cube's faces are square: give --size as NxN")
        elif self.layout is not None:
            raise UsageError("--layout is for --view cube")
        if len(names) > 1 and (set(names) != {"--hfov", "--vfov"} or self.size is not None):
            raise UsageError(
                f"{' and '.join(names)}{' and --size' * (set(names) == {'--hfov', '--vfov'})} "
                "say the same thing twice: leave one out"
            )
        for axis, angle in enumerate((self.hfov_deg, self.vfov_deg)):
            if angle is not None and not _shows(kind, axis, angle):
                raise UsageError(_too_wide(kind, axis, angle))

    @property
    def leaves_field_open(self) -> bool:
        """Whether neither size nor field were asked."""
        asked = (self.size, self.hfov_deg, self.vfov_deg, self.focal, self.fit)
        return asked == (None,) * len(asked)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the pictures that a photo becomes; one without a name unless it is a cube."""
        if self.kind == "cube" and self.layout != "cross":
            from cubicfish_cli.undistortion.projections import FACES

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
            self.kind or KINDS[0],
            cross=self.layout == "cross",
            size=self.size,
            hfov_deg=self.hfov_deg,
            vfov_deg=self.vfov_deg,
            focal=self.focal,
            fit=self.fit,
            rotate_deg=self.rotate_deg,
        )


def _shows(kind: str, axis: int, angle_deg: float) -> bool:
    limit, closed = WIDEST[kind][axis]
    return angle_deg < limit or (closed and angle_deg == limit)


def _too_wide(kind: str, axis: int, angle_deg: float) -> str:
    limit, closed = WIDEST[kind][axis]
    most = f"{limit:g}° at most" if closed else f"less than {limit:g}°"
    flat = "about 120 or less, or " * (kind == "perspective")
    view = f"{'an' if kind.startswith('e') else 'a'} {kind} view"
    name, way = (("--hfov", "across"), ("--vfov", "down"))[axis]
    others = [
        name
        for name in WIDEST
        if _shows(name, axis, angle_deg) and kind.startswith("epi") >= name.startswith("epi")
    ]
    return (
        f"{name} {angle_deg:g} is too wide: {view} shows {most} {way}: choose {flat}--view "
        f"{either(others)}"
    )


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

    """

    height: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    pixels_per_unit: float | None = None
    margin: float | None = None


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
