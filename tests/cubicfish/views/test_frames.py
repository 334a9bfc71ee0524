"""Rescaled photos: the same rays at the pixels where they now are."""

import cv2
import numpy as np
import pytest
from lenses import cubic_camera, random_rays

from cubicfish import ViewError, build_map, build_view

CAMERA = cubic_camera(100.0)  # 960x720
RAYS = random_rays(90, 200)


@pytest.mark.parametrize("size", [(480, 360), (1920, 1440), (320, 240), (1440, 1080)])
def test_a_rescaled_photo_has_its_pixels_at_half_pixels_rescaled(size):
    made = CAMERA.for_photos(size)
    scale = size[0] / 960
    for one, other in ((made, CAMERA), (made.radial, CAMERA.radial)):
        expected = (other.project(RAYS) + 0.5) * scale - 0.5
        np.testing.assert_allclose(one.project(RAYS), expected, atol=1e-8)
    assert made.image_size == size


def test_an_exact_half_of_a_photo_shows_the_same_view():
    # A photo whose brightness is its column; averaging pairs is what halving means.
    whole = np.broadcast_to(np.arange(960, dtype=np.float32), (720, 960)).copy()
    half = cv2.resize(whole, (480, 360), interpolation=cv2.INTER_AREA)
    view = build_view(CAMERA)
    maps = build_map(CAMERA, view), build_map(CAMERA.for_photos((480, 360)), view)
    one, other = (
        cv2.remap(photo, m.map_x, m.map_y, cv2.INTER_LINEAR)
        for photo, m in zip((whole, half), maps, strict=True)
    )
    both = maps[0].valid & maps[1].valid
    assert np.abs(one - other)[both].max() < 0.1  # a forgotten half pixel gives 0.5


def test_the_calibrated_size_is_the_camera_itself():
    assert CAMERA.for_photos((960, 720)) is CAMERA


@pytest.mark.parametrize("size", [(720, 960), (481, 360), (480, 361), (960, 540)])
def test_other_shapes_are_refused_with_both_sizes(size):
    with pytest.raises(ViewError, match=f"{size[0]}x{size[1]}.*960x720.*exactly that shape"):
        CAMERA.for_photos(size)
