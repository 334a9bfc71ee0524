"""Make before_after.jpg, the README's picture, from a sample photo and a calibrated camera.

Run ``python docs/before_after.py`` where ``calibration/camera.yaml`` is, after the README's
first command.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.photos import read_picture
from cubicfish_cli.undistortion.images import remap_picture, write_picture
from cubicfish_cli.undistortion.maps import build_map
from cubicfish_cli.undistortion.views import PerspectiveView

HERE = Path(__file__).parent
PHOTO = HERE.parent / "sample_data" / "photos" / "corner_01.jpg"
CAMERA = Path("calibration") / "camera.yaml"
SIZE = (640, 480)


def main() -> None:
    """Write the photo and its flat view side by side."""
    camera = load_camera(CAMERA).camera
    photo = read_picture(PHOTO)
    flat = remap_picture(photo, build_map(camera, PerspectiveView.with_field(110, SIZE)))
    before = cv2.resize(photo, SIZE, interpolation=cv2.INTER_AREA)
    gap = np.full((SIZE[1], 8), 255, np.uint8)
    both = np.hstack([np.asarray(before), gap, np.asarray(flat)])
    write_picture(HERE / "before_after.jpg", both, overwrite=True)


if __name__ == "__main__":
    main()
