"""Small copies of pictures, as pages hold them."""

from base64 import b64encode
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt


def thumbnail(picture: npt.NDArray[Any], longest: int) -> npt.NDArray[np.uint8]:
    """A copy whose longer side has at most so many pixels: 8 bits, grey or BGR.

    Args:
        picture: (H, W) or (H, W, 1 to 4), 8 or 16 bits; transparency is dropped.
        longest: pixels.

    """
    if picture.ndim == 3:
        picture = picture[..., 0] if picture.shape[2] < 3 else picture[..., :3]
    height, width = picture.shape[:2]
    scale = min(1.0, longest / max(width, height))
    if scale < 1:
        size = (max(1, round(scale * width)), max(1, round(scale * height)))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    if picture.dtype == np.uint16:
        picture = picture // 257
    return np.ascontiguousarray(picture, np.uint8)


def data_uri(picture: npt.NDArray[np.uint8], quality: int) -> str:
    """A picture, grey or BGR, as the URI of a JPEG file that a page holds."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return "data:image/jpeg;base64," + b64encode(data.tobytes()).decode()
