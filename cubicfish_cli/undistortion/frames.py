"""A camera for photos that are an exact rescale or a stated crop of the calibrated ones.

A pixel's centre is at its whole coordinates, so a photo scaled by s has pixel (x + 1/2)·s − 1/2
where the original has x. Leaving the half out shifts a half-size picture by a quarter pixel.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.wording import quoted


@dataclass(frozen=True, kw_only=True)
class Crop:
    """A part of a photo.

    Attributes:
        x, y: the pixel of the whole photo that became pixel (0, 0).
        width, height: its size, in the whole photo's pixels.

    """

    x: int
    y: int
    width: int
    height: int


def parse_crop(text: str) -> Crop:
    """``WIDTHxHEIGHT+X+Y`` -> Crop.

    Raises:
        ViewError: the text is not that.

    """
    match = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})\+([0-9]{1,6})\+([0-9]{1,6})", text.strip())
    if match is None:
        raise ViewError(
            f"a crop is WIDTHxHEIGHT+X+Y in pixels of the whole photo, not {quoted(text)}: "
            "such as 640x480+320+160"
        )
    width, height, x, y = map(int, match.groups())
    return Crop(x=x, y=y, width=width, height=height)


def calibrated_pixels(
    pixel: npt.NDArray[np.float64],
    calibrated_size: tuple[int, int],
    size: tuple[int, int],
    crop: Crop | None = None,
) -> npt.NDArray[np.float64]:
    """Pixels (N, 2) of photos of ``size`` -> pixels (N, 2) of the photo as calibrated.

    The way back from the photos that :func:`camera_for_photos` makes a camera for.
    """
    width, start = (crop.width, (crop.x, crop.y)) if crop else (calibrated_size[0], (0, 0))
    return (pixel + 0.5) * (width / size[0]) - 0.5 + np.array(start)


def camera_for_photos(
    camera: CubicCamera, size: tuple[int, int], crop: Crop | None = None
) -> CubicCamera:
    """The camera of photos of ``size``: the calibrated size, or of the same shape.

    Args:
        camera: for the whole photos as they were calibrated.
        size: (width, height) of the photos at hand.
        crop: what part of the whole photo they show; then ``size`` is the part's, or of its
            shape.

    Raises:
        ViewError: the photos are neither, or the crop is not within the whole photo.

    """
    width, height = camera.image_size
    if crop is None:
        crop = Crop(x=0, y=0, width=width, height=height)
        whole = f"the camera was calibrated for {width}x{height}"
        advice = (
            "use photos of that size or of exactly that shape, or say with --crop what part of "
            "the photo they are"
        )
    else:
        if not (crop.width and crop.height) or (
            crop.x + crop.width > width or crop.y + crop.height > height
        ):
            raise ViewError(
                f"the crop {crop.width}x{crop.height}+{crop.x}+{crop.y} does not lie within the "
                f"calibrated photo of {width}x{height}"
            )
        whole = f"the crop is {crop.width}x{crop.height}"
        advice = "use photos of that size or of exactly that shape"
    if size[0] * crop.height != size[1] * crop.width:
        raise ViewError(f"the photo has {size[0]}x{size[1]} pixels, {whole}: {advice}")
    scale = size[0] / crop.width
    if scale == 1 and (crop.x, crop.y) == (0, 0) and size == camera.image_size:
        return camera
    shift_x, shift_y = (scale * (0.5 - start) - 0.5 for start in (crop.x, crop.y))
    affine = np.array([[scale, 0, shift_x], [0, scale, shift_y], [0, 0, 1]])
    radial = camera.radial
    return replace(
        camera,
        image_size=size,
        P=affine @ camera.P,
        radial=RadialCamera(
            image_size=size,
            fx=scale * radial.fx,
            fy=scale * radial.fy,
            cx=scale * radial.cx + shift_x,
            cy=scale * radial.cy + shift_y,
            k=radial.k,
        ),
    )
