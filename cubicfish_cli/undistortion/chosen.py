"""What is rendered of a photo: one view, or the six of a cube; and what the camera sees of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cubicfish_cli.errors import ViewError
from cubicfish_cli.undistortion.choose import choose_view
from cubicfish_cli.undistortion.cube import CrossView, face_views
from cubicfish_cli.undistortion.fit import kept_share, seen_field_deg
from cubicfish_cli.undistortion.plane import PlaneView
from cubicfish_cli.undistortion.view import Camera, CentralView, Rotation, View
from cubicfish_cli.undistortion.views import CENTRAL_KINDS, axis_focal, rotation_from_angles

_LEAST_UNSEEN_DEG = 0.05  # what is printed is rounded to as much


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

    def kept_share(self, camera: Camera) -> float:
        """Share of what a camera sees, of the solid angle, that the views keep."""
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
    rotate_deg: tuple[float, float, float],
    *,
    size: tuple[int, int] | None,
    cross: bool = False,
    **field: float | None,
) -> ChosenView:
    """The view of a kind, or of a cube, for a camera.

    Args:
        camera: the camera.
        kind: a kind of :data:`CENTRAL_KINDS`, or ``cube``.
        rotate_deg: yaw, pitch and roll.
        size: of the picture, or of a cube's faces; None for the photo's, or its scale.
        cross: whether a cube is one picture.
        field: ``hfov_deg``, ``vfov_deg``, ``focal`` and ``share`` as :func:`choose_view` has them.

    Raises:
        ViewError: the view is not one that can be rendered.

    """
    yaw, pitch, roll = rotate_deg
    rotation = rotation_from_angles(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    if kind == "cube":
        return _cube(camera, size, rotation, cross=cross)
    asked = {name: field.get(name) for name in ("hfov_deg", "vfov_deg", "focal", "share")}
    fitted = choose_view(camera, CENTRAL_KINDS[kind], size=size, rotation=rotation, **asked)
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
