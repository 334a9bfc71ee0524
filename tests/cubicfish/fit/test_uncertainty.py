"""The uncertainty's size is right: predicted against the spread over many draws of noise."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from lenses import radial_camera
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cubicfish.calibration import calibrate as calibrate_target
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.prior import Prior
from cubicfish.fit.radial_reference import fit_radial, refit_radial
from cubicfish.fit.uncertainty import (
    Gauge,
    camera_uncertainty,
    corner_noise_px,
    uncertainty_grid,
)
from cubicfish.judge.uncertainty import UncertaintyGrid
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.subset import select_photos, with_mean_weight_one, world_scale
from cubicfish.target.target import Target

TARGET = synthetic.corner_of_three()
BOARD = Target(units="m", boards=(synthetic.checkerboard("board", 6, 4, 0.03),))
NOISE, DRAWS = 0.1, 100
PRIOR = Prior(spread=0.01, weight=0.1)


def draw(seed, noise=NOISE, photos=5):
    poses = synthetic.poses_around(TARGET, photos, seed=40)
    return synthetic.synthetic_correspondences(TARGET, poses, noise=noise, seed=seed)


def turn_between(one, other, rays):
    """The turn after which rays have about the same pixels in another lens."""

    def apart(vector):
        return (other.far(Rotation.from_rotvec(vector).apply(rays)) - one.far(rays)).ravel()

    return Rotation.from_rotvec(least_squares(apart, np.zeros(3)).x)


@pytest.mark.slow
def test_prediction_is_the_spread_over_draws():
    start = fit_radial(draw(0))
    reference = fit_cubic(start, PRIOR)
    uncertainty = camera_uncertainty(reference)
    assert uncertainty.noise_px == pytest.approx(NOISE, rel=0.05)
    rays = cone_rays(np.deg2rad(80), 60)
    predicted = uncertainty.sigma_px(rays)

    pixels = []
    common = reference.poses.apply(start.pairs.image, start.pairs.world)
    for seed in range(1, DRAWS + 1):
        radial = refit_radial(start, draw(seed), start.poses)
        fit = fit_cubic(radial, PRIOR, relative_decrease=1e-6)
        turn = turn_between(reference.lens, fit.lens, common)
        pixels.append(fit.lens.far(turn.apply(rays)))
    spread = np.sqrt(np.var(pixels, axis=0, ddof=1).sum(axis=-1))
    # Each ray's spread is itself known to 7 % from 100 draws; their mean is much steadier.
    ratio = predicted / spread
    assert np.mean(ratio) == pytest.approx(1, abs=0.1)
    assert np.percentile(np.abs(ratio - 1), 80) < 0.25
    # More corners' noise, more uncertainty, in proportion.
    noisier = fit_radial(draw(0, 2 * NOISE))
    twice = camera_uncertainty(fit_cubic(noisier, PRIOR))
    assert np.median(twice.sigma_px(rays) / predicted) == pytest.approx(2, rel=0.2)


def test_more_photos_make_it_smaller():
    def sigma(count):
        poses = synthetic.poses_around(TARGET, count, seed=40)
        pairs = synthetic.synthetic_correspondences(TARGET, poses, noise=NOISE, seed=1)
        reference = fit_radial(pairs)
        uncertainty = camera_uncertainty(fit_cubic(reference, PRIOR))
        return np.median(uncertainty.sigma_px(cone_rays(np.deg2rad(60), 100)))

    assert sigma(15) < 0.75 * sigma(5)


def test_what_is_left_is_no_turn():
    start = fit_radial(draw(0))
    fit = fit_cubic(start, PRIOR)
    points = fit.poses.apply(start.pairs.image, start.pairs.world)
    gauge = Gauge.over(fit.lens, points[:200]) + Gauge.over(fit.lens, points[200:])
    turned = [
        (fit.lens.far(Rotation.from_rotvec(turn).apply(points)) - fit.lens.far(points)).ravel()
        for turn in 1e-6 * np.eye(3)
    ]
    whole = fit.lens.far_jacobian(points)[2].reshape(2 * len(points), -1)
    size = np.linalg.norm(turned) * np.linalg.norm(whole, axis=0)
    assert (np.abs(turned @ gauge.by_lens(points)) <= 1e-5 * size).all()
    assert (np.abs(turned @ whole) > 1e-2 * size).any()


def test_a_photo_from_far_away_takes_nothing_away():
    """Its own turn is hardly known, which says nothing of the camera."""
    near = synthetic.poses_around(TARGET, 8, seed=40)
    far = synthetic.poses_around(TARGET, 1, seed=7, distance=(8, 9), off_axis_deg=10.0)

    def sigma(poses):
        pairs = synthetic.synthetic_correspondences(TARGET, poses, noise=NOISE, seed=1)
        reference = fit_radial(pairs)
        uncertainty = camera_uncertainty(fit_cubic(reference, PRIOR))
        return uncertainty.sigma_px(cone_rays(np.deg2rad(60), 100))

    assert (sigma(near + far) < 1.05 * sigma(near)).all()


def sigma_of(pairs):
    reference = fit_radial(with_mean_weight_one(pairs))
    uncertainty = camera_uncertainty(fit_cubic(reference, PRIOR))
    return np.median(uncertainty.sigma_px(cone_rays(np.deg2rad(60), 100)))


def test_noisy_photos_and_slips_that_hardly_count_make_it_hardly_larger():
    poses = synthetic.poses_around(TARGET, 9, seed=40)
    pairs = synthetic.synthetic_correspondences(TARGET, poses, noise=NOISE, seed=1)
    alone = sigma_of(select_photos(pairs, np.arange(6)))
    rng, noisy = np.random.default_rng(2), pairs.image >= 6
    more = rng.normal(0, 8 * NOISE, pairs.pixel.shape) * noisy[:, None]
    known = replace(pairs, pixel=pairs.pixel + more, weight=np.where(noisy, 1 / 65, 1.0))
    assert sigma_of(known) < 1.05 * alone
    slips = rng.random(len(pairs.pixel)) < 0.02
    slipped = replace(
        pairs, pixel=pairs.pixel + rng.normal(0, 1.5, (len(slips), 2)) * slips[:, None]
    )
    assert sigma_of(slipped) < 1.2 * sigma_of(pairs)


@pytest.mark.slow
def test_what_is_held_takes_few_degrees_of_freedom():
    """Few corners, and a lens that is held so firmly that they hardly move it."""
    poses = synthetic.poses_around(BOARD, 4, seed=3, distance=(0.2, 0.4))
    found = []
    for seed in range(8):
        pairs = synthetic.synthetic_correspondences(
            BOARD, poses, lens=radial_camera(), noise=NOISE, seed=seed
        )
        reference = fit_radial(pairs.with_world(pairs.world / world_scale(pairs)))
        fit = fit_cubic(reference, Prior(spread=0.0, weight=30.0))
        found.append(corner_noise_px(fit) ** 2)
    assert np.sqrt(np.mean(found)) == pytest.approx(NOISE, rel=0.06)


@pytest.mark.slow
def test_the_order_of_boards_changes_nothing():
    """The frame of a target that is free hangs on one board: cameras have nothing to do with it."""
    pairs = draw(5, photos=9)
    turned = replace(TARGET, boards=TARGET.boards[::-1])
    one, other = (
        calibrate_target(pairs, target, hold_out=False, refine_target="points")
        for target in (TARGET, turned)
    )
    first, second = (np.array(fit.fit.uncertainty.sigma_px, float) for fit in (one, other))
    np.testing.assert_allclose(second, first, rtol=0.05)


@pytest.mark.slow
def test_it_grows_towards_the_rim_and_is_null_outside():
    result = calibrate(draw(3), hold_out=False)
    record = result.fit.uncertainty
    sigma = np.array(record.sigma_px)
    assert sigma.shape == (len(record.y), len(record.x))
    rays = result.camera.unproject(np.stack(np.meshgrid(record.x, record.y), axis=-1))
    np.testing.assert_array_equal(np.isnan(sigma), np.isnan(rays[..., 0]))
    assert np.isnan(sigma).any()
    theta = np.rad2deg(np.arccos(rays[..., 2]))
    assert np.nanmedian(sigma[theta > 80]) > 1.6 * np.nanmedian(sigma[theta < 50])
    assert record.max_px == pytest.approx(np.nanmax(sigma), abs=1e-4)


@pytest.mark.slow
def test_the_record_is_that_of_the_rays():
    reference = fit_radial(draw(3))
    fit = fit_cubic(reference, PRIOR)
    uncertainty = camera_uncertainty(fit)
    camera = calibrate(draw(3), hold_out=False).camera
    record = uncertainty_grid(uncertainty, camera)
    ray = camera.unproject([record.x[6], record.y[4]])
    expected = uncertainty.sigma_px(ray[None])[0]
    assert record.sigma_px[4][6] == pytest.approx(expected, abs=1e-5)


def test_between_grid_points_it_is_interpolated():
    grid = UncertaintyGrid(
        x=(0, 10, 20), y=(0, 10), sigma_px=((1.0, 2.0, np.nan), (3.0, 4.0, np.nan))
    )
    pixel = np.array([[0, 0], [5, 0], [5, 5], [10, 10], [15, 0], [20, 5], [-9, 40]], float)
    expected = [1, 1.5, 2.5, 4, 2, np.nan, 3]
    np.testing.assert_allclose(grid.at(pixel), expected)
