"""How much of a view a camera sees, and the field of view that suits it.

Two scales follow from the region that the camera sees, which is the rays within its cone whose
pixels lie in the photo: at ``inner`` no pixel of the picture is empty, at ``outer`` nothing is
lost. The region is connected, so the border of the picture decides: if all of the border lies in
the region, no pixel is empty; if none of it does, nothing is lost.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from cubicfish.errors import ViewError
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.types import BoolArray, FloatArray, IntArray
from cubicfish.views.view import PROJECTIONS, Camera, CentralView, PointProjector, View

Fit = float | Literal["inner", "outer", "whole"]
"""How a field suits a camera: ``inner``, ``outer``, a share from 0 (inner) to 1 (outer), or
``whole``, which is outer for all that photos show: :class:`~.maps.WholePhoto`."""

_MOST_FOCAL_SIDES = 60.0  # a field of one degree
_BISECTIONS = 40
_REGION_RAYS = 4000
_GRID = 64  # sampled pixels along a side
# Pixels inside the photo by this much stay inside, however the map rounds.
_SAFE_PX = 1e-3
# A view looks along the camera's axis if its middle row shows hardly more than the cone; cameras
# that see all round have no such row.
_ALONG = 1.002
_ALL_ROUND_DEG = 179.0


def axis_focal(camera: Camera) -> float:
    """The camera's scale on its axis, pixels per radian.

    Raises:
        ViewError: the camera has no pixel about its axis.

    """
    step = 1e-4
    around = np.array([[step, 0, 1], [-step, 0, 1], [0, step, 1], [0, -step, 1]])
    right, left, down, up = camera.project(around)
    (ux, vx), (uy, vy) = (right - left) / (2 * step), (down - up) / (2 * step)
    area = ux * vy - uy * vx
    if not area > 0:
        raise ViewError("the camera has no sound scale on its axis: calibrate it again")
    return float(np.sqrt(area))


def fit_view(camera: Camera, view: CentralView, share: float) -> tuple[CentralView, bool]:
    """A view with the focal length at which its field suits the camera.

    Args:
        camera: the camera.
        view: of any focal length.
        share: 0 for the widest field without an empty pixel (inner), 1 for the narrowest that
            loses nothing (outer), and between them evenly in the logarithm of the scale.

    Returns:
        The view, and whether the camera sees more than this kind of view can show, so that the
        field ends where the view's own limit is.

    Raises:
        ViewError: the camera does not see the picture's middle.

    """
    ends = []
    if share < 1:
        ends.append(_fit_inner(camera, view))
    if share > 0:
        ends.append(_fit_outer(camera, view))
    focal, at_limit = ends[-1]
    if len(ends) == 2:
        focal = math.exp((1 - share) * math.log(ends[0][0]) + share * math.log(focal))
    return replace(view, focal=focal), at_limit


def cropped(camera: Camera, view: CentralView) -> CentralView:
    """The smallest view of a scale that shows all that the camera sees, with even sides.

    A camera beyond 180° sees all round a pole of a view along its axis, and a picture of all that
    would be mostly empty. The view then shows what the camera sees of its middle row.

    Args:
        camera: the camera.
        view: any size, of a kind that shows every direction at a finite place.

    Raises:
        ViewError: the camera sees nothing.

    """
    region = _sample_region(camera)
    widest = 2 * np.array(PROJECTIONS[view.kind].most)
    most = np.maximum(2, 2 * np.floor(view.focal * widest / 2)).astype(int)
    half = np.abs(PROJECTIONS[view.kind].offsets(region @ view.camera_from_view)).max(axis=0)
    size = np.minimum(2 * np.ceil(view.focal * half).astype(int) + 2, most)
    while True:  # the region has single rays: what lies between them appears at the border
        view = replace(view, size=(int(size[0]), int(size[1])))
        border = _list_border(view.size, 0.5)
        seen = border[sees(camera, view.rays(border))]
        beyond = (np.abs(seen - (size - 1) / 2) >= size / 2 - 1e-6).any(axis=0)
        grown = np.where(beyond, np.minimum(size + 2 * (1 + size // 400), most), size)
        if (grown == size).all():
            break
        size = grown
    if camera.max_angle_deg > _ALL_ROUND_DEG:
        return view
    for axis in np.flatnonzero((size == most) & (widest > math.pi)).tolist():
        along = _find_seen_along(camera, view, axis)
        if math.pi < len(along) / view.focal < _ALONG * 2 * math.radians(camera.max_angle_deg):
            size[axis] = 2 * math.ceil(np.abs(along - (size[axis] - 1) / 2).max() + 0.5)
    return replace(view, size=(int(size[0]), int(size[1])))


def trimmed(camera: Camera, view: CentralView) -> CentralView:
    """A view without the outer columns and rows in which the camera sees nothing, with even sides.

    Its middle stays where it is.

    Args:
        camera: the camera.
        view: of any kind.

    """
    size = list(view.size)
    for axis, side in enumerate(view.size):
        along, across = np.arange(side), np.linspace(0, view.size[1 - axis] - 1, _GRID)
        pixel = np.stack(np.meshgrid(along, across, indexing="ij")[:: 1 - 2 * axis], axis=-1)
        seen = along[sees(camera, view.rays(pixel)).any(axis=1)]
        if len(seen):
            half = float(np.abs(seen - (side - 1) / 2).max()) + 0.5
            size[axis] = min(side, 2 * math.ceil(half))
    return replace(view, size=(size[0], size[1]))


def sees(camera: PointProjector, rays: FloatArray, *, margin: float = 0.0) -> BoolArray:
    """Whether rays (..., 3) lie in the camera's photo, at least ``margin`` pixels from its edge."""
    return in_picture(camera.project(rays), camera.image_size, margin)


def in_picture(pixel: FloatArray, size: tuple[int, int], margin: float = 0.0) -> BoolArray:
    """Whether pixels (..., 2) lie in a picture, by ``margin`` within the outer pixels' centres."""
    with np.errstate(invalid="ignore"):
        inside = (pixel >= margin) & (pixel <= np.array(size) - 1 - margin)
    return np.asarray(inside.all(axis=-1))


def seen_field_deg(camera: PointProjector, view: CentralView) -> tuple[float, float]:
    """How much of a view's field the camera sees, along its middle row and its middle column.

    They are parts of :attr:`~.view.CentralView.hfov_deg` and ``vfov_deg``, degrees.
    """
    fields = []
    for axis, side in enumerate(view.size):
        seen = np.isin(np.arange(side), _find_seen_along(camera, view, axis))
        ends = np.flatnonzero(np.diff(seen, prepend=False, append=False))  # each second is beyond
        offsets = (ends - side / 2) / view.focal
        angles = [math.copysign(view.half_field(abs(end), axis), end) for end in offsets.tolist()]
        fields.append(math.degrees(sum(angles[1::2]) - sum(angles[0::2])))
    return fields[0], fields[1]


def lost_shares(camera: CubicCamera, view: CentralView) -> tuple[float, float]:
    """How much of what photos show a view leaves out, from 0 to 1.

    Returns:
        The share of their pixels that lies beyond the camera's cone, and the share within it that
        lies beyond the view's edges.

    """
    width, height = camera.image_size
    x, y = np.meshgrid(np.linspace(0, width - 1, _GRID), np.linspace(0, height - 1, _GRID))
    pixel = np.stack([x.ravel(), y.ravel()], axis=-1)
    rays = camera.photo_rays(pixel)
    known = np.isfinite(camera.unproject(pixel)[:, 0])
    photo = max(1, int(np.isfinite(rays[:, 0]).sum()))
    unknown = photo - int(known.sum())
    return unknown / photo, int((known & ~_shows(view, rays)).sum()) / photo


def _find_seen_along(camera: PointProjector, view: CentralView, axis: int) -> IntArray:
    """Which pixels of a view's middle row (axis 0) or column the camera sees: their x or y."""
    side = view.size[axis]
    pixel = np.tile(np.array(view.middle), (side, 1))
    pixel[:, axis] = np.arange(side)
    return np.flatnonzero(sees(camera, view.rays(pixel)))


def _sample_region(camera: Camera) -> FloatArray:
    rays = cone_rays(math.radians(camera.max_angle_deg), _REGION_RAYS)
    rays = rays[sees(camera, rays)]
    if not len(rays):
        raise ViewError("the camera sees nothing within its cone: calibrate it again")
    return rays


def _shows(view: View, rays: FloatArray) -> BoolArray:
    return in_picture(view.pixels(rays), view.size, -0.5)


def _list_border(size: tuple[int, int], margin: float) -> FloatArray:
    """Points around a picture, ``margin`` pixels beyond the outer pixels' centres: (N, 2).

    With no margin they are the outer pixels themselves.
    """
    width, height = size
    low, right, bottom = -margin, width - 1 + margin, height - 1 + margin
    across = np.linspace(low, right, width if margin == 0 else width + 1)
    down = np.linspace(low, bottom, height if margin == 0 else height + 1)
    x = [across, across, np.full(len(down), low), np.full(len(down), right)]
    y = [np.full(len(across), low), np.full(len(across), bottom), down, down]
    return np.stack([np.concatenate(x), np.concatenate(y)], axis=-1)


def _fit_inner(camera: Camera, view: CentralView) -> tuple[float, bool]:
    """The least focal length without an empty pixel, and whether the view's limit sets it."""
    border = np.vstack([_list_border(view.size, 0.0), [view.middle]])

    def no_empty(focal: float) -> bool:
        rays = replace(view, focal=focal).rays(border)
        return bool(sees(camera, rays, margin=_SAFE_PX).all())

    least, most = view.least_focal, _MOST_FOCAL_SIDES * max(view.size)
    if not no_empty(most):
        raise ViewError(
            "the camera does not see the middle of this view: rotate it, or take fit 'outer'"
        )
    if no_empty(least):
        return least, True
    return _bisect(no_empty, good=most, bad=least), False


def _fit_outer(camera: Camera, view: CentralView) -> tuple[float, bool]:
    """The largest focal length at which nothing is lost, and whether something is at any."""
    border, region = _list_border(view.size, 0.5), _sample_region(camera)

    def nothing_lost(focal: float) -> bool:
        trial = replace(view, focal=focal)
        return bool(_shows(trial, region).all()) and not sees(camera, trial.rays(border)).any()

    least = view.least_focal
    if not nothing_lost(least):
        return least, True
    return _bisect(nothing_lost, good=least, bad=_MOST_FOCAL_SIDES * max(view.size)), False


def _bisect(good_at: Callable[[float], bool], *, good: float, bad: float) -> float:
    """The focal length at the edge of where something holds, on the good side."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        if good_at(middle):
            good = middle
        else:
            bad = middle
    return good
