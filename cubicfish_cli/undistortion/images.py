"""Map and pictures -> undistorted pictures of the same depth and with the same channels.

The module also copies metadata of a JPEG file into the picture that is made from it: the EXIF
record (orientation, time, place, lens), the colour profile and the quantisation tables. No reader
finds the thumbnail in that record, since it would show the old picture.
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

from cubicfish import (
    CubicCamera,
    CubicfishError,
    OutputError,
    UndistortMap,
    View,
    ViewError,
    build_map,
    did_you_mean,
    quoted,
    shown,
)
from cubicfish.files import write_files
from cubicfish.photos import Picture
from cubicfish.photos.photos import jpeg_segments, quiet_stderr, refuse_no_picture
from cubicfish.views import PointProjector, camera_for_photos
from cubicfish.views.maps import OUTSIDE
from cubicfish_cli.undistortion.choose import build_view
from cubicfish_cli.undistortion.options import INTERPOLATIONS, Interpolation

CV2_FLAGS = dict(
    zip(
        INTERPOLATIONS,
        (cv2.INTER_NEAREST, cv2.INTER_LINEAR, cv2.INTER_CUBIC, cv2.INTER_LANCZOS4),
        strict=True,
    )
)

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
# Pixels of a view whose map, of nine bytes per pixel, is in memory at a time.
_BAND_PIXELS = 4_000_000


def remap_picture(
    picture: Picture, undistort_map: UndistortMap, interpolation: str = "linear"
) -> Picture:
    """Render the map's view from a picture: (H, W[, C]) -> (h, w[, C]), the same depth.

    By default it is bilinear, and black where the map has nothing, as ``cv2.remap`` renders the
    map's file. A fourth channel is 0 where the map has nothing.

    Raises:
        ViewError: the picture does not have the size that the map is for, or the interpolation is
            not known.

    """
    if interpolation not in INTERPOLATIONS:
        raise ViewError(
            f"interpolation {quoted(interpolation)} is not known: "
            f"{did_you_mean(str(interpolation), INTERPOLATIONS)}"
        )
    height, width = picture.shape[:2]
    if (width, height) != undistort_map.image_size:
        raise ViewError(
            f"the photo has {width}x{height} pixels, the map is for "
            f"{undistort_map.image_size[0]}x{undistort_map.image_size[1]}: "
            "use photos of that size, neither scaled nor cropped nor turned"
        )
    return remap(picture, undistort_map.map_x, undistort_map.map_y, interpolation)


def render_in_bands(
    picture: Picture, camera: PointProjector, view: View, interpolation: str = "linear"
) -> Picture:
    """Render a view from a picture without the whole map in memory: some rows after the others.

    Raises:
        ViewError: as :func:`remap_picture` and :func:`build_map`.

    """
    width, height = view.size
    flat = np.empty((height, width, *picture.shape[2:]), picture.dtype)
    step = max(1, _BAND_PIXELS // width)
    for top in range(0, height, step):
        rows = range(top, min(height, top + step))
        band = build_map(camera, view, rows)
        flat[rows.start : rows.stop] = remap_picture(picture, band, interpolation)
    return flat


def remap(
    values: Picture,
    map_x: npt.NDArray[np.float32],
    map_y: npt.NDArray[np.float32],
    interpolation: str,
    empty: float = 0,
) -> Picture:
    """Interpolate values (H, W[, C]) at the places of a map (h, w); ``empty`` where it has none."""
    # Wider kernels reach over the photo's edge: mirror the photo there, rather than blend it.
    wide = interpolation in ("cubic", "lanczos")
    border = cv2.BORDER_REFLECT_101 if wide else cv2.BORDER_CONSTANT
    flags = CV2_FLAGS[interpolation]
    out = np.asarray(cv2.remap(values, map_x, map_y, flags, None, border, (empty,) * 4))
    if wide:
        out[map_x == OUTSIDE] = empty
    return out


def undistort(
    picture: npt.NDArray[Any],
    by: CubicCamera | UndistortMap,
    view: View | None = None,
    *,
    interpolation: Interpolation = "linear",
) -> npt.NDArray[Any]:
    """Render a view from a photo, as ``cubicfish undistort`` does.

    For many photos, make the map once with :func:`build_map` and pass it instead of the camera.

    Args:
        picture: (H, W) or (H, W, 1 to 4), uint8, uint16 or float32, of the size that the camera
            was calibrated for or an exact rescale of it (a map takes its own size alone).
        by: the camera, or a map.
        view: what to render; by default flat, as large as the photo and with the photo's scale in
            its middle, up to 120° across.
        interpolation: how pixels are interpolated.

    Returns:
        (h, w) or (h, w, channels), of the view's size and the picture's dtype.

    Raises:
        ViewError: the picture is not one that the camera or the map is for, or an option is not
            known.

    """
    kinds = (np.uint8, np.uint16, np.float32)
    refuse_no_picture(picture, "the picture", ViewError, kinds=kinds)
    if isinstance(by, UndistortMap):
        if view is not None:
            raise ViewError("a map has its view already: leave the view out, or pass the camera")
        undistort_map = by
    else:
        if not isinstance(by, CubicCamera):
            given = quoted(by) if isinstance(by, str | Path) else f"a {type(by).__name__}"
            raise ViewError(
                f"{given} is neither a camera nor a map: load_camera(...).camera is a camera"
            )
        camera = camera_for_photos(by, (picture.shape[1], picture.shape[0]))
        undistort_map = build_map(camera, build_view(camera) if view is None else view)
    flat = remap_picture(np.ascontiguousarray(picture), undistort_map, interpolation)
    return flat.reshape((*flat.shape[:2], *picture.shape[2:]))


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
    try:
        with quiet_stderr():
            done, data = cv2.imencode(suffix, picture, options)
    except cv2.error:
        done, data = False, np.empty(0, np.uint8)
    if not done:
        raise OutputError(f"{shown(path)}: this picture cannot be encoded: write .png or .tif")
    return with_segments(data.tobytes(), segments)


DEFAULT_QUALITY = 95

_APP0, _APP1, _APP2, _DQT, _SOS = 0xE0, 0xE1, 0xE2, 0xDB, 0xDA
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
        for marker, body in _read_segments(data) if data.startswith(b"\xff\xd8\xff") else ():
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


def _read_segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(marker, body) of the segments before the first scan."""
    for marker, at in jpeg_segments(data):
        if marker != _SOS:
            length = int(struct.unpack_from(">H", data, at)[0])
            yield marker, data[at + 2 : at + length]


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
        data = cv2.imencode(".jpg", dot, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        body = next(body for marker, body in _read_segments(data) if marker == _DQT)
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
