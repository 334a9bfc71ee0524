"""The scale of a view that suits a camera: no empty pixel, nothing lost, or between the two.

Both ends are found from what the camera really sees: the rays within its cone whose pixels lie
in the photo. That region is connected, so the border of the picture tells: inside it
everywhere, no pixel is empty; nowhere, nothing is lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.errors import ViewError
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.sphere import cone_rays
from cubicfish_cli.core.types import FloatArray, IntArray
from cubicfish_cli.core.views.options import INNER, OUTER, WIDEST
from cubicfish_cli.core.views.view import Camera, CentralView, Rotation, View

_MOST_FOCAL_SIDES = 60.0  # a field of one degree
_BISECTIONS = 40
_REGION_RAYS = 4000
_GRID = 64  # pixels along a side that are looked at
# Pixels inside the photo by this much stay inside whatever the map's rounding does.
_SAFE_PX = 1e-3
# A view looks along the camera's axis where its middle row shows hardly more than the cone, and
# cameras that see all round have no such row.
_ALONG = 1.002
_ALL_ROUND_DEG = 179.0


def fit_view(
    camera: Camera,
    kind: type[CentralView],
    size: tuple[int, int],
    rotation: Rotation = (0.0, 0.0, 0.0),
    *,
    share: float,
) -> tuple[CentralView, bool]:
    """The view of this kind, size and direction whose field suits the camera.

    Args:
        camera: the camera.
        kind: the kind of view.
        size: (width, height), pixels.
        rotation: where it looks, as in :class:`CentralView`.
        share: 0 for the widest field without an empty pixel (inner), 1 for the narrowest that
            loses nothing (outer), and between them evenly in the logarithm of the scale.

    Returns:
        The view, and whether the camera sees more than this kind of view can show, so that the
        field ends where the view's own limit is.

    Raises:
        ViewError: the camera does not see the picture's middle.

    """
    view = kind(size=size, focal=1.0, rotation=rotation)
    least = kind.least_focal(size)
    most = _MOST_FOCAL_SIDES * max(size)
    ends = []
    if share < OUTER:
        ends.append(_inner(camera, view, least, most))
    if share > INNER:
        ends.append(_outer(camera, view, least, most))
    focal, at_limit = ends[-1]
    if len(ends) == 2:
        focal = math.exp((1 - share) * math.log(ends[0][0]) + share * math.log(focal))
    return replace(view, focal=focal), at_limit


def cropped_view(
    camera: Camera, kind: type[CentralView], focal: float, rotation: Rotation
) -> CentralView:
    """The smallest view of a scale that shows all that the camera sees, with even sides.

    A camera beyond 180° sees all round a pole of a view along its axis: all of that would be
    mostly empty. What it sees of the view's middle row is shown then.

    Args:
        camera: the camera.
        kind: the kind of view, one that shows every direction at a finite place.
        focal: pixels per radian in its middle.
        rotation: where it looks, as in :class:`CentralView`.

    Raises:
        ViewError: the camera sees nothing.

    """
    region = _region(camera)
    if not len(region):
        raise ViewError("the camera sees nothing within its cone: calibrate it again")
    widest = np.deg2rad([limit for limit, _ in WIDEST[kind.kind]])
    most = np.maximum(2, 2 * np.floor(focal * widest / 2)).astype(int)
    turned = kind(size=(2, 2), focal=focal, rotation=rotation).camera_from_view
    half = np.abs(kind.ray_offsets(region @ turned)).max(axis=0)
    size = np.minimum(2 * np.ceil(focal * half).astype(int) + 2, most)
    while True:  # the region is of single rays: what lies between them shows at the border
        view = kind(size=(int(size[0]), int(size[1])), focal=focal, rotation=rotation)
        border = _border(view.size, 0.5)
        seen = border[sees(camera, view.rays(border))]
        beyond = (np.abs(seen - (size - 1) / 2) >= size / 2 - 1e-6).any(axis=0)
        grown = np.where(beyond, np.minimum(size + 2 * (1 + size // 400), most), size)
        if (grown == size).all():
            break
        size = grown
    if camera.max_angle_deg > _ALL_ROUND_DEG:
        return view
    for axis in np.flatnonzero((size == most) & (widest > math.pi)).tolist():
        along = _seen_along(camera, view, axis)
        if math.pi < len(along) / focal < _ALONG * 2 * math.radians(camera.max_angle_deg):
            size[axis] = 2 * math.ceil(np.abs(along - (size[axis] - 1) / 2).max() + 0.5)
    return replace(view, size=(int(size[0]), int(size[1])))


def sees(camera: Camera, rays: FloatArray, *, margin: float = 0.0) -> npt.NDArray[np.bool_]:
    """Whether the camera's photo holds the rays (..., 3), by ``margin`` pixels at least."""
    width, height = camera.image_size
    u, v = np.moveaxis(camera.project(rays), -1, 0)
    with np.errstate(invalid="ignore"):
        across = (u >= margin) & (u <= width - 1 - margin)
        return np.asarray(across & (v >= margin) & (v <= height - 1 - margin))


def seen_field_deg(camera: Camera, view: CentralView) -> tuple[float, float]:
    """How much of a view's field the camera sees: along its middle row, and its middle column.

    Of what :attr:`~.view.CentralView.hfov_deg` and ``vfov_deg`` span, degrees.
    """
    across, down = (_seen_deg(camera, view, axis) for axis in (0, 1))
    return across, down


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


def _seen_along(camera: Camera, view: CentralView, axis: int) -> IntArray:
    """Which pixels of a view's middle row (axis 0) or column the camera sees: their x or y."""
    side = view.size[axis]
    pixel = np.tile(np.array(view.middle), (side, 1))
    pixel[:, axis] = np.arange(side)
    return np.flatnonzero(sees(camera, view.rays(pixel)))


def _seen_deg(camera: Camera, view: CentralView, axis: int) -> float:
    side = view.size[axis]
    seen = np.isin(np.arange(side), _seen_along(camera, view, axis))
    ends = np.flatnonzero(np.diff(seen, prepend=False, append=False))  # each second is beyond
    offsets = (ends - side / 2) / view.focal
    angles = [math.copysign(view.half_field(abs(end), axis), end) for end in offsets.tolist()]
    return math.degrees(sum(angles[1::2]) - sum(angles[0::2]))


def _region(camera: Camera) -> FloatArray:
    rays = cone_rays(math.radians(camera.max_angle_deg), _REGION_RAYS)
    return np.asarray(rays[sees(camera, rays)])


def _shows(view: View, rays: FloatArray) -> npt.NDArray[np.bool_]:
    width, height = view.size
    x, y = np.moveaxis(view.pixels(rays), -1, 0)
    with np.errstate(invalid="ignore"):
        return np.asarray((x >= -0.5) & (x <= width - 0.5) & (y >= -0.5) & (y <= height - 0.5))


def _border(size: tuple[int, int], margin: float) -> FloatArray:
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


def _inner(camera: Camera, view: CentralView, least: float, most: float) -> tuple[float, bool]:
    border = np.vstack([_border(view.size, 0.0), [view.middle]])

    def no_empty(focal: float) -> bool:
        rays = replace(view, focal=focal).rays(border)
        return bool(sees(camera, rays, margin=_SAFE_PX).all())

    if not no_empty(most):
        raise ViewError(
            "the camera does not see the middle of this view: look elsewhere with --rotate, "
            "or take --fit outer"
        )
    if no_empty(least):
        return least, True
    return _bisect(no_empty, good=most, bad=least), False


def _outer(camera: Camera, view: CentralView, least: float, most: float) -> tuple[float, bool]:
    border, region = _border(view.size, 0.5), _region(camera)

    def nothing_lost(focal: float) -> bool:
        trial = replace(view, focal=focal)
        return bool(_shows(trial, region).all()) and not sees(camera, trial.rays(border)).any()

    if not len(region):
        raise ViewError("the camera sees nothing within its cone: calibrate it again")
    if not nothing_lost(least):
        return least, True
    return _bisect(nothing_lost, good=least, bad=most), False


def _bisect(holds: Callable[[float], bool], *, good: float, bad: float) -> float:
    """The focal length at the edge of what holds, on the good side."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        if holds(middle):
            good = middle
        else:
            bad = middle
    return good
