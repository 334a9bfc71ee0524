"""How far apart two cameras are: known differences come out, in the first camera's pixels."""

from dataclasses import replace

import numpy as np
import pytest
from lenses import cubic_camera, radial_camera

from cubicfish.comparison import compare, pixel_grid
from cubicfish.errors import FitError
from cubicfish.solve.poses import rotation_from_vector

CAMERA = radial_camera(90.0)


def scaled(camera, scale):
    """The same lens on photos with ``scale`` times as many pixels per side."""
    width, height = camera.image_size
    return replace(
        camera,
        image_size=(round(width * scale), round(height * scale)),
        fx=camera.fx * scale,
        fy=camera.fy * scale,
        cx=(camera.cx + 0.5) * scale - 0.5,
        cy=(camera.cy + 0.5) * scale - 0.5,
    )


def test_a_camera_is_itself():
    result = compare(CAMERA, CAMERA)
    assert result.statistics.max_px < 1e-6
    assert result.rotation_deg < 1e-6
    assert result.common_share == 1


@pytest.mark.parametrize("scale", [0.5, 2.0, 1.25])
def test_an_exact_rescale_is_the_same_camera(scale):
    result = compare(CAMERA, scaled(CAMERA, scale))
    assert result.scale == pytest.approx(1 / scale)
    assert result.statistics.max_px < 1e-6


def test_other_sizes_are_refused():
    with pytest.raises(FitError, match="960x720 and 960x721"):
        compare(CAMERA, replace(CAMERA, image_size=(960, 721)))


def test_a_stretch_that_no_rotation_makes():
    """One percent along x: at the pixel x the difference is 0.01 (x − cx)."""
    result = compare(CAMERA, replace(CAMERA, fx=1.01 * CAMERA.fx))
    assert result.rotation_deg < 0.01
    pixel = np.array([[300.0, 351], [488, 600], [800, 200]])
    expected = np.stack([0.01 * (pixel[:, 0] - CAMERA.cx), np.zeros(3)], axis=-1)
    np.testing.assert_allclose(result.difference(pixel), expected, atol=0.03)
    grid = pixel_grid(CAMERA.image_size, 40_000)
    seen = np.isfinite(CAMERA.unproject(grid)[:, 0])
    off = 0.01 * np.abs(grid[seen, 0] - CAMERA.cx)
    assert result.statistics.rms_px == pytest.approx(np.sqrt(np.mean(off**2)), rel=0.01)
    assert result.statistics.max_px == pytest.approx(off.max(), rel=0.02)
    assert result.statistics.corners == seen.sum()


class Turned:
    """CAMERA in a frame that is turned by ``rotation``."""

    image_size = CAMERA.image_size

    def __init__(self, rotation):
        self.rotation = rotation

    def project(self, points):
        return CAMERA.project(points @ self.rotation)


def test_a_turned_frame_is_the_same_camera():
    turn = rotation_from_vector([[0.02, -0.4, 0.3]])[0]
    result = compare(CAMERA, Turned(turn))
    np.testing.assert_allclose(result.rotation, turn, atol=1e-8)
    assert result.rotation_deg == pytest.approx(np.rad2deg(np.linalg.norm([0.02, -0.4, 0.3])))
    pixel = np.array([[300.0, 351], [488, 600], [800, 200]])
    np.testing.assert_allclose(result.difference(pixel), 0, atol=1e-5)


def test_rings_by_angle_hold_all_pixels():
    wide, narrow = cubic_camera(95.0, bend=0.002), cubic_camera(60.0, bend=0.002)
    result = compare(wide, replace(narrow, P=wide.P))
    assert 0.2 < result.common_share < 0.6
    assert sum(ring["pixels"] for ring in result.rings) == result.statistics.corners
    assert result.rings[0]["from_deg"] == 0
    assert result.rings[-1]["to_deg"] == 60
    assert result.statistics.max_px < 1e-4
    stretched = compare(CAMERA, replace(CAMERA, fx=1.01 * CAMERA.fx, fy=1.01 * CAMERA.fy))
    rms = [ring["rms_px"] for ring in stretched.rings]
    assert rms == sorted(rms)


def test_no_common_field():
    class Blind:
        image_size = CAMERA.image_size

        def project(self, points):
            return np.full((*np.shape(points)[:-1], 2), np.nan)

    with pytest.raises(FitError, match="no common field"):
        compare(CAMERA, Blind())
