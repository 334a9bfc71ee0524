"""Grey PNG files with transparency, which OpenCV reads as four channels and cannot write."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from cubicfish_cli.photos import Picture

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY_WITH_ALPHA = 4
_UP = 2  # each row less the one above it, which suits photos
_LEVEL = 4


def is_grey_with_alpha(data: bytes) -> bool:
    """Whether a file is a PNG of grey and transparency."""
    return data.startswith(_SIGNATURE) and data[25:26] == bytes([_GREY_WITH_ALPHA])


def encode_grey_with_alpha(picture: Picture) -> bytes:
    """A picture (H, W, 4) of uint8 or uint16 whose colours are grey -> a PNG of two channels.

    The format is that of the PNG specification, sections 9 to 11 (filters, compression, chunks).
    """
    height, width = picture.shape[:2]
    bits = 8 * picture.dtype.itemsize
    two = np.ascontiguousarray(picture[:, :, [0, 3]]).astype(f">u{bits // 8}")
    rows = two.reshape(height, -1).view(np.uint8)
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # in bytes, modulo 256
    header = struct.pack(">IIBBBBB", width, height, bits, _GREY_WITH_ALPHA, 0, 0, 0)
    chunks = (
        (b"IHDR", header),
        (b"IDAT", zlib.compress(filtered.tobytes(), _LEVEL)),
        (b"IEND", b""),
    )
    return _SIGNATURE + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)
