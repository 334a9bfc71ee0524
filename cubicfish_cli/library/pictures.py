"""A picture and a camera -> the undistorted picture."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.undistortion.frames import camera_for_photos
from cubicfish_cli.undistortion.images import INTERPOLATIONS, Rendering, remap_picture
from cubicfish_cli.undistortion.maps import UndistortMap, build_map
from cubicfish_cli.undistortion.view import View, is_numbers
from cubicfish_cli.undistortion.views import default_view
from cubicfish_cli.wording import did_you_mean, quoted

Image = npt.NDArray[Any]
Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]


def undistort(
    picture: Image,
    by: CubicCamera | UndistortMap,
    view: View | None = None,
    *,
    interpolation: Interpolation = "linear",
    border: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Image:
    """Render a view from a photo, as ``cubicfish undistort`` does.

    For many photos make the map once with :func:`build_map` and pass it instead of the camera.

    Args:
        picture: (H, W) or (H, W, 1 to 4), uint8, uint16 or float32, of the size that the camera
            was calibrated for or an exact rescale of it (a map takes its own size alone).
        by: the camera, or a map.
        view: what to render; by default flat, as large as the photo and with the photo's scale in
            its middle, up to 120° across.
        interpolation: how pixels are blended.
        border: (red, green, blue) of what the camera does not see, 0 to 1; pictures are BGR.

    Returns:
        (h, w) or (h, w, channels), of the view's size and the picture's dtype.

    Raises:
        ViewError: the picture is not one that the camera or the map is for, or an option is not
            known.

    """
    _refuse_no_picture(picture)
    rendering = rendering_of(interpolation, border)
    if isinstance(by, UndistortMap):
        if view is not None:
            raise ViewError("a map has its view already: leave the view out, or pass the camera")
        undistort_map = by
    else:
        camera = camera_for_photos(by, (picture.shape[1], picture.shape[0]))
        undistort_map = build_map(camera, default_view(camera) if view is None else view)
    flat = remap_picture(np.ascontiguousarray(picture), undistort_map, rendering)
    return flat.reshape((*flat.shape[:2], *picture.shape[2:]))


def rendering_of(
    interpolation: Interpolation, border: tuple[float, float, float], quality: int | None = None
) -> Rendering:
    """How pixels are made, checked.

    Raises:
        ViewError: an option is not known.

    """
    if interpolation not in INTERPOLATIONS:
        raise ViewError(
            f"interpolation {quoted(interpolation)} is not known: "
            f"{did_you_mean(str(interpolation), INTERPOLATIONS)}"
        )
    colour = tuple(border)
    if not is_numbers(colour, 3) or not all(0 <= part <= 1 for part in colour):
        raise ViewError(f"border must be three numbers from 0 to 1, not {quoted(colour)}")
    if quality is not None and quality not in range(1, 101):
        raise ViewError(f"quality must be a whole number from 1 to 100, not {quoted(quality)}")
    border = (colour[0], colour[1], colour[2])
    return Rendering(interpolation=interpolation, border=border, quality=quality)


def _refuse_no_picture(picture: object) -> None:
    if not isinstance(picture, np.ndarray):
        raise ViewError(f"the picture is no array but {type(picture).__name__}: read it first")
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and not 1 <= picture.shape[2] <= 4):
        raise ViewError(f"the picture has the shape {picture.shape}, not (H, W) or (H, W, 1 to 4)")
    if picture.dtype not in (np.uint8, np.uint16, np.float32):
        raise ViewError(f"the picture holds {picture.dtype} numbers, not uint8, uint16 or float32")
    if not picture.size:
        raise ViewError(f"the picture has the shape {picture.shape}: it is empty")
