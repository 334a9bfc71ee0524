"""Views that suit a camera: from the options asked for, and what the camera sees of them.

Two scales are found from what the camera really sees, which is the rays within its cone whose
pixels lie in the photo: at ``inner`` no pixel of the picture is empty, at ``outer`` nothing is
lost. That region is connected, so the border of the picture tells: inside it everywhere, no pixel
is empty; nowhere, nothing is lost.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from cubicfish_cli.core.errors import UsageError, ViewError
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.sphere import cone_rays
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.core.views.maps import UndistortMap, WholePhoto, build_map
from cubicfish_cli.core.views.options import (
    INNER,
    KINDS,
    OUTER,
    WHOLE,
    WIDEST,
    Kind,
    Share,
    ViewOptions,
)
from cubicfish_cli.core.views.view import (
    PROJECTIONS,
    Camera,
    CentralView,
    PointProjector,
    View,
    face_views,
    rotation_from_angles,
)

MAX_DEFAULT_FIELD_DEG = 120.0
"""A flat picture of a wider field spends nearly all its pixels on the rim."""

_LEAST_UNSEEN_DEG = 0.05  # what is printed is rounded to as much
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


def build_view(
    camera: Camera,
    kind: Kind = "perspective",
    *,
    size: Sequence[int] | None = None,
    hfov_deg: float | None = None,
    vfov_deg: float | None = None,
    focal: float | None = None,
    fit: Share | None = None,
    rotate_deg: Sequence[float] = (0.0, 0.0, 0.0),
) -> CentralView:
    """A picture to render from the camera's photos: what each of its pixels looks along.

    Its field comes from one of ``hfov_deg``, ``vfov_deg``, ``focal`` and ``fit``. Without any, a
    flat view keeps the photo's scale on its axis, up to 120° along the longer side, and the others
    show all that the camera sees; an ``equirectangular`` view of no given size is just as large as
    that at the photo's scale, and along the axis of a lens beyond 180° as its middle row shows.

    Args:
        camera: whose photos are rendered.
        kind: in a ``perspective`` view straight lines are straight, in a ``cylindrical`` one
            verticals are; ``equirectangular`` and ``equidistant`` views show angles evenly, and
            ``stereographic`` ones keep shapes.
        size: (width, height), pixels; by default the photo's.
        hfov_deg: field across the width, degrees; with ``vfov_deg`` it sets the height.
        vfov_deg: field down the height, degrees.
        focal: scale in the middle, pixels per radian.
        fit: ``inner`` for the widest field without an empty pixel, ``outer`` for the narrowest
            that loses nothing, or a share from 0 (inner) to 1 (outer).
        rotate_deg: (yaw, pitch, roll): look right, then up, then turn clockwise, degrees.

    Raises:
        UsageError: something is asked twice, or is nothing that such a view has.
        ViewError: the camera shows no such view.

    """
    if kind == "cube":
        raise UsageError("a cube is several views: ask for it by ViewOptions(kind='cube')")
    if fit == WHOLE:
        raise UsageError("fit 'whole' is what files are asked for: ViewOptions(fit='whole')")
    numbers: dict[str, Any] = {"size": size, "rotate_deg": rotate_deg}  # of any kind
    asked = ViewOptions(
        kind=kind, hfov_deg=hfov_deg, vfov_deg=vfov_deg, focal=focal, fit=fit, **numbers
    )
    return _central(camera, asked)[0]


def _central(camera: Camera, asked: ViewOptions) -> tuple[CentralView, bool]:
    """The view, and whether the camera sees more than it can show."""
    size = asked.size or camera.image_size
    view = CentralView(
        kind=asked.kind or KINDS[0],
        size=size,
        focal=asked.focal or 1.0,
        rotation=rotation_from_angles(*asked.rotate_deg),
    )
    scale = size[0] / camera.image_size[0]
    field = partial(CentralView.with_field, view.kind, rotation=view.rotation)
    if view.kind.endswith("equirectangular") and asked.leaves_field_open:
        return _cropped(camera, replace(view, focal=axis_focal(camera))), False
    if asked.hfov_deg is not None:
        view = field(asked.hfov_deg, size)
        if asked.vfov_deg is None:
            return view, False
        one = field(asked.vfov_deg, (1, 1), vertical=True)  # its focal is 1 / height
        return replace(view, size=(size[0], max(1, round(view.focal / one.focal)))), False
    if asked.vfov_deg is not None:
        return field(asked.vfov_deg, size, vertical=True), False
    if asked.focal is not None:
        return view, False
    if asked.fit is None and view.kind == "perspective":
        widest = min(MAX_DEFAULT_FIELD_DEG, 2 * camera.max_angle_deg)
        least = max(camera.image_size) / 2 / math.tan(math.radians(widest) / 2)
        return replace(view, focal=max(axis_focal(camera), least) * scale), False
    share = OUTER if asked.fit in (None, WHOLE) else float(asked.fit)
    view, at_limit = fit_view(camera, view, share)
    if asked.fit is None and view.kind.endswith("cylindrical") and at_limit:
        # All round, for the sake of what is nearly overhead, is not what anyone means.
        return replace(view, focal=max(view.focal, axis_focal(camera) * scale)), False
    return view, at_limit


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
    if share < OUTER:
        ends.append(_inner(camera, view))
    if share > INNER:
        ends.append(_outer(camera, view))
    focal, at_limit = ends[-1]
    if len(ends) == 2:
        focal = math.exp((1 - share) * math.log(ends[0][0]) + share * math.log(focal))
    return replace(view, focal=focal), at_limit


def _cropped(camera: Camera, view: CentralView) -> CentralView:
    """The smallest view of a scale that shows all that the camera sees, with even sides.

    A camera beyond 180° sees all round a pole of a view along its axis: all of that would be
    mostly empty. What it sees of the view's middle row is shown then.

    Args:
        camera: the camera.
        view: of a kind that shows every direction at a finite place, and of any size.

    Raises:
        ViewError: the camera sees nothing.

    """
    region = _region(camera)
    widest = np.deg2rad([limit for limit, _ in WIDEST[view.kind]])
    most = np.maximum(2, 2 * np.floor(view.focal * widest / 2)).astype(int)
    half = np.abs(PROJECTIONS[view.kind].offsets(region @ view.camera_from_view)).max(axis=0)
    size = np.minimum(2 * np.ceil(view.focal * half).astype(int) + 2, most)
    while True:  # the region is of single rays: what lies between them shows at the border
        view = replace(view, size=(int(size[0]), int(size[1])))
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
        if math.pi < len(along) / view.focal < _ALONG * 2 * math.radians(camera.max_angle_deg):
            size[axis] = 2 * math.ceil(np.abs(along - (size[axis] - 1) / 2).max() + 0.5)
    return replace(view, size=(int(size[0]), int(size[1])))


def sees(camera: Camera, rays: FloatArray, *, margin: float = 0.0) -> BoolArray:
    """Whether the camera's photo holds the rays (..., 3), by ``margin`` pixels at least."""
    return _inside(camera.project(rays), camera.image_size, margin)


def _inside(pixel: FloatArray, size: tuple[int, int], margin: float) -> BoolArray:
    """Whether pixels (..., 2) lie in a picture, by ``margin`` within the outer pixels' middles."""
    with np.errstate(invalid="ignore"):
        inside = (pixel >= margin) & (pixel <= np.array(size) - 1 - margin)
    return np.asarray(inside.all(axis=-1))


def seen_field_deg(camera: Camera, view: CentralView) -> tuple[float, float]:
    """How much of a view's field the camera sees: along its middle row, and its middle column.

    Of what :attr:`~.view.CentralView.hfov_deg` and ``vfov_deg`` span, degrees.
    """
    fields = []
    for axis, side in enumerate(view.size):
        seen = np.isin(np.arange(side), _seen_along(camera, view, axis))
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


def _seen_along(camera: Camera, view: CentralView, axis: int) -> IntArray:
    """Which pixels of a view's middle row (axis 0) or column the camera sees: their x or y."""
    side = view.size[axis]
    pixel = np.tile(np.array(view.middle), (side, 1))
    pixel[:, axis] = np.arange(side)
    return np.flatnonzero(sees(camera, view.rays(pixel)))


def _region(camera: Camera) -> FloatArray:
    rays = cone_rays(math.radians(camera.max_angle_deg), _REGION_RAYS)
    rays = rays[sees(camera, rays)]
    if not len(rays):
        raise ViewError("the camera sees nothing within its cone: calibrate it again")
    return rays


def _shows(view: View, rays: FloatArray) -> BoolArray:
    return _inside(view.pixels(rays), view.size, -0.5)


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


def _inner(camera: Camera, view: CentralView) -> tuple[float, bool]:
    """The least focal length at which no pixel is empty, and whether it is the view's own limit."""
    border = np.vstack([_border(view.size, 0.0), [view.middle]])

    def no_empty(focal: float) -> bool:
        rays = replace(view, focal=focal).rays(border)
        return bool(sees(camera, rays, margin=_SAFE_PX).all())

    least, most = view.least_focal, _MOST_FOCAL_SIDES * max(view.size)
    if not no_empty(most):
        raise ViewError(
            "the camera does not see the middle of this view: look elsewhere with --rotate, "
            "or take --fit outer"
        )
    if no_empty(least):
        return least, True
    return _bisect(no_empty, good=most, bad=least), False


def _outer(camera: Camera, view: CentralView) -> tuple[float, bool]:
    """The largest focal length at which nothing is lost, and whether some is at any."""
    border, region = _border(view.size, 0.5), _region(camera)

    def nothing_lost(focal: float) -> bool:
        trial = replace(view, focal=focal)
        return bool(_shows(trial, region).all()) and not sees(camera, trial.rays(border)).any()

    least = view.least_focal
    if not nothing_lost(least):
        return least, True
    return _bisect(nothing_lost, good=least, bad=_MOST_FOCAL_SIDES * max(view.size)), False


def _bisect(holds: Callable[[float], bool], *, good: float, bad: float) -> float:
    """The focal length at the edge of what holds, on the good side."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        if holds(middle):
            good = middle
        else:
            bad = middle
    return good


@dataclass(frozen=True, kw_only=True)
class SeenField:
    """What a camera sees of a view: a fisheye's round picture seldom fills it.

    Attributes:
        field_deg: of the view, across and down.
        seen_deg: what the camera sees of it, along the view's middle row and column.
        uncalibrated: share of what the photos show that lies beyond the camera's cone.
        cut_off: share of it that lies beyond the view's edges.
        whole: whether what is uncalibrated is shown too, extrapolated.

    """

    field_deg: tuple[float, float]
    seen_deg: tuple[float, float]
    uncalibrated: float = 0.0
    cut_off: float = 0.0
    whole: bool = False

    def describe(self) -> str:
        """``191.2° of 231.7° across, all 173.7° down``; empty where the camera sees all of it."""
        words = [
            f"all {field:.1f}° {way}"
            if field - seen < _LEAST_UNSEEN_DEG
            else f"{seen:.1f}° of {field:.1f}° {way}"
            for seen, field, way in zip(
                self.seen_deg, self.field_deg, ("across", "down"), strict=True
            )
        ]
        return "" if all(one.startswith("all") for one in words) else ", ".join(words)


@dataclass(frozen=True, kw_only=True)
class ChosenView:
    """What is rendered.

    Attributes:
        views: name of the part -> view; one part named "" unless it is a cube.
        camera: whose photos are rendered; None for those of several.
        at_limit: whether the camera sees more than the fitted view can show.
        unit: of length, of a plane's picture.
        asked_field: whether its field is what somebody asked for.

    """

    views: Mapping[str, View]
    camera: PointProjector | None = None
    at_limit: bool = False
    unit: str = "unit"
    asked_field: bool = True

    @property
    def first(self) -> View:
        """The view, or a cube's front."""
        return next(iter(self.views.values()))

    def describe(self) -> str:
        """A view in a few words."""
        width, height = self.first.size
        if len(self.views) > 1:
            return f"the six faces of a cube, {width}x{height} pixels each"
        return f"{width}x{height} pixels, {self.first.describe(self.unit)}"

    @property
    def seen(self) -> SeenField | None:
        """What the camera sees of the view's field; None of a cube, a plane and of several."""
        view, camera = self.first, cast(Camera, self.camera)
        if len(self.views) > 1 or not isinstance(view, CentralView) or self.camera is None:
            return None
        seen = SeenField(
            field_deg=(view.hfov_deg, view.vfov_deg),
            seen_deg=seen_field_deg(camera, view),
            whole=isinstance(camera, WholePhoto),
        )
        own = camera.camera if isinstance(camera, WholePhoto) else camera
        if self.asked_field or not isinstance(own, CubicCamera):
            return seen
        uncalibrated, cut_off = lost_shares(own, view)
        return replace(seen, uncalibrated=uncalibrated, cut_off=cut_off)

    @cached_property
    def maps(self) -> dict[str, UndistortMap]:
        """Part of the view -> its map for the camera's photos."""
        assert self.camera is not None
        return {part: build_map(self.camera, one) for part, one in self.views.items()}

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON; of a cube the first face, and all their names."""
        first = self.first
        record = {**json.loads(first.to_json()), "words": self.describe(), "cut": self.at_limit}
        if len(self.views) > 1:
            return {**record, "parts": list(self.views)}
        if isinstance(first, CentralView):
            return {**record, "hfov_deg": first.hfov_deg, "vfov_deg": first.vfov_deg}
        return record


def chosen_view(camera: Camera, asked: View | ViewOptions | None) -> ChosenView:
    """What is rendered of a camera's photos: a view as it is given, or what is asked of it.

    Raises:
        UsageError: the whole of what several cameras' photos show is asked for.
        ViewError: the view is not one that can be rendered.

    """
    if isinstance(asked, View):
        return ChosenView(views={"": asked}, camera=camera)
    asked = asked or ViewOptions()
    if asked.kind == "cube":
        side = max(1, round(2 * axis_focal(camera)))  # keeps the photo's scale on the axis
        side = asked.size[0] if asked.size else side
        faces = face_views(side, rotation_from_angles(*asked.rotate_deg))
        return ChosenView(views=faces, camera=camera)
    if asked.fit == WHOLE:
        if not isinstance(camera, CubicCamera):
            raise UsageError("--fit whole is for photos of one camera: take --fit outer")
        camera = WholePhoto(camera=camera)
    view, at_limit = _central(camera, asked)
    numbers = (asked.hfov_deg, asked.vfov_deg, asked.focal, *filter(None, asked.rotate_deg))
    asked_field = any(number is not None for number in numbers)
    return ChosenView(views={"": view}, camera=camera, at_limit=at_limit, asked_field=asked_field)
