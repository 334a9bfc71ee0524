"""A lens of another tool as a cubic camera: P fitted to it over all that it sees in the photo."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.errors import CameraFileError, FitError
from cubicfish.fit.exported_lens import ConversionError, conversion_error
from cubicfish.fit.nearest_cubic import linear_cubic, refined_cubic
from cubicfish.geometry import inside_polygon
from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.models.lens import Lens
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays, ray_at
from cubicfish.solve.fit_lens import nearest_lens
from cubicfish.types import FloatArray

_RAYS = 4000
_AZIMUTHS = 72
_STEP_DEG = 0.25
# The most that a camera may be trusted to, from its axis.
_LARGEST_ANGLE_DEG = 175.0
# A polynomial lens bends wildly beyond where it was calibrated, and no file says where that is: a
# field in which P is this near is taken rather than a wider one.
_SHARES = (1.0, 0.97, 0.94, 0.9, 0.86, 0.8, 0.7)
_GOOD_PX = 0.1
# Fields of lenses that are sold reach a little farther at most.
_LARGEST_FIELD_DEG = 110.0
# Short of where a lens folds, its profile is flat and P would have to be infinitely steep.
_FOLD_SHARE = 0.97
# P is fitted a little farther than it is trusted.
_MARGIN_DEG = 2.0
_EDGE_SHARE = 0.01
# Stronger pulls of P3Φ to 1 keep poles out where weaker ones do not.
_PULLS = (1e-4, 1e-3, 1e-2)


EndedBy = Literal["photo", "region", "fold", "angle", "fit"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedCamera:
    """A cubic camera in a lens's place.

    Attributes:
        camera: the camera; its ``max_angle_deg`` is how far it is trusted.
        error: how far it is from the lens, up to there.
        ended_by: what ends its field. ``photo``: the lens shows no more in the photo. ``region``:
            the file says where the lens is valid. ``fold``: the lens folds, or ends, inside the
            photo. ``angle``: the caller's bound. ``fit``: farther out no sound P is near.
        fold_deg: the angle at which the lens folds, where that ends the field.

    """

    camera: CubicCamera
    error: ConversionError
    ended_by: EndedBy
    fold_deg: float | None = None


def from_lens(lens: Lens, *, max_angle_deg: float | None = None) -> ImportedCamera:
    """Return the cubic camera nearest to a lens, least squares in pixels, and how near it is.

    Args:
        lens: the lens.
        max_angle_deg: trust P up to this angle from the axis at most, by default 110°; it is never
            trusted farther than the lens sees in the photo. Files do not say where the lens's own
            picture ends, which often lies inside the photo.

    Raises:
        CameraFileError: the angle is not above 0 and at most 175°.
        FitError: the lens sees nothing of the photo, or no sound P is near it.

    """
    if max_angle_deg is None:
        max_angle_deg = _LARGEST_FIELD_DEG
    if not 0 < max_angle_deg <= _LARGEST_ANGLE_DEG:
        raise CameraFileError(
            f"max_angle_deg must be above 0 and at most {_LARGEST_ANGLE_DEG:g}, not {max_angle_deg}"
        )
    widest, ended_by, fold_deg = _measure_field(lens)
    if max_angle_deg < widest:
        widest, ended_by, fold_deg = max_angle_deg, "angle", None
    best: ImportedCamera | None = None
    for share in _SHARES:
        camera = _fit_sound_camera(lens, share * widest)
        if camera is None:
            continue
        error = conversion_error(camera, lens)
        if best is None or error.max_px < best.error.max_px:
            best = ImportedCamera(
                camera=camera,
                error=error,
                ended_by=ended_by if share == 1 else "fit",
                fold_deg=fold_deg if share == 1 else None,
            )
        if error.max_px <= _GOOD_PX:
            break
    if best is None:
        raise FitError(
            f"no sound cubic camera is near this lens up to {widest:.0f}° from its axis",
            do="choose a smaller {max_angle_deg}, up to where the lens was calibrated",
            arguments={"max_angle_deg": "max_angle_deg"},
        )
    return best


def _fit_sound_camera(lens: Lens, max_angle_deg: float) -> CubicCamera | None:
    rays, pixel = _sample_seen(lens, max_angle_deg + _MARGIN_DEG)
    radial = _fit_reference(lens, rays, pixel)
    for pull in _PULLS:
        linear = linear_cubic(rays, pixel, radial, denominator_pull=pull)
        refined = refined_cubic(linear, rays, pixel, stiffness=pull * linear.scale)
        for P in (refined.P, linear.P):
            if pole_or_fold_deg(P, max_angle_deg) is None:
                return CubicCamera(
                    image_size=lens.image_size, P=P, max_angle_deg=max_angle_deg, radial=radial
                )
    return None


def _measure_field(lens: Lens) -> tuple[float, EndedBy, float | None]:
    """Half-angle of the cone that holds what the lens shows in the photo, short of any fold.

    Returns:
        The angle, degrees; what ends the field there; and the fold's angle, where one does.

    """
    ended_by: EndedBy = "photo"
    fold_deg = None
    theta = np.deg2rad(np.arange(0, _LARGEST_ANGLE_DEG, _STEP_DEG))
    turn = np.linspace(0, 2 * np.pi, _AZIMUTHS, endpoint=False)
    rays = ray_at(*np.broadcast_arrays(theta, turn[:, None]))
    pixel = lens.project(rays.reshape(-1, 3)).reshape(*rays.shape[:2], 2)
    middle = pixel[0, 0]
    width, height = lens.image_size
    inside = np.asarray(((pixel > -0.5) & (pixel < [width - 0.5, height - 0.5])).all(axis=-1))
    region = lens.outline
    if len(region):  # where the file says that the lens is valid
        ended_by = "region"
        inside &= inside_polygon(pixel.reshape(-1, 2), region).reshape(inside.shape)
    if not np.isfinite(middle).all() or not inside[:, 1:].any():
        raise FitError("the lens sees nothing of its photo: check its focal length and centre")
    radius = np.hypot(*(pixel - middle).transpose(2, 0, 1))
    with np.errstate(invalid="ignore"):
        grows = radius[:, 1:] > radius[:, :-1]  # false from the first NaN on
    last = np.where(np.all(grows, axis=1), len(theta) - 1, np.argmin(grows, axis=1))
    # Rays beyond a fold fall into the photo again: they are none of the lens's.
    index = np.arange(len(theta))
    shown = inside & (index <= last[:, None])
    farthest = int(np.max(np.where(shown, index, 0)))
    # A lens that is defined for the photo alone ends where the photo does: that is no fold.
    end = np.take_along_axis(pixel, last[:, None, None], axis=1)[:, 0]
    near = _EDGE_SHARE * max(width, height)
    at_edge = ((end < near) | (end > np.array([width, height]) - 1 - near)).any(axis=-1)
    ends = (last <= farthest) & (last < len(theta) - 1) & ~at_edge
    fold = int(last[ends].min()) if ends.any() else len(theta)
    if _FOLD_SHARE * fold < farthest:
        farthest, ended_by, fold_deg = int(_FOLD_SHARE * fold), "fold", fold * _STEP_DEG
    return float(max(farthest, 4) * _STEP_DEG), ended_by, fold_deg


def _sample_seen(lens: Lens, angle_deg: float) -> tuple[FloatArray, FloatArray]:
    rays = cone_rays(np.deg2rad(min(angle_deg, _LARGEST_ANGLE_DEG)), _RAYS)
    pixel = lens.project(rays)
    good = np.isfinite(pixel).all(axis=1)
    # Far outside the photo a polynomial lens says anything.
    size = np.array(lens.image_size, float)
    good &= (np.abs(pixel - size / 2) < 0.75 * size.max()).all(axis=1)
    return rays[good], pixel[good]


def _fit_reference(lens: Lens, rays: FloatArray, pixel: FloatArray) -> RadialCamera:
    """Return the Kannala–Brandt lens nearest to the rays."""
    theta = angle_from_axis(rays)
    middle = lens.project(np.array([[0.0, 0.0, 1.0]]))[0]
    far = theta > 0.5 * theta.max()
    focal = float(np.median(np.linalg.norm(pixel[far] - middle, axis=1) / theta[far]))
    start = RadialCamera.from_parameters([focal, focal, *middle, 0, 0, 0, 0], lens.image_size)
    return nearest_lens([start], rays, pixel)
