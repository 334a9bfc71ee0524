"""Writing pictures as a film, and frames of films as pictures."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import OutputError
from cubicfish_cli.films.source import library

# As cameras compress: about half a bit per pixel where things move.
_OPTIONS = {"crf": "20", "preset": "veryfast", "g": "30"}
# Compressing a picture well takes as long as decoding twenty.
_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # OpenCV 4.12 and later
    _FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]


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
