"""What leaving photos out foretells, against cameras from other photos of the same lens."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic
from simulated import CornerErrors, simulated_corners, smooth_errors
from synthetic_lenses import synthetic_lens

from cubicfish import Target, load_corners
from cubicfish.comparison import aligned_difference
from cubicfish.fit import calibrate as fitting
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.photo_spread import PhotoSpread, photo_spread, variance_of_few
from cubicfish.fit.prior import FIRMEST, RADIAL, Prior
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.fit.uncertainty import camera_uncertainty
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.subset import select, world_scale

TARGET = synthetic.corner_of_three()
PRIOR = Prior(spread=1e-3, weight=1.0)
PHOTOS = 10
SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"


def fitted(seed, errors):
    corners, _ = simulated_corners(
        synthetic_lens("equisolid"), TARGET, PHOTOS, seed=seed, errors=errors
    )
    pairs = corners.with_target(TARGET)
    reference = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
    return reference, fit_cubic(reference, PRIOR)


def camera_of(reference, cubic):
    return CubicCamera(
        image_size=reference.pairs.image_size,
        P=cubic.lens.P,
        max_angle_deg=cubic.max_angle_deg,
        radial=reference.camera,
    )


def observed_over_predicted(errors):
    """RMS distance between pairs of cameras over what they foretell: of photos, of noise."""
    ratios = []
    for seed in range(4):
        (one, first), (two, second) = (fitted(seed + more, errors) for more in (0, 100))
        rays = cone_rays(min(one.covered, two.covered), 200)
        difference, _ = aligned_difference(camera_of(one, first), camera_of(two, second), rays)
        seen = np.isfinite(difference).all(axis=1)
        both = []
        for cubic in (first, second):
            spread = photo_spread(cubic, np.arange(PHOTOS))
            noise = camera_uncertainty(cubic).sigma_px(rays[seen])
            both.append((spread.sigma_px(rays[seen]), noise))
        distance = np.sqrt(np.mean(np.sum(difference[seen] ** 2, axis=1)))
        ratios.append(
            [distance / np.sqrt(np.mean(a**2 + b**2)) for a, b in zip(*both, strict=True)]
        )
    return np.median(ratios, axis=0)


@pytest.mark.slow
def test_errors_that_a_photo_shares_are_foretold():
    of_photos, of_noise = observed_over_predicted(CornerErrors(noise=0.05, shared=0.15))
    assert 0.6 < of_photos < 1.5
    assert of_noise > 1.5 * of_photos  # single corners' noise knows nothing of them


@pytest.mark.slow
def test_independent_errors_are_too():
    of_photos, of_noise = observed_over_predicted(CornerErrors(noise=0.1, shared=0, spread=0))
    assert 0.6 < of_photos < 1.5
    assert 0.6 < of_noise < 1.5


@pytest.mark.slow
def test_a_narrow_lens_is_as_uncertain_as_its_principal_point():
    """Seven photos of small boards: these corners put the anchor where it is, give or take 5 px."""
    folder, corners = SHARED / "charuco_gopro", SHARED / "corners_before" / "charuco_gopro.csv"
    if not corners.exists():
        pytest.skip("no ../shared here")
    pairs = load_corners(corners, Target.load(folder / "target.yaml"))
    true = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
    seen = true.pairs
    pixel = true.camera.project(true.poses.apply(seen.image, seen.world))
    ratios = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        errors = 0.08 * rng.standard_normal(pixel.shape)
        for photo in range(len(seen.images)):
            own = seen.image == photo
            errors[own] += 0.08 * smooth_errors(pixel[own], 120.0, rng)
            errors[own] *= np.exp(0.5 * rng.standard_normal())
        reference = fit_radial(replace(seen, pixel=pixel + errors))
        cubic = fit_cubic(reference, Prior(spread=1e-4, weight=3.0))
        rays = cone_rays(min(reference.covered, true.camera.max_angle), 200)
        error, _ = aligned_difference(camera_of(reference, cubic), true.camera, rays)
        stated = photo_spread(cubic, np.arange(len(seen.images))).sigma_px(rays)
        ratios.append(np.sqrt(np.nansum(error**2) / np.sum(stated**2)))
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.6


@pytest.mark.slow
def test_a_prior_that_hardly_moves_the_camera_hardly_moves_what_is_stated(monkeypatch):
    lens = replace(synthetic.TRUE_LENS, p=(0.0, 0.0), tilt=(0.0, 0.0))
    corners, _ = simulated_corners(lens, TARGET, PHOTOS, seed=6, errors=CornerErrors())
    found = []
    for prior in (replace(FIRMEST, central=True), RADIAL):

        def held_so(fit, *_, prior=prior):
            return fit_cubic(fit.reference, prior, start=fit)

        monkeypatch.setattr(fitting, "select_model", held_so)
        found.append(fitting.calibrate(corners.with_target(TARGET), target=TARGET))
    one, other = (fit.fit.uncertainty.median_px for fit in found)
    rays = cone_rays(np.radians(min(fit.camera.max_angle_deg for fit in found)), 200)
    apart, _ = aligned_difference(found[0].camera, found[1].camera, rays)
    assert np.nanmax(np.hypot(*apart.T)) < 0.2 * one
    assert other == pytest.approx(one, rel=0.1)


@pytest.mark.slow
def test_one_place_leaves_the_noise_alone():
    reference, cubic = fitted(3, CornerErrors())
    rays = cone_rays(reference.covered, 50)
    same = photo_spread(cubic, np.zeros(PHOTOS, int))
    noise = camera_uncertainty(cubic)
    np.testing.assert_array_equal(same.sigma_px(rays), noise.sigma_px(rays))
    weights = np.eye(2 * len(rays))[:4]
    np.testing.assert_allclose(same.variance(rays, weights), noise.variance(rays, weights))


@pytest.mark.slow
def test_variances_add_up_to_sigma():
    reference, cubic = fitted(4, CornerErrors())
    spread = photo_spread(cubic, np.arange(PHOTOS))
    rays = cone_rays(reference.covered, 30)
    left_out, influence, _ = spread._measure_changes(rays)
    single = spread._estimate_variance(left_out, influence)
    assert (spread.sigma_px(rays) ** 2 >= single.reshape(-1, 2).sum(axis=1) * (1 - 1e-12)).all()
    assert spread.noise_px == pytest.approx(spread.noise.noise_px)


@pytest.mark.slow
def test_a_runner_up_adds_how_far_its_camera_is():
    reference, cubic = fitted(5, CornerErrors())
    rays = cone_rays(reference.covered, 60)
    alone = photo_spread(cubic, np.arange(PHOTOS)).sigma_px(rays)
    itself = photo_spread(replace(cubic, runners_up={PRIOR: 1.0}), np.arange(PHOTOS))
    np.testing.assert_allclose(itself.sigma_px(rays), alone, rtol=1e-2)
    freer = Prior(spread=1e-2, weight=0.1)
    sure, half = (
        photo_spread(replace(cubic, runners_up={freer: likely}), np.arange(PHOTOS)).sigma_px(rays)
        for likely in (1.0, 0.5)
    )
    lens = camera_of(reference, fit_cubic(reference, freer, start=cubic))
    distance, _ = aligned_difference(lens, camera_of(reference, cubic), rays)
    added = np.sqrt(np.mean(sure**2 - alone**2))
    assert added == pytest.approx(np.sqrt(np.mean(np.sum(distance**2, axis=1))), rel=0.35)
    np.testing.assert_allclose(half**2 - alone**2, (sure**2 - alone**2) / 2, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("clusters", [3, 5, 12])
def test_errors_exceed_a_spread_of_few_as_often_as_they_exceed_the_true_one(clusters):
    """Of the mean of some draws, whose error is judged by leaving each of them out."""
    draws = np.random.default_rng(clusters).normal(size=(200_000, clusters))
    without = (draws.sum(axis=1, keepdims=True) - draws) / (clusters - 1)
    squares = np.sum(np.square(without - without.mean(axis=1, keepdims=True)), axis=1)
    error, variance = np.square(draws.mean(axis=1)), squares * (clusters - 1) / clusters
    exceeded = np.mean(error > 1.645**2 * variance_of_few(variance, clusters))
    assert exceeded == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize("clusters", [3, 12])
def test_photos_variance_is_right_on_average_however_much_one_of_them_weighs(clusters):
    """Of a weighted mean: the errors' own variance is 1, and one weight is as large as the rest."""
    weight = np.append(np.ones(clusters - 1), clusters - 1.0)
    leverage = weight / weight.sum()
    errors = np.random.default_rng(clusters).normal(size=(100_000, clusters)) / np.sqrt(weight)
    residual = errors - (errors @ leverage)[:, None]
    influence = -leverage * residual
    spread = PhotoSpread(
        noise=None, left_out=None, influence=None, runner_up=None, prior_lens=None, empty=0.0
    )
    found = spread._estimate_variance(influence / (1 - leverage), influence)
    widened = variance_of_few(np.ones(1), clusters)[0]
    true = 1 / weight.sum()
    assert found.mean() / widened == pytest.approx(true, rel=0.02)


def test_in_an_empty_middle_two_guesses_are_off_by_what_they_differ_by():
    """No corner is nearer to a mirror camera's axis than 55°: 50° is as near as one says much."""
    lens = synthetic_lens("mirror")
    poses = synthetic.poses_around(TARGET, 8, seed=0, off_axis_deg=100)
    pairs = synthetic.synthetic_correspondences(
        TARGET, poses, lens=lens, image_size=lens.image_size, noise=0.1
    )
    pairs, _ = select(pairs, lens.unproject(pairs.pixel)[:, 2] < np.cos(np.radians(55)))
    reference = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
    cubic = fit_cubic(reference, PRIOR)
    spread = photo_spread(cubic, np.arange(len(pairs.images)))
    rays = cone_rays(reference.covered, 500)
    empty = rays[:, 2] > np.cos(np.radians(49))
    near = rays[:, 2] < np.cos(np.radians(51))
    sigma, of_data = spread.sigma_px(rays), replace(spread, empty=0.0).sigma_px(rays)
    np.testing.assert_array_equal(sigma[near], of_data[near])
    differ = cubic.lens.far(rays[empty]) - spread.prior_lens.project(rays[empty])
    assert np.hypot(*differ.T).max() > 0.01
    np.testing.assert_allclose(
        sigma[empty] ** 2 - of_data[empty] ** 2, np.sum(differ**2, axis=1), atol=1e-9
    )


@pytest.mark.slow
def test_a_richer_target_that_is_in_doubt_adds_how_far_its_camera_is():
    reference, cubic = fitted(0, CornerErrors())
    rays = cone_rays(reference.covered, 100)
    alone = photo_spread(cubic, np.arange(PHOTOS))
    # Held otherwise, and in parameters of another scale.
    other = fit_cubic(reference, Prior(spread=1e-2, weight=0.1), start=cubic).lens
    other = replace(other, coefficients=other.coefficients * [[2], [2], [1]], scale=other.scale / 2)
    beside = photo_spread(cubic, np.arange(PHOTOS), [(other, 1.0)])
    mine = camera_of(reference, cubic)
    his = camera_of(reference, replace(cubic, lens=other))
    corners = reference.poses.apply(reference.pairs.image, reference.pairs.world)
    _, turn = aligned_difference(mine, his, corners / np.linalg.norm(corners, axis=1)[:, None])
    difference = mine.project(rays @ turn.T) - his.project(rays)
    added = np.sqrt(beside.sigma_px(rays) ** 2 - alone.sigma_px(rays) ** 2)
    np.testing.assert_allclose(added, np.hypot(*difference.T), rtol=0.05, atol=2e-3)
    none = photo_spread(cubic, np.arange(PHOTOS), [(other, 0.0)])
    np.testing.assert_allclose(none.sigma_px(rays), alone.sigma_px(rays), rtol=1e-12)
