"""Frames in files: the raw cache of decoded ones, frames as PNG, and pictures as a film.

A file of the cache is one line of JSON, then the planes without what pads their rows.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import OutputError, PhotoError
from cubicfish_cli.films.measure import Grey
from cubicfish_cli.films.source import library
from cubicfish_cli.photos import shown

SUFFIX = ".frame"
_FIRST_BYTES = 1000
# Brightness can be read where it is stored in these, by bytes per number; all else is converted.
_PLAIN = {
    **dict.fromkeys(
        (
            *("gray", "nv12", "yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p"),
            *("yuvj444p",),
        ),
        1,
    ),
    **dict.fromkeys(
        (
            *("gray10le", "gray12le", "gray16le", "p010le", "yuv420p10le", "yuv420p12le"),
            *("yuv422p10le", "yuv422p12le", "yuv444p10le", "yuv444p12le"),
        ),
        2,
    ),
}
# As cameras compress: about half a bit per pixel where things move.
_OPTIONS = {"crf": "20", "preset": "veryfast", "g": "30"}
# Compressing a picture well takes as long as decoding twenty.
_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # OpenCV 4.12 and later
    _FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]


def brightness(frame: Any) -> Grey:
    """Grey levels (H, W) of a frame, as they are stored: uint8 or uint16."""
    size = _PLAIN.get(frame.format.name)
    if size is None:
        return np.asarray(frame.to_ndarray(format="gray"))
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8 if size == 1 else "<u2")
    return np.asarray(rows.reshape(plane.height, -1)[:, : plane.width])


def save_frame(path: Path, frame: Any) -> None:
    """Write a frame of PyAV; whether the file is whole is for the caller to see to."""
    if frame.format.has_palette:
        frame = frame.reformat(format="bgr24")
    compact = _empty(frame.width, frame.height, frame.format.name)
    about = {
        "size": [frame.width, frame.height],
        "format": frame.format.name,
        "range": int(frame.color_range),
        "space": int(frame.colorspace),
    }
    with path.open("wb") as file:
        file.write(json.dumps(about).encode() + b"\n")
        for plane, target in zip(frame.planes, compact.planes, strict=True):
            rows = np.frombuffer(plane, np.uint8).reshape(plane.height, -1)
            width = min(rows.shape[1], target.line_size)
            padded = np.zeros((plane.height, target.line_size), np.uint8)
            padded[:, :width] = rows[:, :width]
            file.write(padded.tobytes())


def load_frame(path: Path) -> Any:
    """A frame that was written, as PyAV's.

    Raises:
        PhotoError: it is there no longer, or is damaged.

    """
    try:
        with path.open("rb") as file:
            about = json.loads(file.readline(_FIRST_BYTES))
            width, height = about["size"]
            frame = _empty(width, height, about["format"])
            frame.color_range, frame.colorspace = about["range"], about["space"]
            for plane in frame.planes:
                plane.update(file.read(plane.buffer_size))
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise PhotoError(
            f"{shown(path)} cannot be read again: remove {shown(path.parent.parent)} and begin anew"
        ) from problem
    return frame


def _empty(width: int, height: int, name: str) -> Any:
    try:
        return library().VideoFrame(width, height, name)
    except ValueError as problem:
        raise OutputError(f"frames of kind {name} cannot be kept: convert the film") from problem


def write_film(
    path: Path, pictures: Iterable[npt.NDArray[np.uint8]], size: tuple[int, int], rate: float
) -> None:
    """Write grey pictures (height, width) as an H.264 film in an MP4 container.

    Args:
        path: the file; its name need not say what it is.
        pictures: one by one, all of one size.
        size: (width, height), both even.
        rate: frames per second.

    Raises:
        OutputError: the extra ``video`` is not installed, a side is odd, or the file cannot be
            written.

    """
    av = library()
    width, height = refuse_odd(size)
    try:
        with av.open(str(path), "w", format="mp4") as container:
            stream: Any = container.add_stream(
                "libx264", rate=Fraction(rate).limit_denominator(1001), options=_OPTIONS
            )
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for picture in pictures:
                frame = av.VideoFrame.from_ndarray(picture, format="gray")
                container.mux(stream.encode(frame.reformat(format="yuv420p")))
            container.mux(stream.encode(None))
    except av.FFmpegError as problem:
        raise OutputError(
            f"{path} cannot be written ({problem.strerror}): check the folder and the free space"
        ) from problem


def refuse_odd(size: tuple[int, int]) -> tuple[int, int]:
    """Raise :class:`OutputError` for a (width, height) that no such film has."""
    if size[0] % 2 or size[1] % 2:
        raise OutputError(
            "a film has an even width and height, not {}x{}: take a lens of such a size".format(
                *size
            )
        )
    return size


def write_frame(path: Path, frame: Any) -> None:
    """Write a frame as a PNG of 8 bits, grey where the film is grey; the caller sees to the rest.

    Raises:
        OutputError: it cannot be written.

    """
    grey = frame.format.name.startswith("gray")
    picture = frame.to_ndarray(format="gray" if grey else "bgr24")
    done, data = cv2.imencode(".png", picture, _FAST)
    if not done:
        raise OutputError(f"{path} cannot be written: a frame is no picture")
    path.write_bytes(data.tobytes())
