"""Render the sample photos: ``python sample_data/render_sample.py`` writes photos/ anew.

No camera took them. The lens is a made-up one of the tests, which true_camera.yaml is near; the
boards are read from target.yaml, and the room around them is that of room.py. The same files give
the same photos, but for what a JPEG encoder's version changes. ``true_corners.csv`` holds where the
lens really sees each corner, in the layout of ``cubicfish detect``.
"""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import Target
from cubicfish.scene.truth import (
    Pose,
    rotation_matrix,
    true_corners_text,
)

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "tests" / "support")]

from looking import look_at  # noqa: E402
from room import Room  # noqa: E402
from synthetic_lenses import SyntheticLens, synthetic_lens  # noqa: E402

FloatArray = npt.NDArray[np.float64]

# Where the camera is and looks (mm), and how it is turned about its axis (degrees).
VIEWS = (
    ((150, 140, 130), (20, 25, 15), 0),
    ((115, 105, 110), (130, 40, 10), 85),
    ((175, 125, 120), (-40, 125, 60), -30),
    ((120, 165, 115), (130, -40, 120), 170),
    ((110, 100, 85), (0, 0, 200), 10),
    ((95, 125, 130), (210, 130, -40), -95),
    ((130, 100, 120), (50, 230, 30), 140),
    ((100, 110, 150), (-60, 60, 0), 50),
    ((200, 170, 150), (60, 40, 40), -140),
    ((115, 105, 105), (190, 20, 70), 20),
)

# The sensor: what is lost at 90° from the axis and over the last degrees of the field, what
# scattered light adds, blur in pixels at the axis and at the rim, electrons that fill a pixel,
# and those that it reads in the dark.
_VIGNETTING, _RIM_DEG, _FLARE = 0.5, 2.0, 0.012
_BLUR, _BLUR_AT_RIM = 0.55, 1.0
_FULL, _READ = 9000.0, 12.0
_GAMMA = 1 / 2.2
_JPEG_QUALITY = 90
_ROWS_A_BLOCK = 24


def true_lens() -> SyntheticLens:
    """The lens of true_camera.yaml."""
    return synthetic_lens("equisolid", (960, 720))


def poses() -> dict[str, Pose]:
    """Photo name -> camera_from_world."""
    return {
        f"corner_{number:02d}.jpg": look_at(eye, aim, roll=radians(roll))
        for number, (eye, aim, roll) in enumerate(VIEWS, start=1)
    }


def true_corners(target: Target, lens: SyntheticLens) -> str:
    """The visible corners of all photos as the text of a corners file."""
    return true_corners_text(target, lens, poses(), lens.image_size)


def photograph(
    room: Room, lens: SyntheticLens, pose: Pose, *, rays_a_side: int = 4, seed: int = 0
) -> npt.NDArray[np.uint8]:
    """The photo that the lens takes at a pose -> (height, width, 3) uint8, blue first.

    A pixel is the mean of ``rays_a_side``² rays, each somewhere in its own part of the pixel.
    """
    width, height = lens.image_size
    random = np.random.default_rng((seed, 7))
    world_from_camera = rotation_matrix(pose[0]).T
    eye = -world_from_camera @ pose[1]
    light, angle = np.zeros((height, width, 3)), np.full((height, width), np.nan)
    for top in range(0, height, _ROWS_A_BLOCK):
        rows = np.arange(top, min(height, top + _ROWS_A_BLOCK))
        y, x = np.repeat(rows, width), np.tile(np.arange(width), len(rows))
        rays = lens.unproject(np.column_stack([x, y]))
        inside = ~np.isnan(rays).any(axis=1)
        x, y = x[inside], y[inside]
        angle[y, x] = np.degrees(np.arccos(np.clip(rays[inside, 2], -1, 1)))
        for part in np.ndindex(rays_a_side, rays_a_side):
            off = (np.array(part) + random.uniform(size=(len(x), 2))) / rays_a_side - 0.5
            rays = lens.unproject(np.column_stack([x, y]) + off)
            lit = ~np.isnan(rays).any(axis=1)
            light[y[lit], x[lit]] += room.light(
                eye, rays[lit] @ world_from_camera.T, by_lamp=sum(part) % 2 == 1
            )
    light /= rays_a_side**2
    fall = 1 - _VIGNETTING * np.clip(angle / 90, 0, 1.1) ** 4
    fall *= np.clip((lens.max_angle_deg - angle) / _RIM_DEG, 0, 1) ** 0.5
    light *= np.nan_to_num(fall)[..., None]
    return _developed(light, angle / lens.max_angle_deg, random)


def _developed(
    light: FloatArray, off_axis: FloatArray, random: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Lens blur, scattered light, a sensor's noise and a gamma: linear RGB -> grey levels BGR."""
    rim = np.clip(np.nan_to_num(off_axis, nan=1.0), 0, 1)[..., None] ** 2
    sharp, soft = (cv2.GaussianBlur(light, (0, 0), sigma) for sigma in (_BLUR, _BLUR_AT_RIM))
    light = (1 - rim) * sharp + rim * soft
    light = light + _FLARE * _spread(light) + 0.002
    electrons = np.clip(light, 0, None) * _FULL
    noise = np.sqrt(electrons + _READ**2) * random.normal(size=light.shape)
    level = 255 * np.clip((electrons + noise) / _FULL, 0, 1) ** _GAMMA
    return np.rint(level[..., ::-1]).astype(np.uint8)


def _spread(light: FloatArray) -> FloatArray:
    """Light scattered far and wide: blurred on an eighth of the pixels."""
    height, width = light.shape[:2]
    small = cv2.resize(light, (width // 8, height // 8), interpolation=cv2.INTER_AREA)
    return cv2.resize(cv2.GaussianBlur(small, (0, 0), 8), (width, height))


def main() -> None:
    target, lens = Target.load(HERE / "target.yaml"), true_lens()
    (HERE / "photos").mkdir(exist_ok=True)
    room = Room(target)
    for seed, (name, pose) in enumerate(poses().items()):
        photo = photograph(room, lens, pose, seed=seed)
        cv2.imwrite(str(HERE / "photos" / name), photo, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    text = true_corners(target, lens)
    (HERE / "true_corners.csv").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
