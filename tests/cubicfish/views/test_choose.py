"""The view that is made of what is asked, and by default."""

import math
from dataclasses import replace

import numpy as np
import pytest
from lenses import cubic_camera
from saved_maps import every_pixel
from synthetic import TRUE_LENS

from cubicfish import UsageError, ViewError, build_map, build_view
from cubicfish.views import CentralView, ViewOptions, choose_view

SIZE = (120, 90)


def test_default_view_keeps_the_scale_on_the_axis():
    lens = replace(TRUE_LENS, image_size=(600, 500))
    view = build_view(lens)
    assert view.size == lens.image_size
    assert view.rotation == (0, 0, 0)
    near = np.array([[0, 0, 1.0], [0.01, 0, 1]])
    true = np.linalg.norm(np.diff(lens.project(near), axis=0))
    assert view.focal * 0.01 == pytest.approx(true, rel=5e-3)
    assert view.focal == pytest.approx(math.sqrt(lens.fx * lens.fy), rel=2e-3)


@pytest.mark.parametrize("size", [(960, 720), (720, 960)])
def test_default_view_is_at_most_120_degrees_wide(size):
    view = build_view(replace(TRUE_LENS, image_size=size))
    longer = CentralView(kind="perspective", size=(960, 1), focal=view.focal)
    assert longer.hfov_deg == pytest.approx(120)


def test_default_view_stays_in_a_narrow_cameras_field():
    narrow = replace(TRUE_LENS, image_size=(600, 500), max_angle_deg=40.0)
    assert build_view(narrow).hfov_deg == pytest.approx(80)


def test_default_view_needs_a_sound_axis():
    class Blind:
        image_size = (10, 10)
        max_angle_deg = 90.0

        def project(self, points):
            return np.full((*np.shape(points)[:-1], 2), np.nan)

    class Mirrored(Blind):
        def project(self, points):
            return TRUE_LENS.project(np.asarray(points) * [-1, 1, 1])

    for camera in (Blind(), Mirrored()):
        with pytest.raises(ViewError, match="no sound scale"):
            build_view(camera)


@pytest.mark.parametrize("kind", ["perspective", "equidistant", "epipolar-equirectangular"])
def test_the_whole_photo_is_shown_beyond_what_is_calibrated(kind):
    camera = cubic_camera(85.0)
    narrow = replace(camera, max_angle_deg=40.0)
    chosen = choose_view(narrow, ViewOptions(kind=kind, fit="whole", size=SIZE))
    made, own = chosen.maps[""], build_map(narrow, chosen.first)
    true = build_map(camera, chosen.first)
    assert chosen.extrapolates
    assert chosen.lost_shares is not None
    assert chosen.lost_shares[0] > 0.5
    np.testing.assert_array_equal(made.valid, own.valid)
    np.testing.assert_array_equal(made.map_x[made.valid], own.map_x[own.valid])
    assert not (made.empty & true.valid).any()
    beyond = true.valid & ~made.valid
    assert beyond.sum() > 2 * made.valid.sum()
    # It goes on from where the camera is known, and so nearer than its radial reference alone.
    reference = camera.radial.project(chosen.first.rays(every_pixel(chosen.first)))
    off = np.hypot(made.map_x - true.map_x, made.map_y - true.map_y)[beyond]
    apart = reference - np.stack([true.map_x, true.map_y], axis=-1)
    assert off.max() < 0.6 * np.linalg.norm(apart[beyond], axis=-1).max()


def test_only_one_cameras_photos_are_shown_whole():
    with pytest.raises(UsageError, match="one camera"):
        choose_view(TRUE_LENS, ViewOptions(fit="whole"))
    with pytest.raises(UsageError, match="ViewOptions"):
        build_view(cubic_camera(85.0), fit="whole")
