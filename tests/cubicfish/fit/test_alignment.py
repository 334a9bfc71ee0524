"""Two lenses under the rotation between their frames: found from anywhere, and taken out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lenses import cubic_camera, radial_camera, random_rays
from scipy.spatial.transform import Rotation

from cubicfish.comparison import aligned_difference

CAMERA = radial_camera(95.0)
RAYS = random_rays(94, 1500, seed=3)


class Turned:
    """A camera in a frame that is turned: its rays are R times those of the camera."""

    def __init__(self, camera, rotation):
        self.camera, self.rotation = camera, rotation

    def project(self, points):
        return self.camera.project(points @ self.rotation)


def check(rotation):
    miss, found = aligned_difference(Turned(CAMERA, rotation), CAMERA, RAYS)
    finite = np.isfinite(miss[:, 0])
    assert finite.mean() > 0.99
    assert np.abs(miss[finite]).max() < 1e-5
    np.testing.assert_allclose(found, rotation, atol=1e-7)


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.hypot(*q[:2]) > 0.1))
def test_any_rotation_is_found(quaternion):
    check(Rotation.from_quat(quaternion).as_matrix())


@pytest.mark.parametrize("axes", [np.diag([-1.0, -1, 1]), np.diag([1.0, -1, -1])])
def test_frames_with_other_axes(axes):
    check(axes)


@pytest.mark.parametrize("vector", [[3.1, 0, 0], [0, 0, 2.5], [1.5, -1, 0.7]])
def test_a_narrow_field_that_looks_elsewhere_is_found(vector):
    """From the unturned start the two fields have no ray in common."""
    camera = replace(cubic_camera(60.0, bend=0.002), max_angle_deg=40.0)
    turn = Rotation.from_rotvec(vector).as_matrix()
    rays = random_rays(39.5, 1000)
    miss, found = aligned_difference(Turned(camera, turn), camera, rays)
    finite = np.isfinite(miss[:, 0])
    assert finite.mean() > 0.97
    assert np.abs(miss[finite]).max() < 1e-5
    np.testing.assert_allclose(found, turn, atol=1e-7)


def test_equal_lenses_do_not_differ():
    miss, rotation = aligned_difference(CAMERA, CAMERA, RAYS)
    assert np.abs(miss).max() < 1e-6
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-8)


def test_a_difference_that_is_no_rotation_stays():
    """A cubic that is off a radial lens by a known bend, seen through a turned frame."""
    first, second = cubic_camera(95.0, bend=0.003), radial_camera(95.0)
    rays = random_rays(85, 1500)
    plain = first.project(rays) - second.project(rays)
    turn = Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix()
    miss, found = aligned_difference(Turned(first, turn), second, rays)
    again, by_itself = aligned_difference(first, second, rays)
    both = np.isfinite(miss[:, 0]) & np.isfinite(again[:, 0])
    assert both.mean() > 0.95
    np.testing.assert_allclose(miss[both], again[both], atol=1e-3)
    np.testing.assert_allclose(found, turn @ by_itself, atol=1e-5)
    rms = np.sqrt(np.nanmean(again**2))
    assert 0.1 < rms < np.sqrt(np.nanmean(plain**2))


def test_rays_outside_either_field_are_nan():
    narrow = replace(cubic_camera(95.0), max_angle_deg=40.0)
    miss, _ = aligned_difference(narrow, CAMERA, RAYS)
    assert np.isnan(miss[:, 0]).any()
    assert np.isfinite(miss[np.isfinite(narrow.project(RAYS)[:, 0])]).mean() > 0.95


@pytest.mark.parametrize("focal", [1.0, 1.02])
@pytest.mark.parametrize("seed", range(6))
def test_fields_that_overlap_by_a_sixth(seed, focal):
    """Rays that leave the field as frames turn are no gain: else turning all away is the best.

    A cone of 38 degrees fills 16 % of one of 95 degrees; its lens may be 2 % longer.
    """
    camera = cubic_camera(95.0, bend=0.002)
    x, y = camera.radial.cx, camera.radial.cy
    longer = np.array([[focal, 0, x - focal * x], [0, focal, y - focal * y], [0, 0, 1]])
    less = replace(cubic_camera(38.0, bend=0.002), P=longer @ camera.P)
    turn = Rotation.random(random_state=seed)
    miss, found = aligned_difference(Turned(less, turn.as_matrix()), camera, RAYS)
    assert 0.15 < np.isfinite(miss[:, 0]).mean() < 0.17
    assert np.rad2deg((turn.inv() * Rotation.from_matrix(found)).magnitude()) < 0.2
