"""Map and pictures -> undistorted pictures, of the same depth and channels."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cubicfish_cli.errors import OutputError, ViewError
from cubicfish_cli.files import refuse_existing, write_files
from cubicfish_cli.photos import Picture, quiet_stderr, shown
from cubicfish_cli.undistortion.jpeg import DEFAULT_QUALITY, jpeg_nature, with_segments
from cubicfish_cli.undistortion.maps import UndistortMap

INTERPOLATIONS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "lanczos": cv2.INTER_LANCZOS4,
}

# What each kind of file can hold: bits a channel, and channels (4 is with transparency).
# 32 bits are floating point numbers.
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


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """How pixels are made.

    Attributes:
        interpolation: a key of :data:`INTERPOLATIONS`.
        border: (red, green, blue) of pixels that the camera does not see, 0 to 1.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.

    """

    interpolation: str = "linear"
    border: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quality: int | None = None


PLAIN = Rendering()
_TIFF_LZW = 5
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY_WITH_ALPHA = 4
_PNG_UP = 2  # each row less the one above it, which suits photos
_PNG_LEVEL = 4


def remap_picture(
    picture: Picture, undistort_map: UndistortMap, rendering: Rendering = PLAIN
) -> Picture:
    """Render the map's view from a picture: (H, W[, C]) -> (h, w[, C]), the same depth.

    By default bilinear, and black where the map has nothing: what ``cv2.remap`` gives for the
    map's file. A fourth channel is 0 where the map has nothing.

    Raises:
        ViewError: the picture does not have the size that the map is for.

    """
    height, width = picture.shape[:2]
    if (width, height) != undistort_map.image_size:
        raise ViewError(
            f"the photo has {width}x{height} pixels, the map is for "
            f"{undistort_map.image_size[0]}x{undistort_map.image_size[1]}: "
            "use photos of that size, neither scaled nor cropped nor turned"
        )
    border = _border_value(picture, rendering.border)
    wide = rendering.interpolation in ("cubic", "lanczos")
    out = cv2.remap(
        picture,
        undistort_map.map_x,
        undistort_map.map_y,
        INTERPOLATIONS[rendering.interpolation],
        # Wider kernels reach over the photo's edge: mirror the photo there, rather than
        # blend it with the border's colour.
        borderMode=cv2.BORDER_REFLECT_101 if wide else cv2.BORDER_CONSTANT,
        borderValue=border,
    )
    out = np.asarray(out)
    if wide:
        channels = 1 if out.ndim == 2 else out.shape[2]
        colour = np.array(border[:channels], out.dtype)
        out[~undistort_map.valid] = colour if out.ndim == 3 else colour[0]
    return out


def _border_value(picture: Picture, colour: tuple[float, float, float]) -> tuple[float, ...]:
    full = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65_535.0}.get(picture.dtype, 1.0)
    red, green, blue = (round(full * part, 6) for part in colour)
    if picture.ndim == 2:
        return (0.299 * red + 0.587 * green + 0.114 * blue, 0.0, 0.0, 0.0)
    return (blue, green, red, 0.0)


def render_files(
    source: Path,
    data: bytes,
    picture: Picture,
    outputs: Sequence[tuple[Path, UndistortMap]],
    rendering: Rendering = PLAIN,
) -> dict[Path, bytes]:
    """Render each map's view of a picture, with its depth and channels: path -> file's bytes.

    A JPEG's EXIF record, colour profile and quality go along.

    Args:
        source: the picture's file, for messages.
        data: its bytes.
        picture: what they hold.
        outputs: where each map's view goes.
        rendering: how pixels are made.

    Raises:
        ViewError: the picture does not have the size that a map is for.
        OutputError: an output is a kind of file that cannot hold the picture.

    """
    files = {}
    for path, undistort_map in outputs:
        try:
            out = remap_picture(picture, undistort_map, rendering)
        except ViewError as problem:
            raise ViewError(str(problem), about=shown(source), apart=True) from problem
        files[path] = encode_picture(path, out, quality=rendering.quality, like=data)
    return files


def check_outputs(paths: Sequence[Path], *, overwrite: bool) -> None:
    """Raise :class:`OutputError` when pictures cannot be written under these names."""
    for path in paths:
        check_suffix(path)
    refuse_existing(*paths, overwrite=overwrite)


def check_suffix(path: Path) -> None:
    """Raise :class:`OutputError` when pictures cannot be written under this name."""
    if path.suffix.lower() not in _HOLDS:
        raise OutputError(
            f"{shown(path)}: pictures are written as {', '.join(sorted(_HOLDS))}: "
            "choose a name that ends in one of these"
        )


def write_picture(path: Path, picture: Picture, *, overwrite: bool) -> None:
    """Write a picture (H, W[, 3 or 4]), BGR order, as its suffix says.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, cannot be written, or is of a
            kind that cannot hold the picture.

    """
    path = Path(path)
    write_files({path: encode_picture(path, picture)}, overwrite=overwrite)


def encode_picture(
    path: Path, picture: Picture, *, quality: int | None = None, like: bytes = b""
) -> bytes:
    """A picture (H, W[, 3 or 4]) of uint8, uint16 or float32 as the bytes of its file.

    Args:
        path: where it will be; its suffix says what kind of file.
        picture: in BGR order.
        quality: of a JPEG or lossy WebP file; None for that of ``like``, or else 95 in a JPEG
            and no loss in a WebP file.
        like: the file that it was made from, or nothing.

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
    segments: tuple[bytes, ...] = ()
    if suffix in (".jpg", ".jpeg"):
        options = [cv2.IMWRITE_JPEG_QUALITY, quality or DEFAULT_QUALITY]
        nature = jpeg_nature(like)
        if nature is not None:
            options, segments = nature.encode_options(quality), nature.segments
    elif suffix == ".webp" and quality is not None:
        options = [cv2.IMWRITE_WEBP_QUALITY, quality]
    elif depth == 32:  # else some versions of OpenCV take LogLuv, which loses
        options = [cv2.IMWRITE_TIFF_COMPRESSION, _TIFF_LZW]
    elif suffix == ".png" and channel_count == 4 and is_grey_with_alpha(like):
        return encode_grey_with_alpha(picture)
    try:
        with quiet_stderr():
            done, data = cv2.imencode(suffix, picture, options)
    except cv2.error:
        done, data = False, np.empty(0, np.uint8)
    if not done:
        raise OutputError(f"{shown(path)}: this picture cannot be encoded: write .png or .tif")
    return with_segments(data.tobytes(), segments)


def is_grey_with_alpha(data: bytes) -> bool:
    """Whether a file is a PNG of grey and transparency."""
    return data.startswith(_PNG_SIGNATURE) and data[25:26] == bytes([_GREY_WITH_ALPHA])


def encode_grey_with_alpha(picture: Picture) -> bytes:
    """A picture (H, W, 4) of uint8 or uint16 whose colours are grey -> a PNG of two channels.

    OpenCV reads such files as four channels and cannot write them.
    The format is that of the PNG specification, sections 9 to 11 (filters, compression, chunks).
    """
    height, width = picture.shape[:2]
    bits = 8 * picture.dtype.itemsize
    two = np.ascontiguousarray(picture[:, :, [0, 3]]).astype(f">u{bits // 8}")
    rows = two.reshape(height, -1).view(np.uint8)
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _PNG_UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # in bytes, modulo 256
    header = struct.pack(">IIBBBBB", width, height, bits, _GREY_WITH_ALPHA, 0, 0, 0)
    chunks = (
        (b"IHDR", header),
        (b"IDAT", zlib.compress(filtered.tobytes(), _PNG_LEVEL)),
        (b"IEND", b""),
    )
    return _PNG_SIGNATURE + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)
