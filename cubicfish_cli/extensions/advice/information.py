"""The information that a fit's photos bring on a camera, and what more photos would add."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cubicfish import FloatArray
from cubicfish.fit.uncertainty import Gauge, Uncertainty, covariance
from cubicfish.judge.uncertainty import FieldUncertainty, summed
from cubicfish.solve.poses import cross_matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Information:
    """Information of photos on the unknowns that they share; it adds up, photo by photo.

    Attributes:
        gauge: the fit's lens, and the projection that removes the common turn.
        hessian: (K, K) of lens and target parameters, priors included and poses, corners and the
            lens that P is held to eliminated; for corners whose noise is one pixel.
        noise_px: standard deviation of a corner's coordinate, pixels.

    """

    gauge: Gauge
    hessian: FloatArray
    noise_px: float

    def of_photo(self, points: FloatArray) -> Information:
        """Return the information of one photo of known corners of the target.

        The photo's own pose is unknown and eliminated. The target counts as known; for a fit that
        refines it that is wrong by a few percent.

        Args:
            points: (N, 3) the corners in the camera frame, in the fit's unit; six or more numbers
                must fix the pose.

        """
        _, d_point, d_lens = self.gauge.lens.pixel_and_slopes(points)
        by_lens = d_lens.reshape(-1, d_lens.shape[2])
        length = np.median(np.linalg.norm(points, axis=-1))  # so that shifts are like turns
        moved = np.concatenate([-d_point @ cross_matrix(points), length * d_point], axis=2)
        by_pose = moved.reshape(-1, 6)
        inverse = np.linalg.inv(by_pose.T @ by_pose)
        cross = by_lens.T @ by_pose
        lens = slice(0, by_lens.shape[1])
        hessian = np.zeros_like(self.hessian)
        hessian[lens, lens] += by_lens.T @ by_lens - cross @ inverse @ cross.T
        gauge = Gauge.over(self.gauge.lens, points)
        return replace(self, hessian=hessian, gauge=gauge)

    def __add__(self, other: Information) -> Information:
        """Return the information of both on the same lens."""
        return replace(self, hessian=self.hessian + other.hessian, gauge=self.gauge + other.gauge)

    def uncertainty(self) -> Uncertainty:
        """Return the covariance σ² H⁻¹."""
        return covariance(self.gauge, self.hessian, self.noise_px)

    def summed(self, rays: FloatArray) -> FieldUncertainty:
        """Return the uncertainty over rays (N, 3)."""
        return summed(self.uncertainty().sigma_px(rays))
