"""A frame in a file: as it was decoded, to be read again, or as PNG for those who look at it.

As it was decoded it is one line of JSON, then the planes without what pads their rows.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

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
