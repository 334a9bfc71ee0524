"""All kinds of views: their registry, their records, and the default view."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np

from cubicfish_cli.errors import ViewError
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
)
from cubicfish_cli.undistortion.view import (
    Camera,
    CentralView,
    View,
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
