from math import atan2, hypot, radians

import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from hypothesis import given
from hypothesis import strategies as st
from synthetic import IMAGE_SIZE, TRUE_LENS, lens_of_size, rays_in_cone

from cubicfish.models import angle_from_axis


def by_the_formula(ray, lens):
    """The class's docstring, coded line by line."""
    x, y, z = ray
    theta = atan2(hypot(x, y), z)
    if theta > radians(lens.max_angle_deg):
        return float("nan"), float("nan")
    r = theta + sum(k * theta ** (2 * i + 3) for i, k in enumerate(lens.k))
    a, b = r * x / hypot(x, y), r * y / hypot(x, y)
    (p1, p2), (t1, t2) = lens.p, lens.tilt
    a, b = (
        a + 2 * p1 * a * b + p2 * (r * r + 2 * a * a),
        b + p1 * (r * r + 2 * b * b) + 2 * p2 * a * b,
    )
    w = 1 + t1 * a + t2 * b
    return lens.fx * a / w + lens.cx, lens.fy * b / w + lens.cy


def test_projection_is_the_printed_formula():
    rays = rays_in_cone(100, 300) * np.linspace(0.1, 50, 300)[:, None]
    expected = [by_the_formula(ray, TRUE_LENS) for ray in rays]
    np.testing.assert_allclose(TRUE_LENS.project(rays), expected, atol=1e-9)
    assert np.isnan(expected).any()


def test_every_pixel_of_the_field_comes_back():
    x, y = np.meshgrid(np.arange(0, IMAGE_SIZE[0], 7.0), np.arange(0, IMAGE_SIZE[1], 7.0))
    pixel = np.stack([x, y], axis=-1)
    rays = TRUE_LENS.unproject(pixel)
    seen = ~np.isnan(rays[..., 0])
    assert rays.shape == (*x.shape, 3)
    np.testing.assert_allclose(np.linalg.norm(rays[seen], axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(TRUE_LENS.project(rays)[seen], pixel[seen], atol=1e-9)
    assert 94.5 < np.degrees(angle_from_axis(rays[seen])).max() <= 95
    # The corners of the picture are beyond the field; the picture's middle row is all inside.
    assert not seen[0, 0]
    assert not seen[-1, -1]
    assert seen[:, x.shape[1] // 2].all()


@given(
    turn=st.floats(-np.pi, np.pi),
    angle_deg=st.floats(0, 94.999),
    length=st.floats(1e-3, 1e6),
)
def test_every_ray_of_the_field_comes_back(turn, angle_deg, length):
    angle = np.radians(angle_deg)
    ray = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    np.testing.assert_allclose(TRUE_LENS.unproject(TRUE_LENS.project(ray * length)), ray, atol=1e-9)


def test_outside_the_field_there_is_no_pixel_and_no_ray():
    assert np.isnan(TRUE_LENS.project([np.sin(1.66), 0, np.cos(1.66)])).all()
    assert np.isnan(TRUE_LENS.project([0, 0, -1])).all()
    assert np.isnan(TRUE_LENS.project([0, 0, 0])).all()
    assert np.isnan(TRUE_LENS.unproject([[-1e9, 0], [np.nan, 3], [485, 1200]])).all()
    np.testing.assert_allclose(TRUE_LENS.project([0, 0, 2]), (TRUE_LENS.cx, TRUE_LENS.cy))


def test_a_lens_whose_radius_shrinks_is_refused():
    with pytest.raises(ValueError, match="stops growing"):
        AsymmetricLens(image_size=(10, 10), fx=1, fy=1, cx=0, cy=0, k=(-0.3, 0, 0, 0))


def test_a_smaller_sensor_sees_the_same_picture():
    half = lens_of_size(0.5)
    pixel = np.array([[100.0, 80.0], [300.0, 200.0]])
    # The half-size pixel (i, j) covers the pixels 2i, 2i + 1: its centre is at 2i + 0.5.
    np.testing.assert_allclose(
        half.unproject(pixel), TRUE_LENS.unproject(2 * pixel + 0.5), atol=1e-12
    )


def test_strong_decentring_is_undone_too():
    lens = AsymmetricLens(image_size=(960, 720), fx=260, fy=260, cx=480, cy=360, p=(0.02, -0.04))
    rays = rays_in_cone(94.9, 2000)
    np.testing.assert_allclose(lens.unproject(lens.project(rays)), rays, atol=1e-11)
