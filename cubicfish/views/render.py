"""Map or camera, and a picture -> the view of it, of the same depth and with the same channels."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.errors import ViewError
from cubicfish.models.cubic import CubicCamera
from cubicfish.photos.photos import refuse_no_picture
from cubicfish.views.choose import build_view
from cubicfish.views.maps import UndistortMap, build_map
from cubicfish.views.options import Interpolation
from cubicfish.views.view import Camera, PointProjector, View
from cubicfish.wording import quoted

# Pixels of a view whose map, of nine bytes per pixel, is in memory at a time.
_BAND_PIXELS = 4_000_000
_KINDS = (np.uint8, np.uint16, np.float32)


def undistort(
    picture: npt.NDArray[Any],
    by: Camera | PointProjector | UndistortMap,
    view: View | None = None,
    *,
    interpolation: Interpolation = "linear",
) -> npt.NDArray[Any]:
    """Render a view from a photo.

    For many photos, make the map once with :func:`build_map` and pass it instead of the camera. Of
    a camera, the map of a large view is never in memory as a whole.

    Args:
        picture: (H, W) or (H, W, 1 to 4), uint8, uint16 or float32, of the size that the camera
            was calibrated for or an exact rescale of it (a map takes its own size alone).
        by: the camera, or a map.
        view: what to render; by default flat, as large as the photo and with the photo's scale in
            its middle, up to 120° across.
        interpolation: how pixels are interpolated.

    Returns:
        (h, w) or (h, w, channels), of the view's size and the picture's dtype.

    Raises:
        ViewError: the picture is not one that the camera or the map is for, or an option is not
            known.

    """
    refuse_no_picture(picture, "the picture", ViewError, kinds=_KINDS)
    whole = np.ascontiguousarray(picture)
    if not isinstance(by, UndistortMap):
        flat = _render_in_bands(whole, by, view, interpolation)
    elif view is None:
        flat = by.render(whole, interpolation)
    else:
        raise ViewError("a map has its view already: leave the view out, or pass the camera")
    return flat.reshape((*flat.shape[:2], *picture.shape[2:]))


def _render_in_bands(
    picture: npt.NDArray[Any], camera: Any, view: View | None, interpolation: Interpolation
) -> npt.NDArray[Any]:
    """Render a view some rows after the others."""
    if isinstance(camera, CubicCamera):
        camera = camera.for_photos((picture.shape[1], picture.shape[0]))
    elif not hasattr(camera, "project") or not hasattr(camera, "image_size"):
        given = quoted(camera) if isinstance(camera, str | Path) else f"a {type(camera).__name__}"
        raise ViewError(
            f"{given} is neither a camera nor a map: load_camera(...).camera is a camera"
        )
    view = build_view(camera) if view is None else view
    width, height = view.size
    step = max(1, _BAND_PIXELS // width)
    bands = [range(top, min(height, top + step)) for top in range(0, height, step)]
    if len(bands) == 1:
        return build_map(camera, view).render(picture, interpolation)
    flat = np.empty((height, width, *picture.shape[2:]), picture.dtype)
    for rows in bands:
        band = build_map(camera, view, rows).render(picture, interpolation)
        flat[rows.start : rows.stop] = band.reshape(flat[rows.start : rows.stop].shape)
    return flat
