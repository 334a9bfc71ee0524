"""Rescaled and cropped photos: the same rays at the pixels where they now are."""

import cv2
import numpy as np
import pytest
from lenses import cubic_camera, random_rays

from cubicfish_cli.errors import ViewError
from cubicfish_cli.undistortion.choose import build_view
from cubicfish_cli.undistortion.maps import Crop, build_map, camera_for_photos, parse_crop

CAMERA = cubic_camera(100.0)  # 960x720
RAYS = random_rays(90, 200)


@pytest.mark.parametrize("size", [(480, 360), (1920, 1440), (320, 240), (1440, 1080)])
def test_a_rescaled_photo_has_its_pixels_at_half_pixels_rescaled(size):
    made = camera_for_photos(CAMERA, size)
    scale = size[0] / 960
    for one, other in ((made, CAMERA), (made.radial, CAMERA.radial)):
        expected = (other.project(RAYS) + 0.5) * scale - 0.5
        np.testing.assert_allclose(one.project(RAYS), expected, atol=1e-8)
    assert made.image_size == size


def test_a_crop_shifts_and_may_be_rescaled():
    crop = Crop(x=100, y=60, width=640, height=480)
    shifted = camera_for_photos(CAMERA, (640, 480), crop).project(RAYS)
    np.testing.assert_allclose(shifted, CAMERA.project(RAYS) - [100, 60], atol=1e-8)
    half = camera_for_photos(CAMERA, (320, 240), crop).project(RAYS)
    np.testing.assert_allclose(half, (shifted + 0.5) / 2 - 0.5, atol=1e-8)


def test_an_exact_half_of_a_photo_shows_the_same_view():
    # A photo whose brightness is its column; averaging pairs is what halving means.
    whole = np.broadcast_to(np.arange(960, dtype=np.float32), (720, 960)).copy()
    half = cv2.resize(whole, (480, 360), interpolation=cv2.INTER_AREA)
    view = build_view(CAMERA)
    maps = build_map(CAMERA, view), build_map(camera_for_photos(CAMERA, (480, 360)), view)
    one, other = (
        cv2.remap(photo, m.map_x, m.map_y, cv2.INTER_LINEAR)
        for photo, m in zip((whole, half), maps, strict=True)
    )
    both = maps[0].valid & maps[1].valid
    assert np.abs(one - other)[both].max() < 0.1  # a forgotten half pixel gives 0.5


def test_the_calibrated_size_is_the_camera_itself():
    assert camera_for_photos(CAMERA, (960, 720)) is CAMERA


@pytest.mark.parametrize("size", [(720, 960), (481, 360), (480, 361), (960, 540)])
def test_other_shapes_are_refused_with_both_sizes(size):
    with pytest.raises(ViewError, match=f"{size[0]}x{size[1]}.*960x720.*--crop"):
        camera_for_photos(CAMERA, size)


@pytest.mark.parametrize("crop", [(400, 0, 640, 480), (0, 300, 640, 480), (0, 0, 0, 0)])
def test_a_crop_that_is_not_in_the_photo_is_refused(crop):
    x, y, width, height = crop
    with pytest.raises(ViewError, match="does not lie within"):
        camera_for_photos(CAMERA, (640, 480), Crop(x=x, y=y, width=width, height=height))


def test_a_photo_of_another_shape_than_the_crop_is_refused():
    with pytest.raises(ViewError, match="960x720 pixels, the crop is 640x360"):
        camera_for_photos(CAMERA, (960, 720), Crop(x=0, y=0, width=640, height=360))


def test_crops_are_written_as_elsewhere():
    assert parse_crop("640x480+320+160") == Crop(x=320, y=160, width=640, height=480)
    for text in ("640x480", "640x480-1+2", "a", "640x480+320+160 ;", "9999999x1+0+0"):
        with pytest.raises(ViewError, match=r"WIDTHxHEIGHT\+X\+Y"):
            parse_crop(text)
