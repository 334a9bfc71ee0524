"""HEIC pictures of phones: read with the extra ``heif``.

Such a file says how it is to be turned, and its decoder does so: unlike in other pictures, that is
how the phone was held.
"""

import re
import struct
from importlib.util import find_spec
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

SUFFIXES = (".heic", ".heif", ".hif")
_BRANDS = re.compile(rb"he[iv][a-z]|mif1|msf1")


def can_be_read() -> bool:
    """Whether the extra is installed."""
    return find_spec("pillow_heif") is not None


def is_heic(data: bytes) -> bool:
    """Whether a file begins as HEIC, and not as AVIF, of the same family."""
    if data[4:8] != b"ftyp":
        return False
    brands = brands_of(data)
    return bool(_BRANDS.search(brands)) and b"avi" not in brands


def brands_of(data: bytes) -> bytes:
    """Of a file that begins with ``ftyp``: the first brand, and those it is compatible to."""
    return data[8 : min(len(data), 64, struct.unpack_from(">I", data)[0])]


def size_of(data: bytes) -> tuple[int, int] | None:
    """(width, height) by the header; None where it is damaged."""
    try:
        width, height = _open(data).size
    except (ValueError, RuntimeError, EOFError, OSError, SyntaxError):
        return None
    return int(width), int(height)


def decoded(data: bytes) -> npt.NDArray[Any] | None:
    """The picture (H, W[, 3 or 4]), 8 or 16 bit, BGR order; None where it is damaged."""
    try:
        picture = np.array(_open(data))
    except (ValueError, RuntimeError, EOFError, OSError, SyntaxError):
        return None
    if picture.ndim == 2:
        return picture
    code = cv2.COLOR_RGBA2BGRA if picture.shape[2] == 4 else cv2.COLOR_RGB2BGR
    return np.asarray(cv2.cvtColor(picture, code))


def _open(data: bytes) -> Any:
    import pillow_heif

    return pillow_heif.open_heif(data, convert_hdr_to_8bit=False)
