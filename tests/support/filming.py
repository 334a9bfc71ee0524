"""Films for tests: rendered photos of a board, with spoilt frames between."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import islice
from pathlib import Path

import av
import cv2
import numpy as np
from synthetic import checkerboard, lens_of_size

from cubicfish import Target
from cubicfish.find import find_grids
from cubicfish.scene.photos import Look
from cubicfish.scene.scene import Scene

TARGET = """units: mm
boards:
  - {name: board, type: checkerboard, corners: [7, 5], square: 40}
"""
RATE = 10
SIZE = (480, 360)


@cache
def photos(count: int = 8, columns: int = 7, rows: int = 5) -> tuple[np.ndarray, ...]:
    """Photos (360, 480) of a board of 7x5 corners from varied sides."""
    target = Target(units="mm", boards=(checkerboard("board", columns, rows, 40.0),))
    lens = lens_of_size(0.5)
    scene = Scene(target=target, lens=lens, image_size=SIZE)
    poses = {f"p{n}": pose for n, pose in enumerate(scene.choose_poses(2 * count))}
    rendered = scene.photos(poses, Look(noise=1.0, blur=0.5))
    # At this size boards far out are too small to be found whole.
    whole = (
        photo for _, photo in rendered if sum(map(len, find_grids(photo).grids)) == columns * rows
    )
    found = tuple(islice(whole, count))
    assert len(found) == count
    return found


def spoilt_film(count: int = 8) -> tuple[list[np.ndarray], list[str]]:
    """Each photo twice, then blurred, blurred by motion, and shifted; and a word for each frame."""
    streak = np.zeros((13, 13), np.float32)
    streak[6] = 1 / 13
    frames: list[np.ndarray] = []
    kinds: list[str] = []
    for photo in photos(count):
        frames += [
            photo,
            photo,
            cv2.GaussianBlur(photo, (0, 0), 2.5),
            cv2.filter2D(photo, -1, streak),
            np.roll(photo, (3, 3), (0, 1)),
            np.roll(photo, (6, 6), (0, 1)),
            np.roll(photo, (18, 24), (0, 1)),
        ]
        kinds += ["photo", "photo", "blurred", "streaked", "shifted", "shifted", "shifted"]
    return frames, kinds


def write_film(
    path: Path,
    frames: list[np.ndarray] | tuple[np.ndarray, ...],
    *,
    times_ms: list[int] | None = None,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    options: dict[str, str] | None = None,
    of_file: dict[str, str] | None = None,
) -> Path:
    """Write grey frames (H, W) as a film, 10 a second unless ``times_ms`` says otherwise."""
    with av.open(str(path), "w", container_options=of_file) as container:
        settings = {"crf": "12", "g": "20"} if codec == "libx264" else {}
        stream = container.add_stream(codec, rate=RATE, options={**settings, **(options or {})})
        stream.height, stream.width = frames[0].shape
        stream.pix_fmt = pix_fmt
        if times_ms is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        for number, grey in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(np.dstack([grey] * 3), format="bgr24")
            frame = frame.reformat(format=pix_fmt)
            if times_ms is not None:
                frame.pts, frame.time_base = times_ms[number], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def write_sound(path: Path) -> Path:
    """A file that holds a tone and no pictures."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=16_000)
        tone = np.sin(np.arange(8000) / 9).astype(np.float32)[None]
        samples = av.AudioFrame.from_ndarray(tone, format="fltp", layout="mono")
        samples.rate, samples.pts = 16_000, 0
        container.mux(stream.encode(samples))
        container.mux(stream.encode(None))
    return path
