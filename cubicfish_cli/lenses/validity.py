"""Is P a camera? No pole and no fold over the cone that it is used on.

An unconstrained fit can put a zero of P3Φ inside or just outside the data, where pixels run to
infinity and come back mirrored. A sound P has P3Φ > 0 and a positive Jacobian determinant (the
picture is neither folded nor mirrored) over the whole cone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.lenses.lift import evaluate_cubics
from cubicfish_cli.lenses.sphere import cone_rays, tangent_basis
from cubicfish_cli.types import FloatArray

_CHECK_RAYS = 6000


@dataclass(frozen=True, kw_only=True)
class Validity:
    """What was found over a cone.

    Attributes:
        angle_deg: half-angle of the cone that was examined.
        valid_to_deg: largest half-angle within it that has neither pole nor fold.
        smallest_denominator: smallest P3Φ on the cone, as a share of its median.
        smallest_determinant: smallest Jacobian determinant, as a share of its median.

    """

    angle_deg: float
    valid_to_deg: float
    smallest_denominator: float
    smallest_determinant: float

    @property
    def valid(self) -> bool:
        """Whether the whole cone is free of poles and folds."""
        return self.valid_to_deg >= self.angle_deg


def check_validity(P: npt.ArrayLike, angle_deg: float) -> Validity:
    """Examine P (3, 20) for poles and folds over the cone of half-angle ``angle_deg``."""
    P = np.asarray(P, float)
    angle = np.deg2rad(angle_deg)
    rim_azimuth = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    rim = np.stack(
        [
            np.sin(angle) * np.cos(rim_azimuth),
            np.sin(angle) * np.sin(rim_azimuth),
            np.full(720, np.cos(angle)),
        ],
        axis=-1,
    )
    rays = np.vstack([[[0.0, 0.0, 1.0]], cone_rays(angle, _CHECK_RAYS), rim])
    homogeneous, gradient = evaluate_cubics(P, rays)
    denominator = homogeneous[:, 2]
    gradient = gradient @ tangent_basis(rays)
    # d(u, v) = (d(P1Φ, P2Φ) − (u, v) d(P3Φ)) / P3Φ; times P3Φ² it stays finite at a pole.
    a = gradient[:, :2] * denominator[:, None, None]
    numerator = a - homogeneous[:, :2, None] * gradient[:, 2:, :]
    determinant = numerator[:, 0, 0] * numerator[:, 1, 1] - numerator[:, 0, 1] * numerator[:, 1, 0]
    good = (denominator > 0) & (determinant > 0)
    theta = np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1)))
    return Validity(
        angle_deg=float(angle_deg),
        valid_to_deg=float(angle_deg) if good.all() else float(theta[~good].min()),
        smallest_denominator=_smallest(denominator),
        smallest_determinant=_smallest(determinant),
    )


def _smallest(values: FloatArray) -> float:
    """The smallest, relative to the typical one; 0 where that is 0 too, as for a P of zeros."""
    typical = abs(float(np.median(values)))
    return float(values.min()) / typical if typical > 0 else 0.0
