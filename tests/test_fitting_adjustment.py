"""Levenberg–Marquardt: at the truth nothing moves, and the Schur complement is a dense step."""

import numpy as np
import pytest
import synthetic

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting import adjustment
from cubicfish_cli.fitting.adjustment import adjust, huber_cost, huber_weight
from cubicfish_cli.fitting.companion import fit_companion
from cubicfish_cli.fitting.cubic_fit import fit_cubic
from cubicfish_cli.fitting.lenses import RadialFit
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.model.radial import RadialCamera

TRUTH = RadialCamera(
    image_size=(960, 720), fx=255, fy=256, cx=500, cy=340, k=np.array([-0.03, 0.002, 0, 0])
)
TARGET = synthetic.corner_of_three()
POSES = synthetic.poses_around(TARGET, 5, seed=2)


@pytest.fixture(scope="module")
def pairs():
    return synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH, noise=0.2, seed=3)


@pytest.fixture(scope="module")
def cubic(pairs):
    return fit_cubic(fit_companion(pairs), weight=0.5)


def test_at_the_truth_residual_and_gradient_are_zero():
    exact = synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH)
    companion = fit_companion(exact)
    lens = RadialFit(values=TRUTH.parameters)
    normal = adjustment._normal_equations(lens, companion.poses, exact, 1.0)
    assert np.abs(companion.residual).max() < 1e-6
    assert np.abs(normal.lens_gradient).max() < 1e-2 * np.sqrt(np.diag(normal.lens)).max() * 1e-3
    assert np.abs(normal.pose_gradient).max() < 1e-5 * np.sqrt(normal.pose.max())


def test_schur_complement_is_the_dense_step(pairs, cubic):
    normal = adjustment._normal_equations(cubic.lens, cubic.poses, pairs, 0.5)
    lens_step, pose_step = adjustment._solve(normal, 1e-3)
    count, photos = len(lens_step), len(pose_step)
    dense = np.zeros((count + 6 * photos, count + 6 * photos))
    dense[:count, :count] = adjustment._damped(normal.lens, 1e-3)
    gradient = np.concatenate([normal.lens_gradient, normal.pose_gradient.ravel()])
    for photo in range(photos):
        own = slice(count + 6 * photo, count + 6 * photo + 6)
        dense[:count, own] = normal.cross[photo]
        dense[own, :count] = normal.cross[photo].T
        dense[own, own] = adjustment._damped(normal.pose[photo], 1e-3)
    scale = 1 / np.sqrt(np.diag(dense))
    expected = -scale * np.linalg.solve(dense * scale * scale[:, None], scale * gradient)
    np.testing.assert_allclose(lens_step, expected[:count], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(pose_step.ravel(), expected[count:], rtol=1e-5, atol=1e-9)


def test_gradient_is_the_slope_of_the_cost(pairs, cubic):
    """Away from the optimum, against the cost itself: Huber loss and prior included."""
    lens = cubic.lens.with_parameters(cubic.lens.parameters * (1 + 1e-3))
    normal = adjustment._normal_equations(lens, cubic.poses, pairs, 0.3)
    for index in (0, 5, 20, 33, 46):
        step = np.zeros(47)
        step[index] = 1e-7
        up, _ = adjustment._cost(
            lens.with_parameters(lens.parameters + step), cubic.poses, pairs, 0.3
        )
        down, _ = adjustment._cost(
            lens.with_parameters(lens.parameters - step), cubic.poses, pairs, 0.3
        )
        assert normal.lens_gradient[index] == pytest.approx((up - down) / 2e-7, rel=1e-4)
    for index in range(6):
        step = np.zeros((5, 6))
        step[2, index] = 1e-6
        up, _ = adjustment._cost(lens, cubic.poses.moved(step), pairs, 0.3)
        down, _ = adjustment._cost(lens, cubic.poses.moved(-step), pairs, 0.3)
        assert normal.pose_gradient[2, index] == pytest.approx((up - down) / 2e-6, rel=1e-4)


def test_a_perturbed_start_returns_to_the_same_optimum(pairs, cubic):
    rng = np.random.default_rng(0)
    again = adjust(
        cubic.lens.with_parameters(cubic.lens.parameters + 1e-3 * rng.standard_normal(47)),
        cubic.poses.moved(1e-3 * rng.standard_normal((5, 6))),
        pairs,
        huber_px=5.0,
    )
    once = adjust(cubic.lens, cubic.poses, pairs, huber_px=5.0)
    assert again.cost == pytest.approx(once.cost, rel=1e-8)
    np.testing.assert_allclose(again.residual, once.residual, atol=1e-4)


def test_huber_loss_and_its_weight_belong_together():
    distance = np.linspace(0.01, 5, 200)
    slope = (huber_cost(distance + 1e-6, 1.2) - huber_cost(distance - 1e-6, 1.2)) / 2e-6
    np.testing.assert_allclose(slope, huber_weight(distance, 1.2) * distance, atol=1e-6)


def test_a_start_at_infinity_is_refused(pairs, cubic):
    behind = Poses(rotation=cubic.poses.rotation, translation=np.full((5, 3), np.nan))
    with pytest.raises(FitError, match="infinity"):
        adjust(cubic.lens, behind, pairs, huber_px=1.0)
