"""What a page says: a fit's record, and each corner's error computed again from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from cubicfish_cli.core.angles import angle_from_axis
from cubicfish_cli.core.assess.fit_record import FitRecord, PhotoRecord
from cubicfish_cli.core.assess.verdict import photo_verdicts
from cubicfish_cli.core.finding import joined
from cubicfish_cli.core.fit.findings import FieldCells, field_cells
from cubicfish_cli.core.fit.poses import Poses, rotation_from_vector
from cubicfish_cli.core.fit.statistics import rms_px
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.io.calibrated import CameraRecord
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.point import PointCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.placement import best_named
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray, FloatArray
from cubicfish_cli.extensions.advice.enough import summary

REFINED = ("shape", "points")
"""What ``refine_target`` of a fit's record says where the target was fitted too."""
_HINTS = {"--target": "; 'cubicfish report --target FILE' names it"}
# Errors that are worked out again and differ by more than this share are of other corners.
_SAME_RMS = 0.02
_SAME_RMS_PX = 1e-3
_NO_PHOTOS = (
    "Pictures of the photos, and an undistorted one: the photos are not at hand. "
    "'cubicfish report --photos FOLDER' shows them."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorFacts:
    """Every used corner with its error.

    Attributes:
        pairs: the corners.
        residual: (N, 2) projection less pixel, pixels.
        angle_deg: (N,) from the camera's axis; None for a camera without rays.
        cells: the field in squares, and which of them hold corners.

    """

    pairs: Observations
    residual: FloatArray
    angle_deg: FloatArray | None
    cells: FieldCells

    @property
    def length(self) -> FloatArray:
        """(N,) lengths of the residuals, pixels."""
        return np.hypot(self.residual[:, 0], self.residual[:, 1])


@dataclass(frozen=True, kw_only=True)
class Lack:
    """Why there are no corners with their errors.

    Attributes:
        why: in words.
        name_it: the options of commands that name what is missing.

    """

    why: str
    name_it: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Facts:
    """All that a page is made from.

    Attributes:
        known: the camera and its records, and what follows from these.
        told: how each photo stands beside the others, in words, by its name.
        dropped_pixels: photo and (2,) pixel of those dropped corners that are at hand.
        errors: None where the corners or what they are of are not at hand.
        lack: why ``errors`` is None; None where it is not.
        target: the calibration target as fitted; None where it is not at hand.
        files: where each photo is, as far as that is known.
        digests: SHA-256 that a photo's file must have to be shown, where that is known.
        absent: what the page lacks and why, a line each.
        advice: what to photograph next, in a line; None where the corners are not at hand or the
            camera has no rays.

    """

    known: CameraRecord
    told: Mapping[str, str]
    dropped_pixels: tuple[tuple[str, FloatArray], ...]
    errors: ErrorFacts | None
    lack: Lack | None
    target: Target | None
    files: Mapping[str, Path]
    digests: Mapping[str, str]
    absent: tuple[str, ...]
    advice: str | None

    @property
    def camera(self) -> CubicCamera | PointCamera:
        """The camera."""
        return self.known.camera

    @property
    def fit(self) -> FitRecord:
        """How well it fits."""
        return self.known.fit

    @property
    def photos(self) -> tuple[PhotoRecord, ...]:
        """Of the fit, in its order."""
        return self.fit.per_image

    @property
    def units(self) -> str:
        """Unit of lengths; empty where the target is not known."""
        return self.target.units if self.target else ""

    @cached_property
    def outline(self) -> FloatArray:
        """(K, 2) the field within the photo where the camera may be trusted, pixels."""
        # As camera.yaml has it, so that a camera from memory gives the same page as from its file.
        return np.round(self.camera.outline(), 3)


def gather(
    known: CameraRecord,
    *,
    pairs: Observations | None,
    target: Target | None,
    files: Mapping[str, Path],
    digests: Mapping[str, str] | None = None,
    lack: Lack | None = None,
    absent: Sequence[str] = (),
) -> Facts:
    """Put together what a page says.

    Args:
        known: the camera and its records.
        pairs: the corners with the world points of the target as fitted. Those that the fit
            left out may be among them.
        target: the calibration target as fitted.
        files: the photos' files by the photos' names.
        digests: SHA-256 that these files must have, by the photos' names; others are not shown.
        lack: why there are no pairs.
        absent: what else is known to be missing and why, a line each.

    """
    camera, fit = known.camera, known.fit
    told = photo_verdicts(fit.per_image, fit.dropped_corners, camera.image_size)
    lines = [f"Corners and errors: {lack.why}{_HINTS.get(lack.name_it, '')}."] if lack else []
    lines += absent
    errors = None
    pixels: tuple[tuple[str, FloatArray], ...] = ()
    if pairs is not None:
        if target is not None and fit.renamed_images:
            pairs = best_named(pairs, target, partial(_squared, camera, fit))
        errors, problem = _errors(camera, fit, pairs)
        if problem:
            lines.append(f"Corners and errors: {problem}.")
            lack = Lack(why=problem, name_it="--corners and --target")
        pixels = tuple(
            (pairs.images[pairs.image[index]], pairs.pixel[index])
            for index in np.flatnonzero(_among(pairs, fit))
        )
    if fit.per_image and not files:
        lines.append(_NO_PHOTOS)
    return Facts(
        known=known,
        told={photo.image: joined(own) for photo, own in zip(fit.per_image, told, strict=True)},
        dropped_pixels=pixels,
        errors=errors,
        lack=lack,
        target=target,
        files=files,
        digests=digests or {},
        absent=tuple(lines),
        advice=summary(camera, fit, errors.pairs)
        if errors is not None and isinstance(camera, CubicCamera)
        else None,
    )


def _squared(camera: CubicCamera | PointCamera, fit: FitRecord, pairs: Observations) -> FloatArray:
    """(N,) squared errors of corners in photos whose poses are on record, else NaN."""
    squared = np.full(len(pairs.image), np.nan)
    for name, (vector, shift) in fit.poses.items():
        if name in pairs.images:
            rows = np.flatnonzero(pairs.image == pairs.images.index(name))
            points = pairs.world[rows] @ rotation_from_vector(vector[None])[0].T + shift
            squared[rows] = np.sum(
                np.square(camera.project(points, near=True) - pairs.pixel[rows]), axis=1
            )
    return squared


def _errors(
    camera: CubicCamera | PointCamera, fit: FitRecord, pairs: Observations
) -> tuple[ErrorFacts | None, str | None]:
    """Every used corner's error, or why there is none."""
    in_world = isinstance(camera, PointCamera) and camera.frame == "world"
    placed = {photo.image for photo in fit.per_image} if in_world else fit.poses.keys()
    known = np.array([name in placed for name in pairs.images], bool)[pairs.image]
    known &= ~_among(pairs, fit)
    # A corner that may be another one than it is named as had a point of its own in the fit.
    apart = fit.refine_target == "points"
    used, _ = select(pairs, known & pairs.certain if apart else known)
    if not len(used.pixel):
        return None, "no corner at hand is of a photo of this fit"
    points = used.world
    if not in_world:
        vectors, shifts = zip(*(fit.poses[name] for name in used.images), strict=True)
        poses = Poses(rotation=rotation_from_vector(vectors), translation=np.array(shifts))
        points = poses.apply(used.image, used.world)
    residual = camera.project(points, near=True) - used.pixel
    length = np.where(np.isfinite(residual[:, 0]), np.hypot(*residual.T), np.inf)
    kept = np.isfinite(length)
    if isinstance(camera, PointCamera) and 0 < fit.corners < kept.sum():
        # Which corners this fit dropped is not on record: they were the worst.
        kept[np.argsort(length, kind="stable")[fit.corners :]] = False
    if not kept.any():
        return None, "no corner at hand lies where this camera may be trusted"
    used, _ = select(used, kept)
    residual, points = residual[kept], points[kept]
    before, now = fit.rms_px, rms_px(residual)
    if abs(now - before) > max(_SAME_RMS * before, _SAME_RMS_PX):
        return None, (
            f"the corners and the target at hand give an RMS of {now:.3f} px and the fit had "
            f"{before:.3f} px: they are not those of the fit"
            + (
                " (the target was fitted too, and target.refined.yaml holds it)"
                if fit.refine_target in REFINED
                else ""
            )
        )
    angle = None
    if isinstance(camera, CubicCamera):
        angle = np.rad2deg(angle_from_axis(points))
    cells = field_cells(camera, used.pixel)
    return ErrorFacts(pairs=used, residual=residual, angle_deg=angle, cells=cells), None


def _among(pairs: Observations, fit: FitRecord) -> BoolArray:
    """Which pairs are corners that the fit dropped."""
    if not fit.dropped_corners:
        return np.zeros(len(pairs.pixel), bool)
    gone = {(one.image, one.board, one.column, one.row) for one in fit.dropped_corners}
    rows = zip(
        pairs.image.tolist(),
        pairs.board.tolist(),
        pairs.column.tolist(),
        pairs.row.tolist(),
        strict=True,
    )
    names = [*pairs.boards, None]  # of points without a board, whose index is -1
    return np.array([(pairs.images[i], names[b], c, r) in gone for i, b, c, r in rows], bool)
