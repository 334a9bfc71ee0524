"""Size and kind of a picture from its header, checked before anything is decoded.

A decoder makes room for what a header claims, so a few bytes can ask for all the memory there is.
Only what is understood here is ever given to a decoder; where a file names a size in several
places, the largest counts. Nothing is read that the bytes do not hold.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

_MOST_PARTS = 1_000_000
_MOST_SCANS = 64


@dataclass(frozen=True, kw_only=True)
class Claim:
    """What a header says.

    Attributes:
        width, height: pixels.
        memory: bytes that a decoder needs for its largest piece: mostly the whole picture.

    """

    width: int
    height: int
    memory: int


def is_picture(data: bytes) -> bool:
    """Whether a file begins as one of a kind that is read here."""
    return any(data.startswith(magic) for magic, _ in _KINDS)


def claimed(data: bytes) -> Claim | None:
    """What a picture file claims, None when it is cut short, damaged or of another kind.

    PNG, JPEG, TIFF, BigTIFF, BMP, WebP and PNM are understood.
    """
    for magic, read in _KINDS:
        if data.startswith(magic):
            try:
                claim = read(data)
            except (struct.error, IndexError, KeyError, OverflowError):  # a place of 64 bits
                return None
            return claim if claim and claim.width > 0 and claim.height > 0 else None
    return None


def other_kind(data: bytes, suffix: str) -> str | None:
    """What a file is that is known and not read here, and what to do about it; None otherwise.

    Args:
        data: the file's bytes, the first hundred at least.
        suffix: of its name. Raw files of many cameras begin as TIFF files do, and hold a small
            copy of the photo where those have the photo.

    """
    if data.startswith(_TIFFS) and (suffix.lower() in RAW_SUFFIXES or data[8:10] == b"CR"):
        return _RAW
    if data[4:8] == b"ftyp":  # a family of formats: the first brand, and those it is compatible to
        brands = data[8 : min(len(data), 64, struct.unpack_from(">I", data)[0])]
        for brand, kind in _BRANDS:
            if brand in brands:
                return kind
        return _VIDEO
    if data[4:8] in (b"moov", b"mdat") or (data.startswith(b"RIFF") and data[8:12] == b"AVI "):
        return _VIDEO
    return next((kind for magic, kind in _OTHERS if data.startswith(magic)), None)


_RAW_NAMES = (
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf "
    ".raw .rw2 .rwl .sr2 .srf .srw .x3f"
)
_OTHER_NAMES = ".avif .exr .gif .heic .heif .hif .jp2 .jxl .pdf .psd"
_VIDEO_NAMES = ".mp4 .m4v .mov .mkv .webm .avi .mts .m2ts .ts .mpg .mpeg .wmv .insv .360"
VIDEO_SUFFIXES = frozenset(_VIDEO_NAMES.split())
RAW_SUFFIXES = frozenset(_RAW_NAMES.split())
OTHER_SUFFIXES = frozenset(_OTHER_NAMES.split())
"""Of other files that hold a photo, and are not read."""

_TIFFS = (b"II*\0", b"MM\0*")
_RAW = (
    "is a camera's raw file: develop it and save it as PNG or JPEG, in full size and without lens "
    "correction"
)
_VIDEO = "is a video: save frames of it as PNG or JPEG ('cubicfish frames')"
_PICTURE = "is {} picture, a kind that is not read: save it as PNG or JPEG, in full size"
_BRANDS = (
    (b"avif", _PICTURE.format("an AVIF")),
    (b"avis", _PICTURE.format("an AVIF")),
    (b"crx ", _RAW),
    *((b, _PICTURE.format("a HEIC")) for b in (b"heic", b"heix", b"heim", b"heis", b"mif1")),
    *((b, _PICTURE.format("a HEIC")) for b in (b"hevc", b"hevx", b"msf1")),
)
_OTHERS = (
    (b"GIF8", _PICTURE.format("a GIF")),
    (b"8BPS", _PICTURE.format("a Photoshop")),
    (b"\x76\x2f\x31\x01", _PICTURE.format("an OpenEXR")),
    (b"\xff\x0a", _PICTURE.format("a JPEG XL")),
    (b"\0\0\0\x0cJXL ", _PICTURE.format("a JPEG XL")),
    (b"\0\0\0\x0cjP  ", _PICTURE.format("a JPEG 2000")),
    (b"\xff\x4f\xff\x51", _PICTURE.format("a JPEG 2000")),
    (b"%PDF", "is a PDF document: save the photo in it as PNG or JPEG, in full size"),
    *((magic, _RAW) for magic in (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0")),
    *((magic, _RAW) for magic in (b"FOVb", b"\0MRM", b"II\x1a\0\0\0HEAPCCDR")),
    *((magic, _VIDEO) for magic in (b"\x1a\x45\xdf\xa3", b"\0\0\1\xba", b"\x30\x26\xb2\x75")),
)


def _png(data: bytes) -> Claim | None:
    """A PNG file: chunks whose lengths lie are what decoders make room for, so all are walked."""
    width, height, depth, colour = struct.unpack_from(">IIBB", data, 16)
    if data[12:16] != b"IHDR":
        return None
    position = 8
    for _ in range(_MOST_PARTS):
        length, kind = struct.unpack_from(">I4s", data, position)
        if position + 12 + length > len(data):
            return None
        if kind == b"fcTL":  # a frame of an animation lies within the picture
            frame_width, frame_height = struct.unpack_from(">II", data, position + 12)
            if frame_width > width or frame_height > height:
                return None
        if kind == b"IEND":
            channels = {0: 1, 2: 3, 3: 4, 4: 4, 6: 4}[colour]
            return _claim(width, height, channels * (2 if depth == 16 else 1))
        position += 12 + length
    return None


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


def _jpeg(data: bytes) -> Claim | None:
    """A JPEG file that has its end, which some decoders fill up with grey unasked.

    Inside a scan 0xFF is always escaped, so its first unescaped 0xD9 is the picture's end. Each
    scan may go over the whole picture, whatever its length: thousands would take hours.
    """
    frame = scan = None
    for marker, position in jpeg_segments(data):
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC) and frame is None:
            frame = marker, position
        if marker == 0xDA:
            scan = position
    if frame is None or scan is None:
        return None
    end = data.find(b"\xff\xd9", scan)
    if end < 0 or data.count(b"\xff\xda", scan, end) >= _MOST_SCANS:
        return None
    marker, position = frame
    height, width, channels = struct.unpack_from(">HHB", data, position + 3)
    if not channels:
        return None
    bytes_per_pixel = float(channels)
    if marker in (0xC2, 0xC6, 0xCA, 0xCE):  # progressive: all coefficients are kept, in 16 bits
        shares = [data[position + 9 + 3 * channel] for channel in range(channels)]
        samples = [(share >> 4) * (share & 15) for share in shares]
        bytes_per_pixel += 2 * sum(samples) / max(1, *samples)
    return _claim(width, height, bytes_per_pixel)


def _bmp(data: bytes) -> Claim | None:
    size = struct.unpack_from("<I", data, 14)[0]
    if size < 36:  # of OS/2
        if size != 12:
            return None
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return _claim(width, abs(height), 4)  # top-down if negative


# Tags, and the codes of struct for the types of numbers, in TIFF files.
_WIDTH, _HEIGHT, _BITS, _SAMPLES, _TILE_WIDTH, _TILE_HEIGHT = 256, 257, 258, 277, 322, 323
_ORIENTATION, _NOT_TURNED = 274, 1
_NUMBERS = {1: "B", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 16: "Q", 17: "q"}


def _tiff(data: bytes) -> Claim | None:
    """The first picture of a TIFF file, little or big endian, classic or with 64-bit offsets."""
    found = {_BITS: 1, _SAMPLES: 1, _TILE_WIDTH: 0, _TILE_HEIGHT: 0}
    for tag, code, place in _tiff_numbers(data, (*found, _WIDTH, _HEIGHT)):
        value = int(struct.unpack_from(code, data, place)[0])
        found[tag] = max(value, found.get(tag, value))
    # A tile may be larger than the picture, and room is made for a whole one.
    pixels = max(found[_WIDTH] * found[_HEIGHT], found[_TILE_WIDTH] * found[_TILE_HEIGHT])
    memory = pixels * found[_SAMPLES] * -(-found[_BITS] // 8)
    return Claim(width=found[_WIDTH], height=found[_HEIGHT], memory=memory)


def _tiff_numbers(data: bytes, tags: Collection[int]) -> Iterator[tuple[int, str, int]]:
    """(tag, code of struct, place) of what the first picture's directory says under some tags."""
    order = "<" if data.startswith(b"II") else ">"
    big = data[2:4] in (b"+\0", b"\0+")
    word, count_code, entry_size = ("Q", "Q", 20) if big else ("I", "H", 12)
    start = struct.unpack_from(order + word, data, 8 if big else 4)[0]
    entries = struct.unpack_from(order + count_code, data, start)[0]
    first = start + struct.calcsize(order + count_code)
    if entries > 65_535:
        raise IndexError("more entries than a directory has")
    for at in range(first, first + entry_size * entries, entry_size):
        tag, kind, count = struct.unpack_from(order + "HH" + word, data, at)
        if tag not in tags:
            continue
        code = order + _NUMBERS[kind]
        place = at + 4 + struct.calcsize("=" + word)
        if count * struct.calcsize(code) > struct.calcsize("=" + word):
            place = struct.unpack_from(order + word, data, place)[0]
        yield tag, code, place


def as_stored(data: bytes) -> bytes:
    """A picture file whose decoder leaves the pixels as they are stored.

    OpenCV turns a TIFF file by its note of orientation, whatever it is told: in a copy the note is
    made to say that nothing is turned. What is decoded is the copy, so :func:`claimed` has to be
    asked about that.
    """
    if not any(data.startswith(magic) for magic, read in _KINDS if read is _tiff):
        return data
    copy = None
    try:
        for _, code, place in _tiff_numbers(data, (_ORIENTATION,)):
            if struct.unpack_from(code, data, place)[0] != _NOT_TURNED:
                copy = copy or bytearray(data)
                struct.pack_into(code, copy, place, _NOT_TURNED)
    except (struct.error, IndexError, KeyError, OverflowError):
        return data  # damaged, or no note that a decoder would follow
    return data if copy is None else bytes(copy)


def _webp(data: bytes) -> Claim | None:
    """A WebP file: its canvas, and the pictures on it."""
    if data[8:12] != b"WEBP":
        return None
    sizes = []
    position = 12
    for _ in range(_MOST_PARTS):
        if position + 8 > len(data):
            break
        kind, length = struct.unpack_from("<4sI", data, position)
        body = position + 8
        if kind == b"VP8X":
            sizes.append(_three_bytes(data, body + 4, body + 7))
        elif kind == b"ANMF":
            sizes.append(_three_bytes(data, body + 6, body + 9))
        elif kind == b"VP8 ":
            width, height = struct.unpack_from("<HH", data, body + 6)
            sizes.append((width & 0x3FFF, height & 0x3FFF))
        elif kind == b"VP8L":
            both = struct.unpack_from("<I", data, body + 1)[0]
            sizes.append(((both & 0x3FFF) + 1, (both >> 14 & 0x3FFF) + 1))
        position = body + length + length % 2
    if not sizes:
        return None
    return _claim(max(width for width, _ in sizes), max(height for _, height in sizes), 4)


def _three_bytes(data: bytes, *places: int) -> tuple[int, int]:
    """Whole numbers less one, of three bytes each."""
    across, down = (struct.unpack_from("<HB", data, place) for place in places)
    return across[0] + (across[1] << 16) + 1, down[0] + (down[1] << 16) + 1


_BLANK = rb"(?:\s|#[^\n\r]*[\n\r])+"
_PNM = re.compile(rb"P([1-6])" + 2 * (_BLANK + rb"([0-9]{1,9})"))


def _pnm(data: bytes) -> Claim | None:
    head = _PNM.match(data[:4096])
    if head is None:
        return None
    kind, width, height = (int(head[group]) for group in (1, 2, 3))
    claim = _claim(width, height, 6 if kind in (3, 6) else 2)
    channels, bits = 3 if kind in (3, 6) else 1, 1 if kind in (1, 4) else 8
    # Numbers in digits have a blank between them, those in bytes none.
    least = width * height * channels * (16 if kind <= 3 else bits) // 8
    return claim if kind == 1 or least <= len(data) else None


def _claim(width: int, height: int, bytes_per_pixel: float) -> Claim:
    return Claim(width=width, height=height, memory=math.ceil(width * height * bytes_per_pixel))


_KINDS: tuple[tuple[bytes, Callable[[bytes], Claim | None]], ...] = (
    (b"\x89PNG\r\n\x1a\n", _png),
    (b"\xff\xd8\xff", _jpeg),
    (b"II*\0", _tiff),
    (b"MM\0*", _tiff),
    (b"II+\0", _tiff),
    (b"MM\0+", _tiff),
    (b"BM", _bmp),
    (b"RIFF", _webp),
    *((b"P%d" % kind, _pnm) for kind in range(1, 7)),
)
