"""How many frames are kept, and how bright their pixels are."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("av")

import av
from filming import SIZE

from cubicfish_cli.extensions.films.frames import kept_of
from cubicfish_cli.films.scan import brightness
from cubicfish_cli.films.source import Film


@pytest.mark.parametrize(
    ("frames", "rate", "every"),
    [(0, 30, 15), (50, 30, 1), (3600, 30, 40), (18_000, 30, 60), (108_000, 30, 360), (900, 0, 10)],
)
def test_a_long_film_has_frames_kept_more_often(frames: int, rate: float, every: int) -> None:
    film = Film(path=Path("film.mp4"), label="film", size=SIZE, frames=frames, rate=rate)
    assert kept_of([film], 60) == every


@pytest.mark.parametrize(
    ("kind", "dtype"),
    [
        *(("yuv420p", np.uint8), ("yuvj422p", np.uint8), ("nv12", np.uint8), ("gray", np.uint8)),
        *(("yuv420p10le", np.uint16), ("p010le", np.uint16), ("bgr24", np.uint8)),
        *(("yuyv422", np.uint8), ("pal8", np.uint8)),
    ],
)
def test_brightness_is_as_it_is_stored(kind: str, dtype: type) -> None:
    """Of a width that decoders pad."""
    random = np.random.default_rng(3)
    frame = av.VideoFrame(202, 66, kind)
    for plane in frame.planes:
        # Small, so that 10 bits stay 10 bits.
        plane.update(random.integers(0, 3, plane.buffer_size, np.uint8).tobytes())
    grey = brightness(frame)
    assert (grey.shape, grey.dtype) == ((66, 202), dtype)
    if kind not in ("pal8", "bgr24", "yuyv422"):
        stored = np.frombuffer(frame.planes[0], dtype).reshape(66, -1)
        assert np.array_equal(grey, stored[:, :202])
    else:
        assert np.array_equal(grey, frame.to_ndarray(format="gray"))
