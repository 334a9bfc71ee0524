"""The normal equations of a recorded fit, rebuilt to predict what more photos would add.

Also the field over which uncertainty is stated, and the lens as far as a target may be seen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish import CubicCamera, FloatArray, Observations, Target
from cubicfish.angles import angle_from_axis
from cubicfish.fit.cubic_fit import EXPECTED, PriorChoice, fit_cubic
from cubicfish.fit.radial_reference import LOST_PX, radial_near
from cubicfish.fit.uncertainty import common_gauge, corner_noise_px, field_grid
from cubicfish.judge import FitRecord
from cubicfish.models import RadialCamera
from cubicfish.solve.deformable_target import DeformableTarget, NominalTarget
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.solve.statistics import noise_px, weighed
from cubicfish.solve.subset import middle, with_mean_weight_one, world_scale
from cubicfish_cli.extensions.advice.information import Information
from cubicfish_cli.viewpoints.views import Viewpoint, WholeLens

_DECREASE = 1e-7
# For files that do not say how symmetric a lens the prior on P is about: once it was always this.
_OLDER_SPREAD = 0.01
# The prior holds P so far beyond the cone where it may be trusted.
_PRIOR_BEYOND_DEG = 5.0
_OFFSET_SHARE = 1e-4
_BEYOND_DEG = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Knowledge:
    """The fit of a calibration, with its information.

    Attributes:
        camera: the camera of the fit, in the fit's own frame.
        information: of its photos.
        scale: the target's units in one unit of the fit.

    """

    camera: CubicCamera
    information: Information
    scale: float

    def points(self, view: Viewpoint) -> FloatArray:
        """Return (N, 3) visible corners of a view in the camera frame, as far as P is held there.

        In the fit's unit.
        """
        points = view.seen.camera[view.seen.visible] / self.scale
        angle = angle_from_axis(points)
        in_cone: FloatArray = points[
            angle <= np.deg2rad(self.camera.max_angle_deg + _PRIOR_BEYOND_DEG)
        ]
        return in_cone


def recorded_poses(fit: FitRecord, images: Sequence[str]) -> Poses | None:
    """Return camera_from_world of photos from a fit's record; None if one is not on record."""
    if not images or any(name not in fit.poses for name in images):
        return None
    vectors, shifts = zip(*(fit.poses[name] for name in images), strict=True)
    return Poses(rotation=rotation_from_vector(vectors), translation=np.array(shifts))


def know(
    camera: CubicCamera,
    fit: FitRecord,
    pairs: Observations,
    poses: Poses,
    target: Target | None,
) -> Knowledge:
    """Fit a calibration again from where it ended, with the weights that it had.

    Args:
        camera: the camera.
        fit: its record.
        pairs: the pairs that it was fitted to, world points those of the target as fitted.
        poses: camera_from_world of each of ``pairs.images``, in the target's units.
        target: the calibration target as fitted.

    Raises:
        FitError: the pairs and the camera do not belong together.

    """
    scale, origin = world_scale(pairs), middle(pairs)
    pairs = with_mean_weight_one(pairs.with_world((pairs.world - origin) / scale))
    poses, target = poses.of_world(-origin), target and target.moved(-origin)
    poses = replace(poses, translation=poses.translation / scale)
    seen = camera.scaled(1 / scale).project(poses.apply(pairs.image, pairs.world), near=True)
    miss = np.nan_to_num(seen - pairs.pixel, nan=LOST_PX)
    pairs = weighed(pairs, miss)
    reference = radial_near(camera.radial, pairs, poses)
    level, spread = fit.refine_target, None
    world: DeformableTarget | None = None
    if level in ("shape", "points") and target is not None:
        spread = _read_offset_spread(fit, scale) if level == "points" else None
        noise = max(noise_px(miss), 1e-3)
        nominal = NominalTarget(pairs=pairs, target=target, scale=scale)
        world = nominal.free(noise=noise, offset_spread=spread)
    result = fit_cubic(
        reference,
        _read_prior(fit, central=not camera.pupil_travel),
        world=world,
        relative_decrease=_DECREASE,
    )
    return Knowledge(
        camera=replace(
            camera,
            P=result.lens.P,
            max_angle_deg=result.max_angle_deg,
            radial=reference.camera,
            pupil_travel=result.lens.travel * scale,
        ),
        information=Information(
            gauge=common_gauge(result),
            hessian=result.normal.reduced_shared(),
            noise_px=corner_noise_px(result),
        ),
        scale=scale,
    )


def _read_prior(fit: FitRecord, *, central: bool) -> PriorChoice:
    """Return the prior on P; the default of older files if the record has no number."""
    return PriorChoice(
        spread=fit.prior_spread if fit.prior_spread >= 0 else _OLDER_SPREAD,
        weight=fit.prior_weight if fit.prior_weight > 0 else EXPECTED.weight,
        central=central,
    )


def _read_offset_spread(fit: FitRecord, scale: float) -> float:
    """Return the typical offset of a corner, by the record of each board."""
    known = [board.offset_rms for board in fit.departures if board.offset_rms > 0]
    # The record's lengths are of three coordinates.
    return max(float(np.mean(known)) / math.sqrt(3) / scale, 1e-7) if known else _OFFSET_SHARE


def field_rays(camera: CubicCamera, blind: float) -> FloatArray:
    """Return (N, 3) rays over the trusted field, the ones behind camera.yaml's figures.

    Rays within ``blind`` radians of the axis, where the camera sees itself, are left out.
    """
    rays = field_grid(camera, blind)[2].reshape(-1, 3)
    return np.asarray(rays[np.isfinite(rays[:, 0])])


@dataclass(frozen=True, kw_only=True, eq=False)
class _LimitedLens:
    """The radial reference, as far as it may predict where a target would be seen."""

    camera: RadialCamera
    limit: float
    blind: float

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        angle = angle_from_axis(points)
        seen = (angle >= self.blind) & (angle <= self.limit)
        return np.where(seen[..., None], self.camera.project(points), np.nan)

    def unproject(self, pixel: npt.ArrayLike, /) -> FloatArray:
        rays = self.camera.unproject(pixel)
        with np.errstate(invalid="ignore"):
            inside = rays[..., 2] >= np.cos(self.limit)
        return np.where(inside[..., None], rays, np.nan)


def limited_lens(camera: CubicCamera, more_deg: float = 0.0, blind: float = 0.0) -> WholeLens:
    """Return a lens that predicts where a target would be seen, also a little beyond the field.

    It sees nothing within ``blind`` radians of the axis.
    """
    limit = float(np.deg2rad(camera.max_angle_deg + _BEYOND_DEG + more_deg))
    return _LimitedLens(
        camera=camera.radial, limit=min(limit, camera.radial.max_angle), blind=blind
    )
