"""Map and pictures -> undistorted pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from cubicfish_cli.errors import OutputError, ViewError
from cubicfish_cli.files import refuse_existing, whole_file
from cubicfish_cli.photos import Picture, quiet_stderr, read_picture, shown
from cubicfish_cli.undistortion.maps import UndistortMap

JPEG_QUALITY = 95

# What each kind of file can hold: bits a channel, and channels (4 is with transparency).
_EIGHT, _EIGHT_OR_SIXTEEN = (8,), (8, 16)
_HOLDS = {
    ".png": (_EIGHT_OR_SIXTEEN, (1, 3, 4)),
    ".tif": (_EIGHT_OR_SIXTEEN, (1, 3, 4)),
    ".tiff": (_EIGHT_OR_SIXTEEN, (1, 3, 4)),
    ".jpg": (_EIGHT, (1, 3)),
    ".jpeg": (_EIGHT, (1, 3)),
    ".bmp": (_EIGHT, (1, 3)),
    ".webp": (_EIGHT, (3, 4)),
    ".pgm": (_EIGHT_OR_SIXTEEN, (1,)),
    ".ppm": (_EIGHT_OR_SIXTEEN, (3,)),
}


def remap_picture(picture: Picture, undistort_map: UndistortMap) -> Picture:
    """Render the map's view from a picture: (H, W[, C]) -> (h, w[, C]), the same depth.

    Bilinear, black where the map has nothing: what ``cv2.remap`` gives for the map's file.

    Raises:
        ViewError: the picture does not have the size that the map is for.

    """
    height, width = picture.shape[:2]
    if (width, height) != undistort_map.image_size:
        raise ViewError(
            f"the photo has {width}x{height} pixels, the camera was calibrated for "
            f"{undistort_map.image_size[0]}x{undistort_map.image_size[1]}: "
            "use photos of that size, neither scaled nor cropped nor turned"
        )
    out = cv2.remap(
        picture,
        undistort_map.map_x,
        undistort_map.map_y,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    return np.asarray(out)


def undistort_picture_file(
    source: Path, destination: Path, undistort_map: UndistortMap, *, overwrite: bool
) -> None:
    """Read a picture, render the map's view, write it with the same depth and channels.

    Raises:
        PhotoError: the picture cannot be read.
        ViewError: it does not have the size that the map is for.
        OutputError: the output exists and ``overwrite`` is false, cannot be written, or is a
            kind of file that cannot hold the picture.

    """
    refuse_existing(destination, overwrite=overwrite)
    check_suffix(destination)
    picture = read_picture(source)
    try:
        out = remap_picture(picture, undistort_map)
    except ViewError as problem:
        raise ViewError(f"{shown(source)}: {problem}") from problem
    write_picture(destination, out, overwrite=overwrite)


def check_suffix(path: Path) -> None:
    """Raise :class:`OutputError` when pictures cannot be written under this name."""
    if path.suffix.lower() not in _HOLDS:
        raise OutputError(
            f"{shown(path)}: pictures are written as {', '.join(sorted(_HOLDS))}: "
            "choose a name that ends in one of these"
        )


def write_picture(path: Path, picture: Picture, *, overwrite: bool) -> None:
    """Write a picture (H, W[, 3 or 4]), uint8 or uint16, BGR order, as its suffix says.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, cannot be written, or is of a
            kind that cannot hold the picture.

    """
    path = Path(path)
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
            "write .png or .tif"
        )
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if suffix in (".jpg", ".jpeg") else []
    with whole_file(path, overwrite=overwrite) as temporary:
        try:
            with quiet_stderr():
                done, data = cv2.imencode(suffix, picture, options)
        except cv2.error:
            done, data = False, np.empty(0, np.uint8)
        if not done:
            raise OutputError(f"{shown(path)}: this picture cannot be encoded: write .png or .tif")
        temporary.write_bytes(data.tobytes())
