"""What a picture file is, by its first bytes, its name and its ends.

OpenCV itself holds a limit of pixels before it makes room for a picture, in all formats
(``OPENCV_IO_MAX_IMAGE_PIXELS``, see ``app/terminal/start.py``). Here is what it leaves open: files
that are not for it, and JPEG files that are cut short.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

_VIDEO_NAMES = ".mp4 .m4v .mov .mkv .webm .avi .mts .m2ts .ts .mpg .mpeg .wmv .insv .360"
_RAW_NAMES = (
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf "
    ".raw .rw2 .rwl .sr2 .srf .srw .x3f"
)
_OTHER_NAMES = ".avif .exr .gif .heic .heif .hif .jp2 .jxl .pdf .psd"
VIDEO_SUFFIXES = frozenset(_VIDEO_NAMES.split())
RAW_SUFFIXES = frozenset(_RAW_NAMES.split())
OTHER_SUFFIXES = frozenset(_OTHER_NAMES.split())
"""Of other files that hold a photo, and are not read."""

_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
_TIFFS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNMS = tuple(b"P%d" % kind for kind in range(1, 7))
_RAW = (
    "is a camera's raw file: develop it and save it as PNG or JPEG, in full size and without lens "
    "correction"
)
_VIDEO = "is a video: save frames of it as PNG or JPEG ('cubicfish frames')"
_PHONE = "is a HEIC or AVIF picture, a kind that is not read: save it as PNG or JPEG, in full size"
_PHONES = re.compile(rb"avi[fs]|he[iv][a-z]|mif1|msf1")


def is_picture(data: bytes) -> bool:
    """Whether a file begins as PNG, JPEG, TIFF, BMP, WebP or PNM: no decoder gets any other."""
    webp = data.startswith(b"RIFF") and data[8:12] == b"WEBP"
    return webp or data.startswith((_PNG, _JPEG, b"BM", *_TIFFS, *_PNMS))


def other_kind(data: bytes, suffix: str) -> str | None:
    """What a file is that is known and not read here, and what to do about it; None otherwise.

    Args:
        data: the file's bytes, the first hundred at least.
        suffix: of its name. Raw files of many cameras begin as TIFF files do, and hold a small
            copy of the photo where those have the photo.

    """
    suffix = suffix.lower()
    if data[4:8] == b"ftyp":  # a family of formats: the first brand, and those it is compatible to
        brands = data[8 : min(len(data), 64, struct.unpack_from(">I", data)[0])]
        if b"crx " in brands:
            return _RAW
        return _PHONE if _PHONES.search(brands) else _VIDEO
    if suffix in RAW_SUFFIXES and (data.startswith(_TIFFS) or not is_picture(data)):
        return _RAW
    return _VIDEO if suffix in VIDEO_SUFFIXES and not is_picture(data) else None


def read_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) that the header of a PNG or JPEG file claims; None where it has none."""
    try:
        if data.startswith(_PNG):
            width, height = struct.unpack_from(">II", data, 16)
            return width, height
        for marker, position in jpeg_segments(data) if data.startswith(_JPEG) else ():
            if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
                height, width = struct.unpack_from(">HH", data, position + 3)
                return width, height
    except struct.error:
        pass
    return None


def is_whole(data: bytes) -> bool:
    """Whether a JPEG file has its end, which some decoders fill up with grey unasked.

    Inside a scan 0xFF is always escaped, so its first unescaped 0xD9 is the picture's end. Of other
    kinds the decoder says it.
    """
    if not data.startswith(_JPEG):
        return True
    try:
        scan = next((position for marker, position in jpeg_segments(data) if marker == 0xDA), None)
    except struct.error:
        return False
    return scan is not None and b"\xff\xd9" in data[scan:]


def jpeg_segments(data: bytes) -> Iterator[tuple[int, int]]:
    """(marker, position after it) of a JPEG file's segments, up to the first scan."""
    position = 2
    while position + 4 <= len(data):
        if data[position] != 0xFF:
            return
        marker = data[position + 1]
        if marker == 0xFF:  # fill bytes may stand before a marker
            position += 1
            continue
        yield marker, position + 2
        if marker == 0xDA:
            return
        position += 2 + int(struct.unpack_from(">H", data, position + 2)[0])


# Tag 274, of any type of whole number, one value, which is not 1: little and big endian.
_TURNED = (
    (b"II", re.compile(rb"(\x12\x01.\0\x01\0{3,7})[\x02-\x08]", re.DOTALL)),
    (b"MM", re.compile(rb"(\x01\x12\0.\0{3,7}\x01\0{0,7})[\x02-\x08]", re.DOTALL)),
)


def as_stored(data: bytes) -> bytes:
    """A picture file whose decoder leaves the pixels as they are stored.

    OpenCV turns a TIFF file by its note of orientation, whatever it is told: in a copy the note is
    made to say that nothing is turned.
    """
    if data.startswith(_TIFFS):
        for order, note in _TURNED:
            if data.startswith(order) and note.search(data):
                return note.sub(b"\\g<1>\x01", data)
    return data
