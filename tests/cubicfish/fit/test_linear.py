"""P by linear equations: exact where the camera is a cubic, unbiased where reweighted."""

import numpy as np
from lenses import cubic_camera, radial_camera, random_rays

from cubicfish.fit.nearest_cubic import linear_ratios
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.models.lift import lift, sphere_basis
from cubicfish.models.sphere import cone_rays

SCALE, CENTRE = 220.0, np.array([488.0, 351.0])


def _pixels(coefficients, rays):
    homogeneous = lift(rays) @ sphere_basis() @ coefficients.T
    return homogeneous[:, :2] / homogeneous[:, 2:] * SCALE + CENTRE


def test_a_cubic_camera_is_recovered_exactly():
    camera = cubic_camera(bend=0.01)
    rays = random_rays(90, 400)
    coefficients = linear_ratios(
        lift(rays) @ sphere_basis(), (camera.project(rays) - CENTRE) / SCALE, denominator_pull=0
    )
    probe = random_rays(95, 500, seed=9)
    np.testing.assert_allclose(_pixels(coefficients, probe), camera.project(probe), atol=1e-6)


def test_reweighting_takes_the_bias_away():
    camera = cubic_camera(bend=0.01)
    rays = random_rays(90, 300)
    noisy = camera.project(rays) + np.random.default_rng(1).normal(0, 0.5, (300, 2))
    probe = random_rays(90, 500, seed=9)

    def error(rounds):
        found = linear_ratios(
            lift(rays) @ sphere_basis(), (noisy - CENTRE) / SCALE, denominator_pull=0, rounds=rounds
        )
        return np.sqrt(np.mean((_pixels(found, probe) - camera.project(probe)) ** 2))

    assert error(10) < 0.8 * error(0)


def test_the_pull_keeps_poles_out_of_a_smooth_lens():
    for angle in (20, 60, 100, 130):
        camera = radial_camera(angle)
        rays = cone_rays(np.deg2rad(angle), 300)
        coefficients = linear_ratios(
            lift(rays) @ sphere_basis(),
            (camera.project(rays) - CENTRE) / camera.fx,
            denominator_pull=1e-4,
        )
        P = coefficients @ sphere_basis().T
        assert pole_or_fold_deg(P, angle) is None
        values = lift(rays) @ P.T
        miss = values[:, :2] / values[:, 2:] * camera.fx + CENTRE - camera.project(rays)
        assert np.abs(miss).max() < 0.1


def test_rays_of_little_weight_say_little():
    """A lens that is no cubic in its middle is met all the same where the weight is."""
    camera = cubic_camera(bend=0.01)
    rays = random_rays(90, 400)
    middle = rays[:, 2] > np.cos(np.deg2rad(30))
    pixel = camera.project(rays)
    pixel[middle] += [40, -25] * np.sin(20 * rays[middle, :1])

    def miss(**weights):
        found = linear_ratios(
            lift(rays) @ sphere_basis(), (pixel - CENTRE) / SCALE, denominator_pull=0, **weights
        )
        return np.abs(_pixels(found, rays[~middle]) - pixel[~middle]).max()

    assert miss(weights=np.where(middle, 1e-6, 1.0)) < 1e-3 < 1 < miss()
