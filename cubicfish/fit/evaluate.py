"""How well a known camera explains pairs: poses refitted, the lens fixed."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.held_out import pose_only_residual
from cubicfish.fit.start import NONE_PLACED, fit_poses
from cubicfish.judge.fit_record import ErrorStatistics, FitRecord, PhotoRecord
from cubicfish.judge.records import plain_record
from cubicfish.judge.uncertainty import PixelUncertainty
from cubicfish.judge.verdict import Verdict, evaluation_verdict
from cubicfish.models.cubic import CubicCamera
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import error_statistics, photo_records
from cubicfish.solve.subset import middle, select, with_mean_weight_one
from cubicfish.target.observations import Observations
from cubicfish.target.placement import best_named
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray
from cubicfish.wording import Brief


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Evaluation(Brief):
    """Reprojection errors of a known camera on pairs.

    Attributes:
        errors: over all corners in the camera's field, none dropped.
        pairs: the pairs that were counted.
        residual: (N, 2) projection less pixel, pixels.
        poses: camera_from_world of each of ``pairs.images``.
        outside: corners beyond the field where the camera may be trusted; not counted.
        unplaced: photos with too few corners to be placed.

    """

    errors: ErrorStatistics
    pairs: Observations
    residual: FloatArray
    poses: Poses
    outside: int
    unplaced: tuple[str, ...]

    @cached_property
    def photos(self) -> tuple[PhotoRecord, ...]:
        """Errors and pose of each of ``pairs.images``."""
        return photo_records(self.pairs, self.residual, self.poses)

    def uncertainty(self, fit: FitRecord) -> PixelUncertainty | None:
        """How uncertain the camera of a fit is at these corners; None where that is not known."""
        return fit.uncertainty.over(self.pairs.pixel)

    def verdict(self, fit: FitRecord) -> Verdict:
        """Judge the camera of a fit by how it does on these photos."""
        size = self.pairs.image_size
        return evaluation_verdict(self.errors, self.uncertainty(fit), fit, size, self.photos)

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            **self.errors.as_record(),
            "images": len(self.pairs.images),
            "outside_field": self.outside,
            "unplaced": list(self.unplaced),
            "per_image": plain_record(self.photos),
        }


def named_as_refined(camera: CubicCamera, pairs: Observations) -> Observations:
    """Name corners as a known camera sees them best.

    A target that looks the same after a turn no longer does so when its corners are refined.
    """
    target = pairs.target
    if target is None or all(board.shape is None for board in target.boards):
        return pairs

    def squared(named: Observations) -> FloatArray:
        """(N,) squared errors with fitted poses; 0 outside the camera's field."""
        squared = np.full(len(named.image), np.inf)
        placed, own, photos = fit_poses(camera.radial, named)
        if placed is not None:
            _, residual, index = pose_only_residual(camera, own, placed.poses)
            rows = np.flatnonzero(np.isin(named.image, photos))
            squared[rows] = 0
            squared[rows[index]] = np.sum(residual**2, axis=1)
        return squared

    return best_named(pairs, target, squared)


@one_blas_thread()
def evaluate(camera: CubicCamera, pairs: Observations) -> Evaluation:
    """Refit the pose of every photo under a fixed camera, and measure the errors that remain.

    Raises:
        FitError: the photos are of another size than the camera's, none of them can be placed,
            or no corner lies in the camera's field.

    """
    if tuple(pairs.image_size) != tuple(camera.image_size):
        raise FitError(
            "the corners are of photos of {}x{} pixels and the camera is for {}x{}: "
            "use photos of the camera's own size".format(*pairs.image_size, *camera.image_size)
        )
    if pairs.target is not None:
        camera = camera.in_units(pairs.target.units)
    pairs = named_as_refined(camera, pairs)
    origin = middle(pairs)
    weight = pairs.weight.mean()
    pairs = with_mean_weight_one(pairs.with_world(pairs.world - origin))
    placed, own, photos = fit_poses(camera.radial, pairs)
    if placed is None:
        raise FitError(NONE_PLACED)
    poses, residual, index = pose_only_residual(camera, own, placed.poses)
    if not index.size:
        raise FitError(
            f"no corner lies within the {camera.max_angle_deg:.0f}° where this camera may be "
            "trusted: check that camera and photos belong together"
        )
    counted, kept = select(own, np.isin(np.arange(len(own.image)), index))
    return Evaluation(
        errors=error_statistics(residual),
        pairs=replace(counted, world=counted.world + origin, weight=counted.weight * weight),
        residual=residual,
        poses=poses[kept].of_world(origin),
        outside=len(own.image) - len(index),
        unplaced=tuple(
            name for photo, name in enumerate(pairs.images) if photo not in set(photos.tolist())
        ),
    )
