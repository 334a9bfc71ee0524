"""A decoded frame: its brightness, and its picture in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cubicfish_cli.app.films.measure import Grey
from cubicfish_cli.core.errors import OutputError
from cubicfish_cli.core.files import whole_file

# Compressing a picture well takes as long as decoding twenty.
_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # OpenCV 4.12 and later
    _FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]


def brightness(frame: Any) -> Grey:
    """Grey levels (H, W) of a frame of PyAV, as they are stored where they are: uint8 or uint16."""
    kind = frame.format
    alone = len(kind.components) == 1 or (kind.is_planar and not kind.is_rgb)
    if not alone or kind.has_palette or kind.is_big_endian or kind.is_bit_stream:
        return np.asarray(frame.to_ndarray(format="gray"))
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8 if kind.components[0].bits <= 8 else "<u2")
    return np.asarray(rows.reshape(plane.height, -1)[:, : plane.width])


def write_frame(path: Path, frame: Any) -> None:
    """Write a frame as a PNG of 8 bits, grey where the film is grey.

    Raises:
        OutputError: it cannot be written.

    """
    grey = frame.format.name.startswith("gray")
    picture = frame.to_ndarray(format="gray" if grey else "bgr24")
    done, data = cv2.imencode(".png", picture, _FAST)
    if not done:
        raise OutputError(f"{path} cannot be written: a frame is no picture")
    with whole_file(path, overwrite=True) as temporary:
        temporary.write_bytes(data.tobytes())
