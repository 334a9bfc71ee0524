"""What a calibration knows about its camera, and what more photos would add.

The fit of a record is fitted again from where it ended: its normal equations hold the information
of its photos on lens and target, and a photo that is not taken yet adds its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.fit.cubic_fit import NEAR_DECREASE, fit_cubic
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.prior import EXPECTED, Prior
from cubicfish.fit.radial_reference import LOST_PX, radial_near
from cubicfish.fit.uncertainty import (
    FarSlopes,
    Gauge,
    Uncertainty,
    common_gauge,
    corner_noise_px,
    covariance,
    field_grid,
    unanchored,
)
from cubicfish.judge.fit_record import FitRecord
from cubicfish.judge.uncertainty import FieldUncertainty, summed
from cubicfish.models.cubic import CubicCamera
from cubicfish.solve.deformable_target import DeformableTarget, NominalTarget
from cubicfish.solve.poses import Poses, cross_matrix
from cubicfish.solve.statistics import noise_px, weighed
from cubicfish.solve.subset import middle, with_mean_weight_one, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

# For files that do not say how symmetric a lens the prior on P is about: once it was always this.
_OLDER_SPREAD = 0.01
# The prior holds P so far beyond the cone where it may be trusted.
_PRIOR_BEYOND_DEG = 5.0
_OFFSET_SHARE = 1e-4
# If the uncertainty of the repeated fit differs by more than this factor, it is another fit.
_SAME = 30.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Knowledge:
    """Information of photos on the unknowns that they share; it adds up, photo by photo.

    Attributes:
        camera: the camera of the fit, in the fit's own frame.
        gauge: the fit's lens, and the projection that removes the common turn.
        hessian: (K, K) of lens and target parameters, priors included and poses, corners and the
            lens that P is held to eliminated; for corners whose noise is one pixel.
        noise_px: standard deviation of a corner's coordinate, pixels.
        scale: the target's units in one unit of the fit.

    """

    camera: CubicCamera
    gauge: Gauge
    hessian: FloatArray
    noise_px: float
    scale: float

    @classmethod
    def of(
        cls,
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
            target: the calibration target as fitted; None for pairs without one.

        Raises:
            FitError: the pairs and the camera do not belong together.

        """
        scale, origin = world_scale(pairs), middle(pairs)
        pairs = with_mean_weight_one(pairs.with_world((pairs.world - origin) / scale))
        poses, target = poses.of_world(-origin), target and target.moved(-origin)
        poses = replace(poses, translation=poses.translation / scale)
        camera = camera.over_corners(fit.covered_deg)
        seen = camera.scaled(1 / scale).project(poses.apply(pairs.image, pairs.world), near=True)
        miss = np.nan_to_num(seen - pairs.pixel, nan=LOST_PX)
        pairs = weighed(pairs, miss)
        reference = radial_near(camera.radial, pairs, poses)
        world: DeformableTarget | None = None
        if fit.refine_target in ("shape", "points") and target is not None:
            spread = _read_offset_spread(fit, scale) if fit.refine_target == "points" else None
            noise = max(noise_px(miss), 1e-3)
            nominal = NominalTarget(pairs=pairs, target=target, scale=scale)
            world = nominal.free(noise=noise, offset_spread=spread)
        result = fit_cubic(
            reference,
            _read_prior(fit, central=not camera.pupil_travel),
            world=world,
            relative_decrease=NEAR_DECREASE,
        )
        return cls(
            camera=replace(
                camera,
                P=result.lens.P,
                max_angle_deg=result.max_angle_deg,
                radial=reference.camera,
                pupil_travel=result.lens.pupil_travel * scale,
            ),
            gauge=common_gauge(result),
            hessian=unanchored(result).normal.reduced_shared(),
            noise_px=corner_noise_px(result),
            scale=scale,
        )

    def of_photo(self, points: FloatArray) -> Knowledge:
        """The information of one more photo; see :meth:`of_photos`."""
        return self.of_photos([points])[0]

    def of_photos(self, photos: Sequence[FloatArray]) -> list[Knowledge]:
        """The information of each of more photos of known corners of the target.

        A photo's own pose is unknown and eliminated. The target counts as known; for a fit that
        refines it that is wrong by a few percent. Corners beyond the cone where P is held count for
        nothing.

        Args:
            photos: of each (N, 3) the corners in the camera frame, in the target's units; six or
                more numbers must fix the pose.

        """
        points = np.concatenate(photos) / self.scale
        photo = np.repeat(np.arange(len(photos)), [len(one) for one in photos])
        held = np.deg2rad(self.camera.max_angle_deg + _PRIOR_BEYOND_DEG)
        lens = self.gauge.lens
        assert isinstance(lens, CubicFit)
        # Beyond the field P may have a pole, behind which there are no slopes.
        seen = np.isfinite(np.hstack([lens.project(points), lens.far(points)])).all(axis=1)
        seen &= angle_from_axis(points) <= held
        points, photo = points[seen], photo[seen]
        _, d_point, d_lens = lens.pixel_and_slopes(points)
        turned, far = -d_point @ cross_matrix(points), FarSlopes.of(lens, points)
        away = np.linalg.norm(points, axis=-1)
        found = []
        for first, end in np.searchsorted(photo, [[one, one + 1] for one in range(len(photos))]):
            own, rows = slice(first, end), slice(2 * first, 2 * end)
            length = np.median(away[own])  # so that shifts are like turns
            by_pose = np.concatenate([turned[own], length * d_point[own]], axis=2).reshape(-1, 6)
            by_lens = d_lens[own].reshape(len(by_pose), -1)
            cross = by_lens.T @ by_pose
            eliminated = cross @ np.linalg.inv(by_pose.T @ by_pose) @ cross.T
            hessian = np.zeros_like(self.hessian)
            hessian[: len(cross), : len(cross)] = by_lens.T @ by_lens - eliminated
            slopes = FarSlopes(by_turn=far.by_turn[rows], by_lens=far.by_lens[rows])
            found.append(replace(self, hessian=hessian, gauge=Gauge.over(lens, slopes)))
        return found

    def __add__(self, other: Knowledge) -> Knowledge:
        """The information of both on the same lens."""
        return replace(self, hessian=self.hessian + other.hessian, gauge=self.gauge + other.gauge)

    def field_rays(self, blind: float) -> FloatArray:
        """(N, 3) rays over the trusted field, the ones behind camera.yaml's figures.

        Rays within ``blind`` radians of the axis, where the camera sees itself, are left out.
        """
        rays = field_grid(self.camera, blind)[2].reshape(-1, 3)
        return np.asarray(rays[np.isfinite(rays[:, 0])])

    def uncertainty(self) -> Uncertainty:
        """The covariance σ² H⁻¹."""
        return covariance(self.gauge, self.hessian, self.noise_px)

    def over(self, rays: FloatArray) -> FieldUncertainty:
        """The uncertainty over unit rays (N, 3)."""
        return summed(self.uncertainty().sigma_px(rays))

    def over_with(self, photos: Sequence[Knowledge], rays: FloatArray) -> list[FieldUncertainty]:
        """The uncertainty over unit rays (N, 3) with each of some photos added."""
        gauge = replace(
            self.gauge,
            by_turn=np.stack([photo.gauge.by_turn for photo in photos]),
            by_both=np.stack([photo.gauge.by_both for photo in photos]),
        )
        more = replace(self, hessian=np.stack([photo.hessian for photo in photos]), gauge=gauge)
        return [*map(summed, (self + more).uncertainty().sigma_px(rays))]

    def as_recorded(self, fit: FitRecord, rays: FloatArray) -> tuple[Knowledge, FieldUncertainty]:
        """The same, scaled to the uncertainty on record over rays (N, 3), and that uncertainty.

        If the target was fitted too, a fit that begins at its end differs by a few percent.
        """
        own, known = self.over(rays), fit.uncertainty.field
        if known is None or not 1 / _SAME < known.median_px / own.median_px < _SAME:
            return self, own
        noise_px = self.noise_px * known.median_px / own.median_px
        return replace(self, noise_px=noise_px), known


def _read_prior(fit: FitRecord, *, central: bool) -> Prior:
    """The prior on P; the default of older files if the record has no number."""
    return Prior(
        spread=fit.prior_spread if fit.prior_spread >= 0 else _OLDER_SPREAD,
        weight=fit.prior_weight if fit.prior_weight > 0 else EXPECTED.weight,
        central=central,
    )


def _read_offset_spread(fit: FitRecord, scale: float) -> float:
    """The typical offset of a corner, by the record of each board."""
    known = [board.offset_rms for board in fit.departures if board.offset_rms > 0]
    # The record's lengths are of three coordinates.
    return max(float(np.mean(known)) / math.sqrt(3) / scale, 1e-7) if known else _OFFSET_SHARE
