"""Conversion of a camera to another tool's lens, and its errors."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from cubicfish import (
    Calibration,
    CameraFile,
    CubicfishError,
    FitError,
    UsageError,
    did_you_mean,
    quoted,
)
from cubicfish.fit import Conversion, to_lens
from cubicfish.rigs import RigCamera
from cubicfish.solve import Poses
from cubicfish_cli import __version__
from cubicfish_cli.extension_guard import Place, written_formats
from cubicfish_cli.foreign.file_contents import PlacedLens
from cubicfish_cli.foreign.foreign_files import OWN_FIELD

# Of formats of one tool, the one that follows decentred lenses best.
_NEAREST = {"colmap": "colmap-rad-tan-thin-prism-fisheye", "kalibr": "kalibr-omni"}
_BEHIND_DEG, _BACK_DEG = 90.0, 180.0
MAX_ERROR = 0.5
"""Default bound on how far a lens may be from the camera, pixels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exported(PlacedLens):
    """A camera as a format's lens, alone in its frame.

    Attributes:
        to: the format.
        conversion: the lens, and how near it comes.

    """

    to: str
    conversion: Conversion

    @property
    def text(self) -> str:
        """The text of the format's file."""
        made = written_formats()[self.to]
        text: str = Place(made.extension, made.write).load()(self)
        return text

    def as_record(self) -> dict[str, Any]:
        """Return the lens and its errors, for JSON."""
        return {
            "lens": self.conversion.lens.name,
            **self.conversion.error.as_record(),
            "turned_deg": self.conversion.turned_deg,
            "lens_from_camera": self.conversion.lens_from_camera,
        }

    def warning(self, max_error: float) -> str | None:
        """Return a warning on the field where no corner was; None if the lens is as near there."""
        beyond = self.conversion.error.beyond
        if beyond is None or beyond["max_px"] <= max_error:
            return None
        start = beyond["from_deg"]
        return (
            f"beyond {start:.1f}°, where no corner was, {_write_px(beyond)}: do not rely on it "
            f"there, or leave that out with --max-angle {start:.1f}"
        )


def export_camera(
    calibrated: Calibration | CameraFile | RigCamera,
    to: str,
    *,
    max_error: float = MAX_ERROR,
    max_angle_deg: float | None = None,
) -> Exported:
    """Convert a camera to another tool's lens, as ``cubicfish export`` does.

    Args:
        calibrated: a fit, or what :func:`load_camera` read.
        to: the format: a name of ``cubicfish export --help``, but for ``maps``.
        max_error: the largest distance allowed between lens and camera anywhere that corners
            reached, pixels.
        max_angle_deg: leave out what is farther from the axis, so that the rest fits better.

    Returns:
        ``text`` of the format's file; ``conversion`` with the lens and its ``error``, pixels.

    Raises:
        UsageError: the angle is none.
        FitError: there is no such format, or its lens is farther from the camera than that.

    """
    known = written_formats()
    if to not in known:
        raise FitError(f"no format is called {quoted(to)}: {did_you_mean(to, sorted(known))}")
    if max_angle_deg is not None and not 0 < max_angle_deg <= _BACK_DEG:
        raise UsageError(f"max_angle_deg must be from 0 to {_BACK_DEG:g}, not {max_angle_deg}")
    camera, covered = calibrated.camera, calibrated.fit.covered_deg
    convert = partial(
        to_lens,
        camera,
        Place(known[to].extension, known[to].written[to]["lens"]).load(),
        covered_deg=covered if math.isfinite(covered) else None,
    )
    conversion = convert(max_angle_deg=max_angle_deg)
    if not conversion.error.max_px <= max_error:
        angle = _find_near_angle(convert, conversion, max_error)
        raise FitError(_explain_too_far(conversion, to, max_error, angle))
    trusted = min(max_angle_deg or 180.0, camera.max_angle_deg)
    turn, poses = conversion.lens_from_camera, calibrated.fit.poses
    placed = Poses.of_photos(poses, [*poses])
    return Exported(
        to=to,
        lens=conversion.lens,
        conversion=conversion,
        note=_write_note(conversion, to, calibrated.made_by, trusted),
        poses={}
        if placed is None
        else {
            photo: (turn @ placed.rotation[row], turn @ placed.translation[row])
            for row, photo in enumerate(poses)
        },
    )


def _write_px(figures: Mapping[str, float]) -> str:
    if figures["max_px"] == float("inf"):
        return "the lens does not see all of it"
    return f"RMS {figures['rms_px']:.4f} px, largest {figures['max_px']:.4f} px"


def _write_note(
    conversion: Conversion, name: str, made_by: Mapping[str, Any], trusted_deg: float
) -> list[str]:
    error = conversion.error
    when = f" of {made_by['date']}" if made_by.get("date") else ""
    lines = [
        f"cubicfish {__version__}: the lens nearest to a cubic camera{when}",
        f"conversion error: RMS {error.rms_px:.4f} px, largest {error.max_px:.4f} px, up to "
        f"{error.max_angle_deg:.1f} degrees from the axis",
    ]
    farthest = error.max_angle_deg
    if error.beyond is not None:
        farthest = error.beyond["to_deg"]
        lines.append(
            f"from there to {farthest:.1f} degrees, where no corner was: {_write_px(error.beyond)}"
        )
    lines += [f"{way}: {_write_px(figures)}" for way, figures in error.also.items()]
    lines.append(f"{OWN_FIELD} {trusted_deg:.3f} degrees from the axis")
    reader = written_formats()[name].written[name].get("front_only")
    if farthest >= _BEHIND_DEG and reader is not None:
        lines.append(f"{reader} itself sees nothing at 90 degrees from the axis or more")
    if conversion.turned_deg > 0:
        turn = " ".join(f"{value:.8f}" for value in conversion.lens_from_camera.ravel())
        lines.append(
            f"the frame is turned by {conversion.turned_deg:.3f} degrees; lens_from_camera: {turn}"
        )
    return lines


def _find_near_angle(
    convert: Callable[..., Conversion], conversion: Conversion, max_error: float
) -> int | None:
    """Find an angle, whole degrees, up to which the lens is near enough without the rest.

    In most cases it is the widest one: errors need not grow with the angle, since a lens that
    need not meet the rim may be worse at its own edge.
    """
    near, far = 0, math.ceil(conversion.error.max_angle_deg)
    while far - near > 1:
        angle = (near + far) // 2
        try:
            largest = convert(max_angle_deg=float(angle)).error.max_px
        except CubicfishError:
            largest = math.inf
        if largest <= max_error:
            near = angle
        else:
            far = angle
    return near or None


def _explain_too_far(conversion: Conversion, name: str, max_error: float, angle: int | None) -> str:
    error, ways = conversion.error, []
    if angle is not None:
        ways.append(f"leave the rim out with --max-angle {angle}")
    what = f"does not see all that the camera sees up to {error.max_angle_deg:.0f}°"
    if error.max_px < math.inf:
        ways.append(f"write it all the same with --max-error {_round_up(error.max_px)}")
        what = (
            f"misses the camera by up to {error.max_px:.2f} px (RMS {error.rms_px:.2f} px up to "
            f"{error.max_angle_deg:.0f}°), more than the {max_error:g} px of --max-error"
        )
    others = "mrcal or maps, which hold any lens"
    nearest = _NEAREST.get(name.split("-")[0], name)
    if nearest != name:
        others = f"{nearest}, which comes nearer to most, or to {others}"
    return f"the lens of {name} {what}: {' or '.join([*ways, f'export to {others}'])}"


def _round_up(value: float) -> str:
    """To two digits, and no less: what ``--max-error`` takes is what is written here."""
    scale = 10.0 ** (1 - math.floor(math.log10(value)))
    return f"{math.ceil(value * scale) / scale:g}"


def printed(line: str, *texts: str) -> str:
    """Return a line of the note as it is printed: numbers for programs stay in the written texts.

    They are printed where the format holds no comments, which is where no text has them.
    """
    before, _, matrix = line.partition("; lens_from_camera: ")
    in_file = matrix and any(matrix in text for text in texts)
    return f"{before}: lens_from_camera is in the file" if in_file else line
