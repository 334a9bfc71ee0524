"""Views from the options asked for, and what the camera sees of them.

All kinds of views: their registry, their records, and the default view.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cubicfish_cli.errors import ViewError
from cubicfish_cli.undistortion.fit import (
    INNER,
    OUTER,
    Fitted,
    cropped_view,
    fit_view,
    kept_share,
    seen_field_deg,
)
from cubicfish_cli.undistortion.plane import PlaneView
from cubicfish_cli.undistortion.projections import (
    CrossView,
    CylindricalView,
    EpipolarCylindricalView,
    EpipolarEquirectangularView,
    EquidistantView,
    EquirectangularView,
    PerspectiveView,
    StereographicView,
    face_views,
)
from cubicfish_cli.undistortion.view import (
    Camera,
    CentralView,
    Rotation,
    View,
    is_numbers,
    rotation_from_angles,
)
from cubicfish_cli.wording import did_you_mean, quoted

MAX_DEFAULT_FIELD_DEG = 120.0
"""A flat picture of a wider field spends nearly all its pixels on the rim."""

CENTRAL_KINDS: Mapping[str, type[CentralView]] = {
    view.kind: view
    for view in (
        PerspectiveView,
        CylindricalView,
        EquirectangularView,
        EpipolarCylindricalView,
        EpipolarEquirectangularView,
        StereographicView,
        EquidistantView,
    )
}
_KINDS: Mapping[str, type[View]] = {
    **CENTRAL_KINDS,
    CrossView.kind: CrossView,
    PlaneView.kind: PlaneView,
}


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


def default_view(camera: Camera) -> PerspectiveView:
    """The view to use where nobody asks for another: flat, as large as the photo.

    It keeps the photo's scale on the camera's axis, unless the longer side would then span
    more than :data:`MAX_DEFAULT_FIELD_DEG` or than the camera's valid field.

    Raises:
        ViewError: the camera has no pixel about its axis, or its photos are too large.

    """
    widest = min(MAX_DEFAULT_FIELD_DEG, 2 * camera.max_angle_deg)
    least = max(camera.image_size) / 2 / math.tan(math.radians(widest) / 2)
    return PerspectiveView(size=camera.image_size, focal=max(axis_focal(camera), least))


def view_from_json(text: str) -> View:
    """The view that :meth:`View.to_json` wrote.

    Raises:
        ViewError: the text is not JSON, or not the record of a view.

    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise ViewError("the view is not JSON text") from problem
    if not isinstance(data, dict):
        raise ViewError("the view is not a JSON object")
    for key in ("kind", "size"):
        if key not in data:
            raise ViewError(f"the view has no {quoted(key)}")
    kind, size = data.pop("kind"), data.pop("size")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ViewError(
            f"unknown kind of view {quoted(kind)}: {did_you_mean(str(kind), sorted(_KINDS))}"
        )
    if not isinstance(size, list):
        raise ViewError("the view's size and rotation must be lists of numbers")
    return _KINDS[kind].from_parameters(tuple(size), data)  # type: ignore[arg-type]


Kind = Literal[
    "perspective",
    "cylindrical",
    "equirectangular",
    "epipolar-cylindrical",
    "epipolar-equirectangular",
    "stereographic",
    "equidistant",
]
Share = float | Literal["inner", "outer"]

_ENDS = {"inner": INNER, "outer": OUTER}
_LEAST_UNSEEN_DEG = 0.05  # what is printed is rounded to as much


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
        ViewError: something is asked twice, or the view is not one that can be rendered.

    """
    field = {"hfov_deg": hfov_deg, "vfov_deg": vfov_deg, "focal": focal, "fit": fit}
    return _fitted(camera, kind, size, rotate_deg, **field).view


def _fitted(
    camera: Camera,
    kind: str,
    size: Sequence[int] | None,
    rotate_deg: Sequence[float],
    **field: Any,
) -> Fitted:
    """See :func:`build_view`; ``field`` is its hfov_deg, vfov_deg, focal and fit."""
    if not isinstance(kind, str) or kind not in CENTRAL_KINDS:
        raise ViewError(
            f"unknown kind of view {quoted(kind)}: {did_you_mean(str(kind), sorted(CENTRAL_KINDS))}"
        )
    names = [name for name, value in field.items() if value is not None]
    if len(names) > 1 and (names != ["hfov_deg", "vfov_deg"] or size is not None):
        both = names + ["size"] * (names == ["hfov_deg", "vfov_deg"])
        raise ViewError(f"{' and '.join(both)} say the same thing twice: leave one out")
    make = CENTRAL_KINDS[kind]
    asked_size = None if size is None else _size(size)
    hfov_deg, vfov_deg = (
        _number(field[name], name, "degrees") for name in ("hfov_deg", "vfov_deg")
    )
    focal = _number(field["focal"], "focal", "pixels per radian")
    share = None if field["fit"] is None else _share(field["fit"])
    rotation = _rotation(rotate_deg)
    if issubclass(make, EquirectangularView) and asked_size is None and not names:
        return _fixed(cropped_view(camera, make, axis_focal(camera), rotation))
    whole = asked_size or camera.image_size
    if hfov_deg is not None:
        return _fixed(_with_hfov(make, hfov_deg, vfov_deg, whole, rotation))
    if vfov_deg is not None:
        return _fixed(make.with_field(vfov_deg, whole, rotation, vertical=True))
    if focal is not None:
        return _fixed(make(size=whole, focal=focal, rotation=rotation))
    if share is None and make is PerspectiveView:
        default = default_view(camera)
        scaled = default.focal * whole[0] / default.size[0]
        return _fixed(make(size=whole, focal=scaled, rotation=rotation))
    fitted = fit_view(camera, make, whole, rotation, share=OUTER if share is None else share)
    if share is None and issubclass(make, CylindricalView) and fitted.at_limit:
        # All round, for the sake of what is nearly overhead, is not what anyone means.
        least = axis_focal(camera) * whole[0] / camera.image_size[0]
        return _fixed(make(size=whole, focal=max(fitted.view.focal, least), rotation=rotation))
    return fitted


def _rotation(rotate_deg: Sequence[float]) -> Rotation:
    yaw, pitch, roll = _numbers(rotate_deg, "rotate_deg", "(yaw, pitch, roll) in degrees", 3)
    return rotation_from_angles(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)


def _fixed(view: CentralView) -> Fitted:
    return Fitted(view=view, at_limit=False)


def _with_hfov(
    kind: type[CentralView],
    hfov_deg: float,
    vfov_deg: float | None,
    size: tuple[int, int],
    rotation: Rotation,
) -> CentralView:
    view = kind.with_field(hfov_deg, size, rotation)
    if vfov_deg is None:
        return view
    one = kind.with_field(vfov_deg, (1, 1), vertical=True)  # its focal is 1 / height
    height = max(1, round(view.focal / one.focal))
    return kind(size=(size[0], height), focal=view.focal, rotation=rotation)


def _share(fit: Share) -> float:
    if isinstance(fit, str) and fit in _ENDS:
        return _ENDS[fit]
    share = _numbers([fit], "fit", "'inner', 'outer' or a share from 0 to 1", 1)[0]
    if not 0 <= share <= 1:
        raise ViewError(f"fit must be 'inner', 'outer' or a share from 0 to 1, not {quoted(fit)}")
    return share


def _size(size: Sequence[int]) -> tuple[int, int]:
    width, height = _numbers(size, "size", "(width, height) in whole pixels", 2)
    if width != round(width) or height != round(height):
        raise ViewError(f"size must be (width, height) in whole pixels, not {quoted(size)}")
    return round(width), round(height)


def _number(value: float | None, name: str, unit: str) -> float | None:
    return None if value is None else _numbers([value], name, f"a number of {unit}", 1)[0]


def _numbers(value: Sequence[float | str], name: str, what: str, count: int) -> tuple[float, ...]:
    """Finite numbers of any kind, numpy's among them, as Python has them."""
    try:
        numbers = () if isinstance(value, str) else tuple(float(part) for part in value)
        text = any(isinstance(part, str) for part in value)
    except (TypeError, ValueError, OverflowError):
        numbers, text = (), False
    if text or not is_numbers(numbers, count):
        shown = value[0] if count == 1 else value
        raise ViewError(f"{name} must be {what}, not {quoted(shown)}")
    return numbers


@dataclass(frozen=True, kw_only=True)
class SeenField:
    """What a camera sees of a view: a fisheye's round picture seldom fills it.

    Attributes:
        field_deg: of the view, across and down.
        seen_deg: what the camera sees of it, along the view's middle row and column.

    """

    field_deg: tuple[float, float]
    seen_deg: tuple[float, float]

    @property
    def is_whole(self) -> bool:
        """Whether the camera sees all of it."""
        return all(
            field - seen < _LEAST_UNSEEN_DEG
            for field, seen in zip(self.field_deg, self.seen_deg, strict=True)
        )

    def describe(self) -> str:
        """``191.2° of 231.7° across, all 173.7° down``."""
        return ", ".join(
            f"all {field:.1f}° {way}"
            if field - seen < _LEAST_UNSEEN_DEG
            else f"{seen:.1f}° of {field:.1f}° {way}"
            for seen, field, way in zip(
                self.seen_deg, self.field_deg, ("across", "down"), strict=True
            )
        )


@dataclass(frozen=True, kw_only=True)
class ChosenView:
    """What is rendered.

    Attributes:
        views: name of the part -> view; one part named "" unless it is a cube in six pictures.
        at_limit: whether the camera sees more than the fitted view can show.
        unit: of length, of a plane's picture.

    """

    views: Mapping[str, View]
    at_limit: bool = False
    unit: str = "unit"

    @property
    def first(self) -> View:
        """The view, or a cube's front."""
        return next(iter(self.views.values()))

    def describe(self) -> str:
        """A view in a few words."""
        width, height = self.first.size
        if len(self.views) > 1:
            return f"the six faces of a cube, {width}x{height} pixels each"
        first = self.first
        words = first.scale_in(self.unit) if isinstance(first, PlaneView) else first.describe()
        return f"{width}x{height} pixels, {words}"

    def seen_by(self, camera: Camera) -> SeenField | None:
        """What a camera sees of the view's field; None of a cube and of a plane."""
        if len(self.views) > 1 or not isinstance(self.first, CentralView):
            return None
        field = (self.first.hfov_deg, self.first.vfov_deg)
        return SeenField(field_deg=field, seen_deg=seen_field_deg(camera, self.first))

    def kept_share(self, camera: Camera) -> float | None:
        """Share of what a camera sees, of the solid angle, that the views keep; None of a plane."""
        if isinstance(self.first, PlaneView):
            return None
        return min(1.0, sum(kept_share(camera, view) for view in self.views.values()))

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON; of a cube in six pictures the first face, and all their names."""
        first = self.first
        record = {**json.loads(first.to_json()), "words": self.describe(), "cut": self.at_limit}
        if len(self.views) > 1:
            return {**record, "parts": list(self.views)}
        if isinstance(first, CentralView):
            return {**record, "hfov_deg": first.hfov_deg, "vfov_deg": first.vfov_deg}
        return record


def chosen_view(
    camera: Camera,
    kind: str,
    *,
    cross: bool = False,
    size: tuple[int, int] | None = None,
    rotate_deg: Sequence[float] = (0.0, 0.0, 0.0),
    **field: Any,
) -> ChosenView:
    """The view of a kind, or of a cube, for a camera.

    Args:
        camera: the camera.
        kind: a kind of :data:`CENTRAL_KINDS`, or ``cube``.
        cross: whether a cube is one picture.
        size: of the picture, or of a cube's faces; None for the photo's, or its scale.
        rotate_deg: yaw, pitch and roll.
        field: ``hfov_deg``, ``vfov_deg``, ``focal`` and ``fit`` of :func:`build_view`.

    Raises:
        ViewError: the view is not one that can be rendered.

    """
    if kind == "cube":
        return _cube(camera, size, _rotation(rotate_deg), cross=cross)
    fitted = _fitted(camera, kind, size, rotate_deg, **field)
    return ChosenView(views={"": fitted.view}, at_limit=fitted.at_limit)


def _cube(
    camera: Camera, size: tuple[int, int] | None, rotation: Rotation, *, cross: bool
) -> ChosenView:
    side = max(1, round(2 * axis_focal(camera)))  # keeps the photo's scale on the axis
    if cross:
        return ChosenView(
            views={"": CrossView(size=size or (4 * side, 3 * side), rotation=rotation)}
        )
    if size is not None and size[0] != size[1]:
        raise ViewError("a cube's faces are square: give the size as NxN")
    return ChosenView(views=face_views(size[0] if size else side, rotation))
