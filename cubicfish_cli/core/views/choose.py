"""Views from the options asked for, and what the camera sees of them.

All kinds of views: their registry, and their records.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.core.errors import UsageError, ViewError
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.views.fit import cropped_view, fit_view, lost_shares, seen_field_deg
from cubicfish_cli.core.views.options import KINDS, OUTER, Kind, Share, ViewOptions
from cubicfish_cli.core.views.plane import PlaneView
from cubicfish_cli.core.views.projections import (
    CylindricalView,
    EpipolarCylindricalView,
    EpipolarEquirectangularView,
    EquidistantView,
    EquirectangularView,
    PerspectiveView,
    StereographicView,
    face_views,
)
from cubicfish_cli.core.views.view import (
    Camera,
    CentralView,
    Rotation,
    View,
    rotation_from_angles,
)

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
        UsageError: something is asked twice, or is nothing that such a view has.
        ViewError: the camera shows no such view.

    """
    asked: dict[str, Any] = {
        "kind": kind,
        "size": size,
        "hfov_deg": hfov_deg,
        "vfov_deg": vfov_deg,
        "focal": focal,
        "fit": fit,
        "rotate_deg": rotate_deg,
    }
    if kind == "cube":
        raise UsageError("a cube is several views: ask for it by ViewOptions(kind='cube')")
    return _central(camera, ViewOptions(**asked))[0]


def _central(camera: Camera, asked: ViewOptions) -> tuple[CentralView, bool]:
    """The view, and whether the camera sees more than it can show."""
    make = CENTRAL_KINDS[asked.kind or KINDS[0]]
    rotation, whole = _rotation(asked), asked.size or camera.image_size
    scale = whole[0] / camera.image_size[0]
    if issubclass(make, EquirectangularView) and asked.leaves_field_open:
        return cropped_view(camera, make, axis_focal(camera), rotation), False
    if asked.hfov_deg is not None:
        view = make.with_field(asked.hfov_deg, whole, rotation)
        if asked.vfov_deg is None:
            return view, False
        one = make.with_field(asked.vfov_deg, (1, 1), vertical=True)  # its focal is 1 / height
        return replace(view, size=(whole[0], max(1, round(view.focal / one.focal)))), False
    if asked.vfov_deg is not None:
        return make.with_field(asked.vfov_deg, whole, rotation, vertical=True), False
    if asked.focal is not None:
        return make(size=whole, focal=asked.focal, rotation=rotation), False
    if asked.fit is None and make is PerspectiveView:
        widest = min(MAX_DEFAULT_FIELD_DEG, 2 * camera.max_angle_deg)
        least = max(camera.image_size) / 2 / math.tan(math.radians(widest) / 2)
        focal = max(axis_focal(camera), least) * scale
        return make(size=whole, focal=focal, rotation=rotation), False
    share = OUTER if asked.fit is None else float(asked.fit)
    view, at_limit = fit_view(camera, make, whole, rotation, share=share)
    if asked.fit is None and issubclass(make, CylindricalView) and at_limit:
        # All round, for the sake of what is nearly overhead, is not what anyone means.
        return replace(view, focal=max(view.focal, axis_focal(camera) * scale)), False
    return view, at_limit


def _rotation(asked: ViewOptions) -> Rotation:
    yaw, pitch, roll = asked.rotate_deg
    return rotation_from_angles(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)


@dataclass(frozen=True, kw_only=True)
class SeenField:
    """What a camera sees of a view: a fisheye's round picture seldom fills it.

    Attributes:
        field_deg: of the view, across and down.
        seen_deg: what the camera sees of it, along the view's middle row and column.
        uncalibrated: share of what the photos show that lies beyond the camera's cone.
        cut_off: share of it that lies beyond the view's edges; 0 where the field was asked for.

    """

    field_deg: tuple[float, float]
    seen_deg: tuple[float, float]
    uncalibrated: float = 0.0
    cut_off: float = 0.0

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
        views: name of the part -> view; one part named "" unless it is a cube.
        at_limit: whether the camera sees more than the fitted view can show.
        unit: of length, of a plane's picture.
        asked_field: whether its field is what somebody asked for.

    """

    views: Mapping[str, View]
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
        first = self.first
        words = first.scale_in(self.unit) if isinstance(first, PlaneView) else first.describe()
        return f"{width}x{height} pixels, {words}"

    def seen_by(self, camera: Camera) -> SeenField | None:
        """What a camera sees of the view's field; None of a cube and of a plane."""
        if len(self.views) > 1 or not isinstance(self.first, CentralView):
            return None
        field = (self.first.hfov_deg, self.first.vfov_deg)
        seen = SeenField(field_deg=field, seen_deg=seen_field_deg(camera, self.first))
        if self.asked_field or not isinstance(camera, CubicCamera):
            return seen
        uncalibrated, cut_off = lost_shares(camera, self.first)
        return replace(seen, uncalibrated=uncalibrated, cut_off=cut_off)

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
        ViewError: the view is not one that can be rendered.

    """
    if isinstance(asked, View):
        return ChosenView(views={"": asked})
    asked = asked or ViewOptions()
    if asked.kind == "cube":
        return ChosenView(views=_cube(camera, asked))
    view, at_limit = _central(camera, asked)
    numbers = (asked.hfov_deg, asked.vfov_deg, asked.focal, *filter(None, asked.rotate_deg))
    asked_field = any(number is not None for number in numbers)
    return ChosenView(views={"": view}, at_limit=at_limit, asked_field=asked_field)


def _cube(camera: Camera, asked: ViewOptions) -> Mapping[str, View]:
    side = max(1, round(2 * axis_focal(camera)))  # keeps the photo's scale on the axis
    rotation = _rotation(asked)
    return face_views(asked.size[0] if asked.size else side, rotation)
