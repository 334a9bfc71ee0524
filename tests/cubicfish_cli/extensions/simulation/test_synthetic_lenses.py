from math import radians

import numpy as np
import pytest
from lenses import random_rays
from scipy.optimize import least_squares
from synthetic_lenses import SYNTHETIC_LENSES, MirrorProfile, RaysAtDistance, synthetic_lens

from cubicfish import aligned_difference
from cubicfish.fit.decentred import DecentredFit
from cubicfish.models import cone_rays

CENTRAL = ("equisolid", "orthographic")

every_lens = pytest.mark.parametrize("name", SYNTHETIC_LENSES)


def pixels(lens) -> np.ndarray:
    width, height = lens.image_size
    return np.stack(np.meshgrid(np.arange(0, width, 9.0), np.arange(0, height, 9.0)), axis=-1)


@every_lens
@pytest.mark.parametrize("distance", [40.0, 3000.0])
def test_points_on_the_ray_of_a_pixel_are_seen_there(name, distance):
    lens = synthetic_lens(name)
    pixel = pixels(lens)
    ray = lens.unproject(pixel)
    seen = np.isfinite(ray[..., 0])
    assert 0.5 < seen.mean() < 0.8
    np.testing.assert_allclose(np.linalg.norm(ray[seen], axis=-1), 1, atol=1e-12)
    point = distance * ray
    point[..., 2] += lens.ray_starts(ray)
    np.testing.assert_allclose(lens.project(point)[seen], pixel[seen], atol=1e-9)


@every_lens
def test_distance_matters_where_a_lens_is_not_central(name):
    lens = synthetic_lens(name)
    ray = random_rays(lens.max_angle_deg - 5, 500)
    ray = ray[ray[:, 2] < np.cos(radians(20))]
    moved = np.linalg.norm(lens.project(100 * ray) - lens.project(400 * ray), axis=1)
    assert moved.max() < 1e-9 if name in CENTRAL else 0.3 < moved.max() < 5


@every_lens
def test_a_lens_of_rays_stands_for_it_at_a_distance(name):
    lens = synthetic_lens(name)
    rays = random_rays(lens.max_angle_deg - 5, 500)
    rays = rays[rays[:, 2] < np.cos(radians(20))]
    central = RaysAtDistance(lens=lens, centre=2.0, distance=250.0)
    pixel = central.project(rays)
    np.testing.assert_allclose(central.unproject(pixel), rays, atol=1e-10)
    np.testing.assert_allclose(
        lens.project(central.distance * rays + [0, 0, central.centre]), pixel
    )
    near, far = (np.abs(central.project(d * rays) - pixel).max() for d in (1, 9))
    assert near == pytest.approx(far, abs=1e-9)


@every_lens
def test_none_is_of_the_family_that_p_is_held_to(name):
    """The fitted prior's own lens, with all its numbers free, stays farther away than noise."""
    lens = synthetic_lens(name)
    rays = cone_rays(radians(lens.max_angle_deg - 3), 3000)
    rays = rays[rays[:, 2] < np.cos(radians(lens.min_angle_deg + 1))]
    truth = lens.far.project(rays)
    start = DecentredFit(
        values=np.array([*lens.focal, *lens.centre, *np.zeros(9)]), terms=4, noise_px=1, spread=1
    )

    def miss(values):
        return (start.with_parameters(values).project(rays) - truth).ravel()

    nearest = start.with_parameters(least_squares(miss, start.parameters, x_scale="jac").x)
    rms = np.sqrt(np.mean(np.sum((nearest.project(rays) - truth) ** 2, axis=1)))
    assert 0.02 < rms < 2


def test_a_mirror_with_the_pinhole_in_its_focus_is_central():
    """The unified model (Geyer and Daniilidis 2000) in closed form."""
    a, c = 15.0, 25.0
    mirror = MirrorProfile(a_mm=a, c_mm=c, off_mm=0.0, pinhole_angle=0.6)
    angle = np.linspace(0.05, 1.7, 50)
    np.testing.assert_allclose(mirror.pupil(angle), 0, atol=1e-6)
    eccentricity = c / a
    skew = 2 * eccentricity / (1 + eccentricity**2)
    # r = tan of the pinhole's angle; straight down is towards the camera.
    radius = np.sin(angle) / (skew + np.cos(angle))
    np.testing.assert_allclose(
        mirror.radius(angle) / radius, mirror.radius(angle)[0] / radius[0], rtol=1e-6
    )


def test_lengths_follow_the_targets_unit():
    ray = np.array([[1.0, 0.4, 0.3]])
    for name in SYNTHETIC_LENSES:
        in_mm, in_m = synthetic_lens(name), synthetic_lens(name, units="m")
        np.testing.assert_allclose(in_m.project(0.2 * ray), in_mm.project(200 * ray), atol=1e-9)


@every_lens
def test_outside_the_field_there_is_no_pixel_and_no_ray(name):
    lens = synthetic_lens(name)
    assert np.isnan(lens.project([[0, 0, -100.0], [0, 0, 0], [np.nan, 1, 1]])).all()
    assert np.isnan(lens.unproject([[-1e9, 0], [np.nan, 3], [0, 0]])).all()
    assert np.isnan(lens.project([0, 0, 100.0])).all() == (name == "mirror")


def test_the_comparison_of_cameras_takes_them():
    lens = synthetic_lens("moving-pupil")
    rays = cone_rays(radians(80), 1000)
    one, other = (RaysAtDistance(lens=lens, centre=0.0, distance=d) for d in (200, 220))
    miss, _ = aligned_difference(one, other, rays)
    assert 0 < np.nanmax(np.abs(miss)) < 0.1
