"""The check for poles and folds must pass a sound P and catch a bad one."""

import numpy as np
import pytest
from lenses import cubic_camera

from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.models.lift import MONOMIALS
from cubicfish.models.sphere import cone_rays


def test_rays_fill_the_cone_evenly():
    rays = cone_rays(np.deg2rad(110), 2000)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1, atol=1e-14)
    theta = np.arccos(rays[:, 2])
    assert theta.max() == pytest.approx(np.deg2rad(110))
    share = np.mean(theta < np.deg2rad(60))
    assert share == pytest.approx((1 - 0.5) / (1 - np.cos(np.deg2rad(110))), abs=2e-3)
    assert np.abs(rays[:, :2].mean(axis=0)).max() < 1e-3


def test_a_sound_camera_passes():
    camera = cubic_camera()
    assert pole_or_fold_deg(camera.P, camera.max_angle_deg) is None


def test_a_pole_is_caught_where_it_is():
    """P3Φ = z − cos 70° vanishes on the circle at 70°."""
    P = np.zeros((3, 20))
    P[0, MONOMIALS.index("X")] = P[1, MONOMIALS.index("Y")] = 1
    P[2, MONOMIALS.index("Z")], P[2, MONOMIALS.index("1")] = 1, -np.cos(np.deg2rad(70))
    assert pole_or_fold_deg(P, 69.0) is None
    assert pole_or_fold_deg(P, 90.0) == pytest.approx(70, abs=0.7)


def test_a_fold_is_caught_where_it_is():
    """m = (x, y) is the orthographic lens: it folds back at 90°."""
    P = np.zeros((3, 20))
    P[0, MONOMIALS.index("X")] = P[1, MONOMIALS.index("Y")] = P[2, MONOMIALS.index("1")] = 1
    assert pole_or_fold_deg(P, 89.0) is None
    assert pole_or_fold_deg(P, 100.0) == pytest.approx(90, abs=0.7)


def test_a_mirrored_camera_is_caught():
    camera = cubic_camera()
    mirrored = camera.P * np.array([[-1], [1], [1]]) + camera.P[2] * np.array([[1], [0], [0]]) * 960
    assert pole_or_fold_deg(mirrored, 60.0) is not None


def test_a_narrow_pole_between_corners_is_caught():
    """A pole that numerators all but cancel moves few pixels, and still is one."""
    camera = cubic_camera()
    P = camera.P.copy()
    P[2] -= (
        1.02
        * (np.abs(P[2, MONOMIALS.index("1")]) + P[2, MONOMIALS.index("Z")])
        * np.eye(20)[MONOMIALS.index("X")]
    )
    assert pole_or_fold_deg(P, camera.max_angle_deg) is not None


def test_a_denominator_that_is_negative_everywhere_is_caught():
    """−P projects alike, but the file promises P3Φ > 0, and readers rely on it."""
    camera = cubic_camera()
    assert pole_or_fold_deg(-camera.P, camera.max_angle_deg) is not None
