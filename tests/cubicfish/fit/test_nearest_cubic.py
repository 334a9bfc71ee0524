"""The cubic nearest to a radial lens."""

from dataclasses import replace

import numpy as np
import pytest

from cubicfish.fit.nearest_cubic import linear_cubic, nearest_cubic
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.statistics import rms_px


def radial(focal, *k):
    return RadialCamera.from_parameters([focal, 1.002 * focal, 329, 243, *k], (640, 480))


# (lens, half-angle of the corners in degrees, how near a cubic comes at least, pixels)
CAMERAS = {
    # Of a real narrow camera's kind: beyond its corners its profile is wild.
    "narrow": (radial(600.0, 0.32, 1.9, -9.7, 15.0), 29.8, 0.015),
    "half a turn": (radial(220.0, -0.02, 0.004, -0.002, 0.0002), 90.0, 0.003),
    "pinhole": (radial(800.0, 1 / 3, 2 / 15, 17 / 315, 62 / 2835), 20.0, 0.003),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_it_is_nearer_than_the_linear_solution(name):
    camera, half_deg, bound = CAMERAS[name]
    found = nearest_cubic(camera, (0.0, np.radians(half_deg)))
    nearest = rms_px(found.miss[found.within])
    assert nearest < bound
    assert pole_or_fold_deg(found.lens.P, half_deg + 5) is None
    among = found.rays[found.within]
    miss = found.lens.far(among) - camera.project(among)
    np.testing.assert_allclose(miss, found.miss[found.within], atol=1e-9)
    linear = linear_cubic(found.rays, camera.project(found.rays), camera, denominator_pull=1e-4)
    beside = linear.far(among) - camera.project(among)
    assert nearest <= rms_px(beside)


def test_p_keeps_its_pixels_in_another_normalisation():
    camera, half_deg, _ = CAMERAS["narrow"]
    lens = nearest_cubic(camera, (0.0, np.radians(half_deg))).lens
    other = nearest_cubic(replace(camera, fx=580.0, cx=300.0), (0.0, np.radians(25)))
    moved = other.lens.with_pixels_of(lens, other.rays)
    np.testing.assert_allclose(moved.far(other.rays), lens.far(other.rays), atol=1e-9)
    # The scale is free no more: parameters go round.
    again = moved.with_parameters(moved.parameters)
    np.testing.assert_allclose(again.coefficients, moved.coefficients, atol=1e-12)


@pytest.mark.slow
def test_the_same_lens_has_the_same_cubic_every_time():
    """Wherever its arrays lie in memory."""
    camera, half_deg, _ = CAMERAS["pinhole"]
    rng, kept, found = np.random.default_rng(0), [], set()
    for _ in range(25):
        kept += [np.empty(size) for size in rng.integers(1, 3000, 20)]
        found.add(nearest_cubic(camera, (0.0, np.radians(half_deg))).lens.coefficients.tobytes())
    assert len(found) == 1


@pytest.mark.parametrize("name", CAMERAS)
def test_from_a_known_cubic_it_is_as_near(name):
    camera, half_deg, _ = CAMERAS[name]
    other = replace(camera, fx=1.002 * camera.fx, cx=camera.cx + 1.0, cy=camera.cy - 0.5)
    known = nearest_cubic(other, (0.0, np.radians(half_deg + 0.5)))
    angles = (0.0, np.radians(half_deg))
    fresh, warm = nearest_cubic(camera, angles), nearest_cubic(camera, angles, known)
    assert rms_px(warm.miss[warm.within]) < rms_px(fresh.miss[fresh.within]) + 1e-4
    np.testing.assert_allclose(
        warm.lens.far(warm.rays[warm.within]), fresh.lens.far(fresh.rays[fresh.within]), atol=1e-3
    )
    assert pole_or_fold_deg(warm.lens.P, half_deg + 5) is None
