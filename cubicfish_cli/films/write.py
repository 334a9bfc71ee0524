"""Writing pictures as a film."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import OutputError
from cubicfish_cli.films.source import library

# As cameras compress: about half a bit a pixel where things move.
_OPTIONS = {"crf": "20", "preset": "veryfast", "g": "30"}


def write_film(
    path: Path, pictures: Iterable[npt.NDArray[np.uint8]], size: tuple[int, int], rate: float
) -> None:
    """Write grey pictures (height, width) as an H.264 film in an MP4 container.

    Args:
        path: the file; its name need not say what it is.
        pictures: one by one, all of one size.
        size: (width, height), both even.
        rate: frames a second.

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
