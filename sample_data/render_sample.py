"""Render the sample photos: ``python sample_data/render_sample.py`` writes photos/ anew.

The lens is read from true_camera.yaml and the boards from target.yaml. The same files give
the same photos, but for what a JPEG encoder's version changes. ``true_corners.csv`` holds where
the lens really sees each corner, in the layout of ``cubicfish detect``.
"""

from __future__ import annotations

from math import radians
from pathlib import Path

import cv2

from cubicfish_cli.rendering.lens import TrueLens
from cubicfish_cli.rendering.lens_file import load_lens
from cubicfish_cli.rendering.pose import Pose, look_at
from cubicfish_cli.rendering.render import render
from cubicfish_cli.rendering.truth import true_corners_text
from cubicfish_cli.target import Target, load_target

HERE = Path(__file__).parent

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


def true_lens() -> TrueLens:
    """The lens of true_camera.yaml."""
    return load_lens(HERE / "true_camera.yaml")


def poses() -> dict[str, Pose]:
    """Photo name -> camera_from_world."""
    return {
        f"corner_{number:02d}.jpg": look_at(eye, aim, roll=radians(roll))
        for number, (eye, aim, roll) in enumerate(VIEWS, start=1)
    }


def true_corners(target: Target, lens: TrueLens) -> str:
    """The visible corners of all photos as the text of a corners file."""
    return true_corners_text(target, lens, poses(), lens.image_size)


def main() -> None:
    target, lens = load_target(HERE / "target.yaml"), true_lens()
    (HERE / "photos").mkdir(exist_ok=True)
    for seed, (name, pose) in enumerate(poses().items()):
        photo = render(
            target,
            lens.unproject,
            pose,
            lens.image_size,
            supersample=5,
            noise=2.5,
            blur=0.6,
            vignetting=0.45,
            seed=seed,
        )
        cv2.imwrite(str(HERE / "photos" / name), photo, [cv2.IMWRITE_JPEG_QUALITY, 95])
    text = true_corners(target, lens)
    (HERE / "true_corners.csv").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
