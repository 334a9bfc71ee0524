"""The record of a fit: the one type that the fit, camera.yaml, the verdict and the page share.

Its fields are the keys of ``fit`` in camera.yaml, in their order, but for two of older names. A
figure that is not known is NaN, and an unknown count 0; the file then has null, or no key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np

from cubicfish.files.fingerprint import Fingerprint
from cubicfish.files.reading import MAX_COORDINATE
from cubicfish.judge.finding import Finding
from cubicfish.judge.pupil import PupilEffect
from cubicfish.judge.records import KEY, LEFT_OUT_IF_EMPTY, key_of, plain_record, read_record
from cubicfish.judge.uncertainty import UncertaintyGrid
from cubicfish.types import FloatArray

NAN = math.nan
Lift = Literal["ray", "point"]
# Metadata of fields that only fits of the ``ray`` lift have.
_RAY: dict[str, Any] = {"lift": "ray"}
_POINT: Mapping[str, Any] = {"lift": "point"}


@dataclass(frozen=True, kw_only=True)
class ErrorStatistics:
    """Lengths of reprojection errors, pixels.

    Attributes:
        rms_px: sqrt(mean(dx² + dy²)) over all corners used.
        median_px: the median of the corners' errors.
        p95_px: 95 % of the errors are below this.
        max_px: the largest error.
        corners: how many corners were counted.

    """

    rms_px: float = NAN
    median_px: float = NAN
    p95_px: float = NAN
    max_px: float = NAN
    corners: int = 0

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return dict(plain_record(self))


@dataclass(frozen=True, kw_only=True)
class PoseRecord:
    """camera_from_world of a photo: a rotation vector, radians, and a translation."""

    rotation_vector: tuple[float, ...]
    translation: tuple[float, ...]

    @property
    def vectors(self) -> FloatArray | None:
        """Both vectors, (2, 3); None where they are not a pose."""
        if not len(self.rotation_vector) == len(self.translation) == 3:
            return None
        both = np.array([self.rotation_vector, self.translation])
        return both if bool((np.abs(both) <= MAX_COORDINATE).all()) else None


@dataclass(frozen=True, kw_only=True)
class PhotoRecord:
    """A photo of a fit: its errors, as in :class:`ErrorStatistics`, and its pose.

    Attributes:
        moves_px: how far the camera would move over its field without the photo, RMS, pixels: to
            first order, with all that the fit chose held as it is. None where it is not known.

    """

    image: str = ""
    rms_px: float = NAN
    median_px: float = NAN
    p95_px: float = NAN
    max_px: float = NAN
    corners: int = 0
    moves_px: float | None = field(default=None, metadata=LEFT_OUT_IF_EMPTY)
    camera_from_world: PoseRecord | None = field(default=None, metadata=LEFT_OUT_IF_EMPTY)


@dataclass(frozen=True, kw_only=True)
class DroppedCorner:
    """An outlier: a corner that was left out because its error was far larger than noise."""

    image: str = ""
    board: str | None = None
    column: int = 0
    row: int = 0
    error_px: float = NAN


@dataclass(frozen=True, kw_only=True)
class Departure:
    """How far a fitted board departs from the nominal one, in the target's units.

    Attributes:
        board: its name.
        bend, twist, stretch: as :class:`~cubicfish.target.boards.shape.BoardShape` has them.
        shift: how far the board's middle moved.
        turn_deg: how far the board turned.
        offset_rms: root mean square length of its corners' own offsets.

    """

    board: str = ""
    bend: tuple[float, ...] = ()
    twist: float = NAN
    stretch: tuple[float, ...] = ()
    shift: float = NAN
    turn_deg: float = NAN
    offset_rms: float = NAN


@dataclass(frozen=True, kw_only=True)
class CoverageExtent:
    """How well corners cover the field's rim; pixels are NaN where too few corners lie there.

    Attributes:
        all_around_deg: angle from the axis up to which corners lie in nearly every direction that
            the photo shows.
        rim_coverage: share of the directions in which corners lie near the rim.
        extrapolated_deg: how far the field goes beyond the corners, the median over directions.
        edge_uncertainty_px: one standard deviation of a pixel at the field's edge, the median.
        rim_from_deg: angle from the axis from which on errors count as the rim's.
        rim_rms_px: RMS of the outermost corners, those beyond ``rim_from_deg``.
        middle_rms_px: RMS of the corners within half of that angle.

    """

    all_around_deg: float = NAN
    rim_coverage: float = NAN
    extrapolated_deg: float = NAN
    edge_uncertainty_px: float = NAN
    rim_from_deg: float = NAN
    rim_rms_px: float = NAN
    middle_rms_px: float = NAN


@dataclass(frozen=True, kw_only=True)
class MarkedPoints:
    """Points without names, as people mark them: how exact they are said to be.

    Attributes:
        noise_px: one standard deviation along x and along y, pixels; NaN where nobody said.

    """

    noise_px: float = NAN

    @property
    def usual_px(self) -> float:
        """The RMS distance of such points from where they should be; 0 where nobody knows."""
        return 0.0 if math.isnan(self.noise_px) else math.sqrt(2) * self.noise_px


@dataclass(frozen=True, kw_only=True, repr=False)
class FitRecord(ErrorStatistics):
    """The record of a fit: the errors over all used corners, and everything else that it says.

    Attributes:
        images: how many photos were used.
        held_out_rms_px: RMS on photos that were left out of the fit.
        lift: whether the cubics are of the unit ray or of the point.
        frame: which points a camera of the lift ``point`` takes.
        held_out_folds: number of folds of the cross-validation; 0 without one.
        radial_rms_px: RMS of the radial reference, a Kannala–Brandt lens.
        radial_held_out_rms_px: its RMS on photos that were left out.
        refine_target: how much of the target was fitted.
        held_out_by_level: held-out RMS of every level of ``refine_target`` that was tried.
        renamed_images: photos whose corners were renamed, since they show the target the other way
            round.
        departures: how far each board of the target departs from the nominal one.
        rank: numerical rank of Φ over the used rays (16 on the sphere), or of the points (20).
        plain_rms_px: of the linear solution of the lift ``point``.
        reweighted_rms_px: of its reweighted linear solution.
        covered_deg: angle from the axis of the farthest used corner.
        reach: how well corners cover the field's rim.
        pupil: the effect of the moving entrance pupil.
        flat: whether all corners lie nearly in one plane.
        prior_weight: how firmly P was held to the radial reference.
        prior_spread: how much asymmetry of the lens was expected; 0 for none.
        coverage: share of the field that corners cover, 0 to 1: of where the camera may be trusted
            and does not see itself, as in a mirror.
        findings: what is likely wrong with the set-up, with the evidence.
        uncertainty: how far the pixels of distant points may be off, on a grid over the photo.
        dropped: number of outliers: corners that were left out as grossly wrong.
        dropped_corners: the outliers themselves.
        unfit_images: photos that were left out, with the reason.
        marked: of points without names, how exact they are said to be; None of corners.
        goal_px: the uncertainty that somebody asked for over 95 % of the field, pixels; None where
            nobody did.
        per_image: each photo that was used.

    """

    images: int = 0
    held_out_rms_px: float = NAN
    lift: Lift = field(default="ray", metadata=_POINT)
    frame: str | None = field(default=None, metadata=_POINT)
    held_out_folds: int = field(default=0, metadata=_RAY)
    radial_rms_px: float = field(default=NAN, metadata=_RAY | {KEY: "companion_rms_px"})
    radial_held_out_rms_px: float = field(
        default=NAN, metadata=_RAY | {KEY: "companion_held_out_rms_px"}
    )
    refine_target: Literal["off", "shape", "points"] | None = field(default=None, metadata=_RAY)
    held_out_by_level: Mapping[str, float] = field(default_factory=dict, metadata=_RAY)
    renamed_images: tuple[str, ...] = field(default=(), metadata=_RAY)
    departures: tuple[Departure, ...] = field(default=(), metadata=_RAY)
    rank: int = 0
    plain_rms_px: float = field(default=NAN, metadata=_POINT)
    reweighted_rms_px: float = field(default=NAN, metadata=_POINT)
    covered_deg: float = field(default=NAN, metadata=_RAY)
    reach: CoverageExtent = field(default_factory=CoverageExtent, metadata=_RAY)
    pupil: PupilEffect | None = field(default=None, metadata=_RAY)
    flat: bool = field(default=False, metadata=_RAY)
    prior_weight: float = field(default=NAN, metadata=_RAY)
    prior_spread: float = field(default=NAN, metadata=_RAY)
    coverage: float = field(default=NAN, metadata=_RAY)
    findings: tuple[Finding, ...] = field(default=(), metadata=_RAY)
    uncertainty: UncertaintyGrid = field(default_factory=UncertaintyGrid, metadata=_RAY)
    dropped: int = 0
    dropped_corners: tuple[DroppedCorner, ...] = field(default=(), metadata=_RAY)
    unfit_images: Mapping[str, Finding] = field(default_factory=dict)
    marked: MarkedPoints | None = field(default=None, metadata=LEFT_OUT_IF_EMPTY)
    goal_px: float | None = field(default=None, metadata=LEFT_OUT_IF_EMPTY)
    per_image: tuple[PhotoRecord, ...] = ()

    @classmethod
    def of(cls, value: object) -> FitRecord:
        """Read a record from plain data that may hold anything; what they lack is not known."""
        return read_record(cls, value) or cls()

    @property
    def says_nothing(self) -> bool:
        """Whether nothing is known of the fit, as for an imported camera."""
        return self == FitRecord()

    @cached_property
    def poses(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Rotation vectors (3,) in radians and translations (3,) of camera_from_world, by photo."""
        known = (
            (photo.image, photo.camera_from_world.vectors)
            for photo in self.per_image
            if photo.camera_from_world is not None
        )
        return {image: (both[0], both[1]) for image, both in known if both is not None}

    def as_record(self) -> dict[str, Any]:
        """Plain data: ``fit`` of camera.yaml; null for what is not known."""
        if self.says_nothing:
            return {}
        known: dict[str, Any] = plain_record(self)
        others = {
            key_of(one) for one in fields(self) if one.metadata.get("lift", self.lift) != self.lift
        }
        return {name: value for name, value in known.items() if name not in others}

    def __repr__(self) -> str:
        """The record's figures in one line."""
        if self.says_nothing:
            return "<no fit on record>"
        return f"<fit of {self.corners} corners in {self.images} photos: {self.rms_px:.3f} px RMS>"


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where a calibration comes from, as ``made_by`` of its file says.

    Attributes:
        title: what its owner calls the camera.
        version: version of the program that made the calibration.
        date: when it was made, ISO 8601.
        command: the command that made it.
        options: the command's options.
        target: the calibration target's file.
        inputs: the files of the photos, films or tables.

    """

    title: str | None = None
    version: str | None = None
    date: str | None = None
    command: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    target: Fingerprint | None = None
    inputs: tuple[Fingerprint, ...] = ()

    @classmethod
    def of(cls, made_by: Mapping[str, Any]) -> Origin:
        """Read the origin of a calibration from plain data, which may hold other things too."""
        return read_record(cls, made_by) or cls()

    @property
    def day(self) -> str | None:
        """The date, for people."""
        return self.date.replace("T", " ").replace("+00:00", " UTC") if self.date else None
