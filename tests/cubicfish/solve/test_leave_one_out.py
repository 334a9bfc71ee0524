"""Photos left out by one step, against fits anew; and what they say of how P is held."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from lenses import radial_camera
from scipy.special import bdtrc

from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.folds import photo_folds
from cubicfish.fit.held_out import held_out_error
from cubicfish.fit.prior import (
    EXPECTED,
    SPREADS,
    WEIGHTS,
    Prior,
    _choose_likeliest,
    choose_prior,
    tie_to,
)
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.fit.refinement import refine_object
from cubicfish.solve import leave_one_out as module
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.deformable_target import NominalTarget
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.statistics import huber_px, rms_px
from cubicfish.solve.subset import select_photos, world_scale

PRIOR = Prior(spread=1e-3, weight=1.0)
FOLDS = [np.array([0, 3, 6]), np.array([1, 4, 7]), np.array([2, 5])]


@pytest.fixture(scope="module")
def target():
    return synthetic.box_of_four(7)


@pytest.fixture(scope="module")
def reference(target):
    poses = synthetic.poses_around(target, 8, seed=5, distance=(0.3, 0.6))
    pairs = synthetic.synthetic_correspondences(target, poses, noise=0.2, seed=6)
    return fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))


@pytest.fixture(scope="module", params=["off", "shape", "points"])
def held(request, reference, target):
    """The level of the target's refinement, and a fit at it."""
    level, world = request.param, None
    if level != "off":
        spread = 2e-3 if level == "points" else None
        world = NominalTarget(pairs=reference.pairs, target=target).free(
            noise=0.2, offset_spread=spread
        )
    return level, fit_cubic(reference, PRIOR, world=world, relative_decrease=1e-4)


def anew(fit, pairs, image_size, photos):
    """Residuals of photos under a fit to the others that is followed to its end."""
    train = np.setdiff1d(np.arange(len(pairs.images)), photos)
    rows = np.flatnonzero(~np.isin(pairs.image, photos))
    limit = huber_px(fit.residual)
    trained = adjust(
        fit.lens,
        fit.poses[train],
        select_photos(pairs, train),
        huber_px=limit,
        world=fit.world.select(rows),
    )
    own = select_photos(pairs, photos)
    if fit.world.free:
        world = trained.world
        points = replace(fit.world, parameters=world.parameters, offsets=world.offsets).points
        own = replace(own, world=points[np.isin(pairs.image, photos)])
    return adjust(FixedLens(camera=trained.lens), fit.poses[photos], own, huber_px=limit).residual


@pytest.mark.slow
@pytest.mark.parametrize("level", ["off", "shape", "points"])
def test_one_step_is_nearly_a_fit_anew(reference, target, level):
    pairs, world = reference.pairs, None
    if level != "off":
        world = NominalTarget(
            pairs=pairs,
            target=target,
            scale=float(np.ptp(target.corners()[3]) / np.ptp(pairs.world)),
        ).free(noise=0.2, offset_spread=2e-3 if level == "points" else None)
    fit = fit_cubic(reference, PRIOR, world=world)
    found = dict(LeaveOneOut(fit, FOLDS).residuals())
    assert found.keys() == set(range(8))
    for photos in FOLDS:
        wanted = anew(fit, pairs, pairs.image_size, photos)
        own = np.isin(pairs.image, photos)
        residual = np.vstack([found[photo][:, :, 0] for photo in photos])
        assert residual.shape == wanted.shape
        # What a photo left out adds to its own residuals is what must be right.
        added = np.sqrt(np.mean(np.square(wanted - fit.residual[own])))
        assert rms_px(residual - wanted) < 0.25 * added + 1e-3
        assert rms_px(residual) == pytest.approx(rms_px(wanted), rel=0.02)


@pytest.mark.slow
def test_all_priors_at_once_are_as_one_by_one(reference, held):
    """Both ways to eliminate, and every prior as its lens itself has it."""
    _, result = held
    leave_one_out = LeaveOneOut(result, FOLDS)
    weights = np.array([10.0, 1.0, 0.01])
    for spread in (0.0, 1e-3, 1e-2):
        rays = tie_to(reference, spread)
        priors = replace(result.lens, tie=rays).pulls_under(weights)
        together = dict(leave_one_out.residuals(priors))
        for place, weight in enumerate(weights):
            lens = replace(result.lens, tie=replace(rays, weight=weight))
            own = lens.pulls()
            if weight == PRIOR.weight:
                np.testing.assert_allclose(priors[place], own, atol=1e-6 * np.abs(own).max())
            alone = dict(leave_one_out.residuals(own[None]))
            for photo, residual in alone.items():
                left = together[photo][:, :, [place]]
                assert rms_px(left[..., 0]) == pytest.approx(rms_px(residual[..., 0]), rel=2e-3)


def test_what_a_group_put_in_is_what_is_not_left(reference, held):
    """Whichever family of blocks is eliminated."""
    level, result = held
    fit = result
    leave_one_out = LeaveOneOut(fit, FOLDS)
    for group, (shared, pose, corner) in zip(FOLDS, leave_one_out.steps(), strict=True):
        others = np.setdiff1d(np.arange(8), group)
        rest = leave_one_out._sum_up(others).with_pulls(
            (fit.lens.pulls(), fit.world.pulls()), fit.world
        )
        assert rest.eliminated(1e-13).keeps_poses == (level == "points")
        step = shared, pose[others], corner
        for part, wanted in zip(step, rest.solve(1e-13), strict=True):
            np.testing.assert_allclose(part, wanted, atol=1e-6 * np.abs(wanted).max(initial=0))
            assert not pose[group].any()


def test_influence_is_the_same_some_groups_at_a_time(held, monkeypatch):
    _, fit = held
    photos = [np.array([photo]) for photo in range(8)]
    together = LeaveOneOut(fit, photos).influence()
    monkeypatch.setattr(module, "_AT_ONCE", 3)
    apart = LeaveOneOut(fit, photos).influence()
    assert len(together) == 8
    assert np.abs(together).max(axis=1).min() > 0
    np.testing.assert_allclose(apart, together, atol=1e-9 * np.abs(together).max())


@pytest.mark.parametrize("turned", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("times", [1e2, 1e5])
def test_a_lens_that_no_bent_one_is_near_to_is_told_by_one_that_sees_all(reference, times, turned):
    """A few photos in the middle of a narrow lens may ask for any."""
    prior = fit_cubic(reference, Prior(spread=1e-2, weight=0.01), relative_decrease=1e-4)
    prior = prior.lens.tie
    still = prior.near.still
    seen, _ = prior.lens.seen(still)
    bent = np.stack([np.cos(turned * still.theta**2), np.sin(7 * still.theta)], -1)
    nearest, _ = prior.nearest(seen + times * bent)
    assert np.isfinite(nearest.values).all()
    assert np.isfinite(nearest.seen(still)[0]).all()


def test_another_prior_steps_as_the_equations_with_it_do(reference):
    result = fit_cubic(reference, PRIOR, relative_decrease=1e-4)
    normal = result.normal
    other = replace(result.lens, tie=replace(tie_to(reference, 1e-2), weight=0.1))
    change = other.pulls() - result.lens.pulls()
    changed = replace(
        normal,
        shared=normal.shared + change[:-1],
    )
    leave_one_out = LeaveOneOut(result, FOLDS)
    step = changed.solve(1e-13)[0]
    np.testing.assert_allclose(
        leave_one_out.steps_under([other])[0], step, atol=1e-3 * np.abs(step).max()
    )


@pytest.mark.slow
def test_photos_left_out_see_asymmetry_that_is_there(target):
    """Decentring of a hundredth is found in the photos; a symmetric lens is held to symmetry."""
    poses = synthetic.poses_around(target, 8, seed=7, distance=(0.3, 0.6))
    found = []
    for decentred in (False, True):
        pairs = synthetic.synthetic_correspondences(
            target, poses, lens=radial_camera(), noise=0.1, seed=8
        )
        if decentred:
            away = (pairs.pixel - np.array(pairs.image_size) / 2) / 300
            square = np.sum(away**2, axis=1)
            shift = np.stack([square + 2 * away[:, 0] ** 2, 2 * away[:, 0] * away[:, 1]], axis=1)
            pairs = replace(pairs, pixel=pairs.pixel + 2.0 * shift)
        reference = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
        found.append(choose_prior(reference, FOLDS).prior)
    assert found[0].spread <= 1e-4
    assert found[1].spread > found[0].spread or found[1].weight < 0.1 * found[0].weight


def test_one_photo_does_not_choose_the_hold():
    """By the sum of squares it would, being as far off as all others together."""
    middle, other = EXPECTED, Prior(spread=SPREADS[3], weight=WEIGHTS[7])
    squares = np.array([[*[1.0] * 10, 100.0], [*[1.3] * 10, 20.0]])
    assert squares[1].sum() < squares[0].sum()
    assert _choose_likeliest([middle, other], squares)[0] == middle


def test_what_many_photos_say_outweighs_what_is_expected():
    middle, other = (
        EXPECTED,
        Prior(spread=SPREADS[3], weight=WEIGHTS[4]),
    )  # a distance of √8 standard deviations
    squares = np.array([np.full(3, 1.5), np.ones(3)])
    # Bayes: three times the likelihood of a photo, against exp(-8 / 2) of the expectation.
    assert _choose_likeliest([middle, other], squares)[0] == middle
    assert _choose_likeliest([middle, other], np.repeat(squares, 4, axis=1))[0] == other


def test_a_prior_is_in_doubt_as_far_as_other_photos_would_choose_another():
    middle, other = EXPECTED, Prior(spread=SPREADS[2], weight=WEIGHTS[2])
    alike = np.array([np.full(10, 1.0), np.full(10, 1.04)])
    assert _choose_likeliest([middle, other], alike) == (middle, {})  # by little, but by all photos
    # Half of the photos are for the one, half for the other, which is expected less.
    split = np.where(np.arange(10) % 2, 1.5, 1 / 1.5)
    chosen, runners_up = _choose_likeliest([middle, other], np.array([split, 1 / split]))
    assert (chosen, [*runners_up]) == (middle, [other])
    # Of ten tosses six or more: each counts 2 log 1.5 either way, and the expectation 1 / 2.
    tosses = bdtrc(5, 10, 0.5)
    assert runners_up[other] == pytest.approx(tosses, abs=0.05)


def test_without_photos_to_leave_out_the_prior_is_a_middle_one(reference):
    assert choose_prior(reference, []).prior == EXPECTED


@pytest.mark.slow
@pytest.mark.parametrize("level", ["off", "points"])
def test_folds_that_start_a_step_away_end_where_fits_anew_do(reference, target, level):
    fit = fit_cubic(reference, PRIOR)
    if level == "points":
        scale = float(np.ptp(target.corners()[3]) / np.ptp(reference.pairs.world))
        nominal = NominalTarget(pairs=reference.pairs, target=target, scale=scale)
        fit = refine_object(replace(fit, nominal=nominal), level, FOLDS)
    found = held_out_error(fit)
    parts = photo_folds(fit.poses, reference.pairs, reference.camera.fx)
    pairs = fit.reference.pairs
    expected = [anew(fit, pairs, pairs.image_size, part) for part in parts]
    assert found.folds == len(parts) == 5
    assert found.rms_px == pytest.approx(rms_px(np.vstack(expected)), rel=2e-3)


def test_folds_whose_first_order_leads_astray_start_from_the_whole_fit(reference, monkeypatch):
    fit = fit_cubic(reference, PRIOR)
    expected, steps = held_out_error(fit).rms_px, LeaveOneOut.steps

    def astray(leave_one_out):
        return [(np.full_like(shared, -1e4), *rest) for shared, *rest in steps(leave_one_out)]

    monkeypatch.setattr(LeaveOneOut, "steps", astray)
    assert held_out_error(fit).rms_px == pytest.approx(expected, rel=1e-3)
