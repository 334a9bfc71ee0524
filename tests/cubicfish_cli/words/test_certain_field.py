"""A camera whose rim is uncertain is trusted short of it; all that its corners say is kept."""

import numpy as np
import pytest
from synthetic import TRUE_LENS, corner_of_three, poses_around, synthetic_correspondences

from cubicfish.comparison import aligned_difference
from cubicfish.fit import coverage
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.evaluate import evaluate
from cubicfish.judge.codes import Code
from cubicfish.models.sphere import cone_rays, ray_at
from cubicfish_cli.extensions.advice.advise import advise
from cubicfish_cli.inputs.calibration_facts import facts_of_fit
from cubicfish_cli.words.camera import headline

TARGET = corner_of_three()
PAIRS = synthetic_correspondences(TARGET, poses_around(TARGET, 12, seed=3)[:3], noise=0.6, seed=3)


def fitted(**more):
    return calibrate(PAIRS, target=TARGET, hold_out=False, refine_target="off", **more)


@pytest.fixture(scope="module")
def few():
    """Three noisy photos, of which the middle is right and the rim is not."""
    return fitted()


def test_the_field_ends_before_the_corners_do(few):
    known = few.fit.uncertainty
    assert few.camera.max_angle_deg < few.fit.covered_deg - 10
    assert known.median_px < 1 < known.max_px < 1.3
    assert few.fit.reach.edge_uncertainty_px == pytest.approx(1, abs=0.1)
    share = f"{100 * few.calibrated_share:.0f} % of the photo calibrated"
    assert headline(few).endswith(share)
    assert few.calibrated_share < 0.6


def test_the_camera_is_right_up_to_there(few):
    inside, _ = aligned_difference(
        few.camera, TRUE_LENS, cone_rays(np.radians(0.95 * few.camera.max_angle_deg), 500)
    )
    assert np.sqrt(np.mean(np.sum(inside**2, axis=1))) < 1.5


@pytest.mark.slow
def test_who_is_content_with_more_has_the_whole_field(few):
    content = fitted(goal_px=20.0)
    assert content.camera.max_angle_deg > few.fit.covered_deg
    assert Code.UNCERTAIN not in [one.code for one in content.verdict.reasons]
    assert np.array_equal(content.camera.P, few.camera.P)


@pytest.mark.slow
def test_the_cubic_is_that_of_all_corners(few, monkeypatch):
    monkeypatch.setattr(coverage, "certain_angle_deg", lambda camera, *_: camera.max_angle_deg)
    whole = fitted()
    assert whole.camera.max_angle_deg > few.fit.covered_deg
    assert np.array_equal(whole.camera.P, few.camera.P)
    assert whole.fit.rms_px == few.fit.rms_px


def test_corners_beyond_the_field_are_still_those_of_the_fit(few):
    facts = facts_of_fit(few, few.pairs, ())
    assert facts.errors is not None
    assert len(facts.errors.residual) == len(few.pairs.pixel)
    measured = evaluate(few.camera, few.pairs)
    assert 0 < measured.outside < len(few.pairs.pixel) / 2


def test_what_is_asked_for_next_may_be_at_the_rim(few):
    advice = advise(few, few.pairs, TARGET)
    assert advice.proposals
    assert advice.proposals[0].gain > 0.2
    beyond = few.camera.over_corners(few.fit.covered_deg).project(
        ray_at(np.radians([few.fit.covered_deg]), np.array([0.0]))
    )
    assert np.isfinite(beyond).all()
    assert np.isnan(
        few.camera.project(ray_at(np.radians([few.fit.covered_deg]), np.zeros(1)))
    ).all()
