"""Pictures -> files of the same nature as their photos' files.

Metadata of a JPEG file go into the picture that is made from it: the EXIF record (orientation,
time, place, lens), the colour profile and the quantisation tables. No reader finds the thumbnail in
that record, since it would show the old picture.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import CubicfishError, OutputError, shown
from cubicfish.files import write_files
from cubicfish.photos import PictureFile

# What each kind of file can hold: bits per channel, and channels (4 is with transparency). 32 bits
# are floating point numbers.
_EIGHT, _EIGHT_OR_SIXTEEN = (8,), (8, 16)
_HOLDS = {
    ".png": (_EIGHT_OR_SIXTEEN, (1, 3, 4)),
    ".tif": ((8, 16, 32), (1, 3, 4)),
    ".tiff": ((8, 16, 32), (1, 3, 4)),
    ".jpg": (_EIGHT, (1, 3)),
    ".jpeg": (_EIGHT, (1, 3)),
    ".bmp": (_EIGHT, (1, 3)),
    ".webp": (_EIGHT, (3, 4)),
    ".pgm": (_EIGHT_OR_SIXTEEN, (1,)),
    ".ppm": (_EIGHT_OR_SIXTEEN, (3,)),
}


_TIFF_LZW = 5


@contextmanager
def naming(source: Path) -> Iterator[None]:
    """Begin the errors inside with the name of the photo or video."""
    try:
        yield
    except CubicfishError as problem:
        raise type(problem)(str(problem), about=shown(source), apart=True) from problem


def part_name(path: Path, part: str) -> Path:
    """``flat.png`` and ``front`` -> ``flat_front.png``; as it is for a view of one part."""
    return path.with_name(f"{path.stem}_{part}{path.suffix}") if part else path


def check_suffix(path: Path) -> None:
    """Raise :class:`OutputError` when pictures cannot be written under this name."""
    if path.suffix.lower() not in _HOLDS:
        raise OutputError(
            f"{shown(path)}: pictures are written as {', '.join(sorted(_HOLDS))}: "
            "choose a name that ends in one of these"
        )


def write_picture(path: Path, picture: npt.NDArray[Any], *, overwrite: bool) -> None:
    """Write a picture (H, W[, 3 or 4]), BGR order, as its suffix says.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, cannot be written, or is of a
            kind that cannot hold the picture.

    """
    path = Path(path)
    write_files({path: encode_picture(path, picture)}, overwrite=overwrite)


def encode_picture(
    path: Path, picture: npt.NDArray[Any], *, quality: int | None = None, like: bytes = b""
) -> bytes:
    """A picture (H, W[, 3 or 4]) of uint8, uint16 or float32 as the bytes of its file.

    Args:
        path: where it will be; its suffix says what kind of file.
        picture: in BGR order.
        quality: quality of a JPEG or lossy WebP file; None takes that of ``like``, or else 95 for a
            JPEG file and no loss for a WebP file.
        like: the content of the file that it was made from; empty for none.

    Raises:
        OutputError: this kind of file cannot hold the picture.

    """
    check_suffix(path)
    suffix = path.suffix.lower()
    depths, channels = _HOLDS[suffix]
    depth = 8 * picture.dtype.itemsize
    channel_count = 1 if picture.ndim == 2 else picture.shape[2]
    if depth not in depths or channel_count not in channels:
        kind = {1: "grey", 3: "colour", 4: "colour and transparency"}.get(
            channel_count, f"{channel_count} channels"
        )
        raise OutputError(
            f"{shown(path)}: a {path.suffix} file cannot hold {kind} of {depth} bits: "
            f"write {'.tif' if depth == 32 else '.png or .tif'}"
        )
    options: list[int] = []
    segments = b""
    if suffix in (".jpg", ".jpeg"):
        options, segments = jpeg_like(like, quality)
    elif suffix == ".webp" and quality is not None:
        options = [cv2.IMWRITE_WEBP_QUALITY, quality]
    elif depth == 32:  # without it some versions of OpenCV write LogLuv, which loses
        options = [cv2.IMWRITE_TIFF_COMPRESSION, _TIFF_LZW]
    return with_segments(PictureFile.of(path, picture, options).data, segments)


DEFAULT_QUALITY = 95

_APP0, _APP1, _APP2, _DQT = 0xE0, 0xE1, 0xE2, 0xDB
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_PROGRESSIVE = 0xC2
_EXIF, _PROFILE = b"Exif\0\0", b"ICC_PROFILE\0"
_SAMPLINGS = {0x111111, 0x211111, 0x221111, 0x121111, 0x411111}


def jpeg_like(data: bytes, quality: int | None = None) -> tuple[list[int], bytes]:
    """Find the options and segments that make a JPEG file like another one.

    Args:
        data: the content of the other file; one that is no JPEG gives nothing.
        quality: 1 to 100; None takes that of the standard tables that are nearest to the file's.

    Returns:
        Options for ``cv2.imencode``; and the file's EXIF record and colour profile, as segments.

    """
    kept, nearest, options = b"", DEFAULT_QUALITY, []
    try:
        for marker, body in PictureFile(path=Path(), data=data).segments():
            if marker == _DQT:
                tables = dict(_read_tables(body))
                nearest = _find_quality(tables[0]) if 0 in tables else nearest
            elif marker in _FRAMES:
                options += _find_sampling(body)
                if marker == _PROGRESSIVE:
                    options += [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
            elif (marker == _APP1 and body.startswith(_EXIF)) or (
                marker == _APP2 and body.startswith(_PROFILE)
            ):
                kept += _write_segment(marker, _cut_thumbnail(body))
    except (struct.error, IndexError):  # damaged here, but its pixels may be whole
        pass
    return [cv2.IMWRITE_JPEG_QUALITY, quality or nearest, *options], kept


def with_segments(data: bytes, segments: bytes) -> bytes:
    """A JPEG file with further segments, where readers expect them."""
    if not segments:
        return data
    at = 2
    if data[2:4] == bytes([0xFF, _APP0]):
        at = 4 + int(struct.unpack_from(">H", data, 4)[0])
    return data[:at] + segments + data[at:]


def _write_segment(marker: int, body: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body


def _read_tables(body: bytes) -> Iterator[tuple[int, tuple[int, ...]]]:
    at = 0
    while at < len(body):
        wide, number = divmod(body[at], 16)
        kind, size = (">64H", 128) if wide else (">64B", 64)
        yield number, struct.unpack_from(kind, body, at + 1)
        at += 1 + size


def _find_sampling(body: bytes) -> list[int]:
    """The option that samples colours as a file's frame says; none where that is unusual."""
    if body[5] != 3:
        return []
    factors = body[7] << 16 | body[10] << 8 | body[13]
    return [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factors] if factors in _SAMPLINGS else []


@cache
def _make_tables() -> np.ndarray:
    """(100, 64): the brightness table that the encoder uses for each quality from 1 on."""
    dot = np.zeros((8, 8), np.uint8)
    tables = []
    for quality in range(1, 101):
        made = PictureFile.of(Path("dot.jpg"), dot, [cv2.IMWRITE_JPEG_QUALITY, quality])
        body = next(body for marker, body in made.segments() if marker == _DQT)
        tables.append(dict(_read_tables(body))[0])
    return np.array(tables)


def _find_quality(table: tuple[int, ...]) -> int:
    return 1 + int(np.abs(_make_tables() - np.array(table)).sum(axis=1).argmin())


def _cut_thumbnail(body: bytes) -> bytes:
    """An EXIF record whose first directory is its last: a second leads to the thumbnail."""
    tiff = len(_EXIF)
    order = {b"II": "<", b"MM": ">"}.get(body[tiff : tiff + 2])
    if order is None:
        return body
    first = tiff + int(struct.unpack_from(order + "I", body, tiff + 4)[0])
    after = first + 2 + 12 * int(struct.unpack_from(order + "H", body, first)[0])
    whole = bytearray(body)
    whole[after : after + 4] = bytes(4)
    return bytes(whole)
