"""A camera to look for corners by: sooner there than a calibration, with no figures of its quality.

It is the fit from which a calibration chooses the prior of P, fits the target and measures what it
is worth: the radial reference, the cubic under the prior that is expected of any lens, and the
outliers left out.
"""

from dataclasses import dataclass, replace

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit import rejection
from cubicfish.fit.calibrate import NO_CONVERGENCE, refuse_too_little, refuse_undetermined
from cubicfish.fit.radial_reference import CHECK_ALL, fit_radial
from cubicfish.models.cubic import CubicCamera
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import middle, with_mean_weight_one, world_scale
from cubicfish.target.observations import Observations
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughFit:
    """A camera and where it was.

    Attributes:
        camera: the camera; it may be trusted a little beyond the corners.
        poses: camera_from_world of each photo.
        pairs: the pairs of the photos that fit it, without outliers.
        residual: (N, 2) projection less pixel of these, pixels.

    """

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray


@one_blas_thread()
def fit_roughly(pairs: Observations) -> RoughFit:
    """Fit a camera to 2D-3D pairs of a nominal target.

    Raises:
        FitError: as :func:`~cubicfish.fit.calibrate.calibrate` does of such pairs.

    """
    refuse_too_little(pairs)
    origin, weight = middle(pairs), pairs.weight.mean()
    own = with_mean_weight_one(pairs.with_world(pairs.world - origin))
    scale = world_scale(own)
    try:
        reference = fit_radial(own.with_world(own.world / scale))
        fit = rejection.without_noisy(rejection.without_gross(reference)[0])
    except np.linalg.LinAlgError as failure:
        raise FitError(NO_CONVERGENCE, do=CHECK_ALL) from failure
    refuse_undetermined(fit.reference)
    used = fit.reference.pairs
    return RoughFit(
        camera=CubicCamera(
            image_size=pairs.image_size,
            P=fit.lens.P,
            max_angle_deg=fit.max_angle_deg,
            radial=fit.reference.camera,
            pupil_travel=fit.lens.pupil_travel * scale,
        ),
        poses=fit.poses.scaled(scale).of_world(origin),
        pairs=replace(used, world=used.world * scale + origin, weight=used.weight * weight),
        residual=fit.residual,
    )
