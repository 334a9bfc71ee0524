"""Conversion of a camera to another tool's lens, and what it loses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
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
from cubicfish.target import MILLIMETRES
from cubicfish_cli import __version__
from cubicfish_cli.core_table import MAPS
from cubicfish_cli.extension_guard import Place, written_formats
from cubicfish_cli.foreign.file_contents import PlacedLens
from cubicfish_cli.foreign.foreign_files import OWN_FIELD
from cubicfish_cli.inputs.target_source import length_mm
from cubicfish_cli.words import export as words

_FRONT_DEG, _BACK_DEG = 90, 180.0
_MAX_LOSS = 0.5  # px
FAR, BOARDS = "far", "boards"


@dataclass(frozen=True, kw_only=True, eq=False)
class Exported(PlacedLens):
    """A camera as a format's lens, alone in its frame.

    Attributes:
        to: the format.
        conversion: the lens, and how near it comes.
        wish: the camera, and what is wanted of its lens.

    """

    to: str
    conversion: Conversion
    wish: Wish

    @property
    def text(self) -> str:
        """The text of the format's file."""
        made = written_formats()[self.to]
        text: str = Place(made.extension, made.write).load()(self)
        return text

    def as_record(self) -> dict[str, Any]:
        """Return the lens and its errors, for JSON."""
        made = self.conversion
        far = {} if made.distant is None else made.distant.as_record()
        return {
            **self.wish.loss_record(made),
            **({"distant": {key: far[key] for key in ("rms_px", "max_px")}} if far else {}),
            "turned_deg": made.turned_deg,
            "lens_from_camera": made.lens_from_camera,
            "place": made.place,
        }

    @property
    def warning(self) -> str | None:
        """A warning on the field where no corner was; None if the lens is as near there."""
        beyond = self.conversion.error.beyond
        if beyond is None or self.wish.is_near(beyond):
            return None
        return words.beyond_line(beyond)

    def cost(self) -> str:
        """Return what the lens loses, and what loses less, in a line."""
        line = self.wish.cost(self.conversion)
        return f"{line}; {self.wish.alternatives(self.to, self.conversion)}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Wish:
    """A camera, and what is wanted of its lenses.

    Attributes:
        calibrated: a fit, or what :func:`load_camera` read.
        max_error: the largest distance allowed between lens and camera anywhere that corners
            reached, pixels; None where the loss decides.
        max_angle_deg: what is farther from the axis is left out; None for the whole field.
        distance: of things, as :func:`export_camera` takes it; None for each format's own.

    """

    calibrated: Calibration | CameraFile | RigCamera
    max_error: float | None = None
    max_angle_deg: float | None = None
    distance: str | None = None

    @cached_property
    def _made(self) -> dict[tuple[str, float | None, float | None], Conversion]:
        return {}

    def convert(self, to: str, max_angle_deg: float | None) -> Conversion:
        """Convert the camera to the lens of a format that loses least, within an angle."""
        made = written_formats()[to]
        keys, limit = made.written[to], max_angle_deg or _BACK_DEG
        lenses = [keys["lens"]]
        if "front_lens" in keys and min(limit, self.calibrated.camera.max_angle_deg) < _FRONT_DEG:
            lenses.append(keys["front_lens"])
        found = [
            self._convert(Place(made.extension, one), self._find_distance(to), max_angle_deg)
            for one in lenses
        ]
        return min(found, key=lambda one: one.error.rms_px)

    def _convert(
        self, lens: Place, distance: float | None, max_angle_deg: float | None
    ) -> Conversion:
        key = (lens.at, distance, max_angle_deg)  # many formats hold the same lens
        if key not in self._made:
            covered = self.calibrated.fit.covered_deg
            self._made[key] = to_lens(
                self.calibrated.camera,
                lens.load(),
                max_angle_deg=max_angle_deg,
                covered_deg=covered if math.isfinite(covered) else None,
                distance=distance,
            )
        return self._made[key]

    def _find_distance(self, to: str) -> float | None:
        """Return the distance of things, in the camera's unit; None for distant ones."""
        wanted = self.distance or written_formats()[to].written[to].get("distance", FAR)
        if wanted in (FAR, BOARDS):
            pupil = self.calibrated.fit.pupil
            return None if wanted == FAR or pupil is None else pupil.distance
        units = self.calibrated.camera.units
        size = MILLIMETRES.get((units or "").lower())
        if size is None:
            raise UsageError(
                f"the camera's unit of length is not known, so --distance {quoted(wanted)} says "
                f"nothing: write {BOARDS} or {FAR}"
            )
        return length_mm(wanted) / size

    def is_near(self, figures: Mapping[str, float]) -> bool:
        """Return whether a lens of such errors may stand for the camera."""
        if self.max_error is not None or not figures["max_px"] < math.inf:
            return figures["max_px"] <= (self.max_error or 0.0)
        held_out = self.calibrated.fit.held_out_rms_px
        return figures["rms_px"] <= max(_MAX_LOSS, held_out if held_out > 0 else 0.0)

    def bound(self) -> str:
        """Return what the errors of a lens that is refused are more than."""
        if self.max_error is not None:
            return f"the {self.max_error:g} px of --max-error"
        held_out = self.calibrated.fit.held_out_rms_px
        own = f" and this camera's held-out error ({held_out:.3f} px)" if held_out > 0 else ""
        return f"{_MAX_LOSS:g} px RMS{own}"

    def cost(self, conversion: Conversion) -> str:
        """Return what a lens loses, in words."""
        camera, held_out = self.calibrated.camera, self.calibrated.fit.held_out_rms_px
        return words.cost(conversion, held_out, camera.units, bool(camera.pupil_travel))

    def alternatives(self, to: str, conversion: Conversion) -> str:
        """Return what loses less than the lens of a format, in words."""
        return words.alternatives(self._find_nearer(to, conversion), list_exact())

    def _find_nearer(self, to: str, conversion: Conversion) -> tuple[str, float] | None:
        """Return the format of the same tool that loses least, and its loss; None if it is this."""
        losses = {to: conversion.error.rms_px}
        written = written_formats()[to].written
        wanted = {other: (other, self.max_angle_deg) for other in written if other != to}
        if "front_lens" in written[to] and self.max_angle_deg is None:
            front = _FRONT_DEG - 1
            wanted[f"{to} --max-angle {front}"] = (to, float(front))
        for name, (other, angle) in wanted.items():
            try:
                losses[name] = self.convert(other, angle).error.rms_px
            except CubicfishError:  # no lens of that kind is near
                continue
        best = min(losses, key=lambda name: losses[name])
        return None if best == to else (best, losses[best])

    def loss_record(self, conversion: Conversion) -> dict[str, Any]:
        """Return what a lens loses, for JSON."""
        held_out = self.calibrated.fit.held_out_rms_px
        return {
            "lens": conversion.lens.name,
            **conversion.error.as_record(),
            "held_out_rms_px": held_out,
            "times_held_out": conversion.error.rms_px / held_out if held_out > 0 else math.nan,
            "distance": conversion.distance,
        }

    def find_near_angle(self, to: str, conversion: Conversion) -> int | None:
        """Find an angle, whole degrees, up to which the lens is near enough without the rest.

        In most cases it is the widest one: errors need not grow with the angle, since a lens that
        need not meet the rim may be worse at its own edge.
        """
        near, far = 0, math.ceil(conversion.error.max_angle_deg)
        while far - near > 1:
            angle = (near + far) // 2
            try:
                is_near = self.is_near(vars(self.convert(to, float(angle)).error))
            except CubicfishError:
                is_near = False
            near, far = (angle, far) if is_near else (near, angle)
        return near or None


def list_exact() -> Sequence[str]:
    """Return the formats that hold the camera itself."""
    return [*(name for name, made in written_formats().items() if made.exact), MAPS]


def export_camera(
    calibrated: Calibration | CameraFile | RigCamera,
    to: str,
    *,
    max_error: float | None = None,
    max_angle_deg: float | None = None,
    distance: str | None = None,
) -> Exported:
    """Convert a camera to another tool's lens, as ``cubicfish export`` does.

    Args:
        calibrated: a fit, or what :func:`load_camera` read.
        to: the format: a name of ``cubicfish export --help`` that is not exact.
        max_error: the largest distance allowed between lens and camera anywhere that corners
            reached, pixels; by default a lens may lose 0.5 px RMS, or as much as the camera's own
            held-out error.
        max_angle_deg: leave out what is farther from the axis, so that the rest fits better.
        distance: of the things that the lens is for: ``far``, ``boards`` or a length such as
            ``2m``; by default what the format's programs look at.

    Returns:
        ``text`` of the format's file; ``conversion`` with the lens and its ``error``, pixels.

    Raises:
        UsageError: the angle or the distance is none.
        FitError: there is no such format, or its lens is farther from the camera than that.

    """
    known = written_formats()
    if to not in known:
        raise FitError(f"no format is called {quoted(to)}: {did_you_mean(to, sorted(known))}")
    if known[to].exact:
        raise FitError(f"{to} holds the camera itself, and no lens: 'cubicfish export' writes it")
    if max_angle_deg is not None and not 0 < max_angle_deg <= _BACK_DEG:
        raise UsageError(f"max_angle_deg must be from 0 to {_BACK_DEG:g}, not {max_angle_deg}")
    wish = Wish(
        calibrated=calibrated, max_error=max_error, max_angle_deg=max_angle_deg, distance=distance
    )
    conversion = wish.convert(to, max_angle_deg)
    if not wish.is_near(vars(conversion.error)):
        raise FitError(
            words.too_far(
                to,
                conversion,
                wish.bound(),
                angle=wish.find_near_angle(to, conversion),
                others=wish.alternatives(to, conversion),
            )
        )
    poses = calibrated.fit.poses
    placed = Poses.of_photos(poses, [*poses])
    return Exported(
        to=to,
        lens=conversion.lens,
        conversion=conversion,
        wish=wish,
        note=_write_note(wish, to, conversion),
        poses={}
        if placed is None
        else {
            photo: conversion.moved(placed.rotation[row], placed.translation[row])
            for row, photo in enumerate(poses)
        },
    )


def _write_note(wish: Wish, to: str, conversion: Conversion) -> list[str]:
    camera, fit = wish.calibrated.camera, wish.calibrated.fit
    date = wish.calibrated.made_by.get("date")
    trusted = min(wish.max_angle_deg or _BACK_DEG, camera.max_angle_deg)
    lines = [
        f"cubicfish {__version__}: the lens nearest to a cubic camera{f' of {date}' * bool(date)}",
        *words.note_lines(
            conversion,
            camera.units,
            f"{OWN_FIELD} {trusted:.3f} degrees from the axis",
            written_formats()[to].written[to].get("front_only"),
        ),
    ]
    pupil, held_out = fit.pupil, fit.held_out_rms_px
    of_distant = wish.distance is None and conversion.distance is None
    if of_distant and pupil is not None and abs(pupil.rim_px) > held_out:
        lines.append(words.near_line(pupil.rim_px, pupil.distance, pupil.units))
    return lines


def compare_formats(wish: Wish) -> list[tuple[str, Conversion | None]]:
    """Convert a camera to the lens of each format; None where none is near."""
    found: list[tuple[str, Conversion | None]] = []
    for to, made in written_formats().items():
        if not made.exact:
            try:
                found.append((to, wish.convert(to, wish.max_angle_deg)))
            except FitError:
                found.append((to, None))
    return found
