"""Levenberg–Marquardt: at the truth nothing moves, and the Schur complement is a dense step."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from scipy.linalg import block_diag

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit import adjustment
from cubicfish_cli.core.fit.adjustment import adjust
from cubicfish_cli.core.fit.cubic_fit import PriorChoice, fit_cubic
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.linearise import State, huber_cost, huber_weight
from cubicfish_cli.core.fit.normal_equations import damped
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.radial_reference import fit_radial, refit_radial
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.lenses.nearest import FreeLens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.lenses.sphere import cone_rays

TRUTH = RadialCamera(
    image_size=(960, 720), fx=255, fy=256, cx=500, cy=340, k=np.array([-0.03, 0.002, 0, 0])
)
TARGET = synthetic.corner_of_three()
POSES = synthetic.poses_around(TARGET, 5, seed=2)


def normal_equations(lens, poses, pairs, huber_px, world=None):
    world = DeformableTarget(nominal=pairs.world) if world is None else world
    return adjustment._evaluated(State(lens, poses, world), pairs, huber_px).normal


def cost(lens, poses, pairs, huber_px, world=None):
    world = DeformableTarget(nominal=pairs.world) if world is None else world
    return adjustment._evaluated(State(lens, poses, world), pairs, huber_px).cost


@pytest.fixture(scope="module")
def pairs():
    return synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH, noise=0.2, seed=3)


@pytest.fixture(scope="module")
def cubic(pairs):
    return fit_cubic(fit_radial(pairs), PriorChoice(spread=0.01, weight=0.5))


def test_at_the_truth_residual_and_gradient_are_zero():
    exact = synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH)
    reference = fit_radial(exact)
    lens = FreeLens.of(TRUTH)
    normal = normal_equations(lens, reference.poses, exact, 1.0)
    assert np.abs(reference.residual).max() < 1e-6
    assert (
        np.abs(normal.shared_gradient).max() < 1e-2 * np.sqrt(np.diag(normal.shared)).max() * 1e-3
    )
    assert np.abs(normal.pose_gradient).max() < 1e-5 * np.sqrt(normal.pose.max())


def test_what_is_known_of_a_state_is_what_is_worked_out(cubic):
    """Under another prior and another loss too, as long as no corner is far out."""
    worst = np.hypot(*cubic.residual.T).max()
    fit = adjust(cubic.lens, cubic.poses, cubic.fit.pairs, huber_px=1.1 * worst)
    freer = replace(fit.lens, ray_prior=replace(fit.lens.ray_prior, weight=0.05))
    state = State(freer, fit.poses, fit.world)
    for limit in (fit.huber_px, 3 * fit.huber_px):
        known = adjustment._known(fit, state, fit.pairs, limit)
        anew = adjustment._evaluated(state, fit.pairs, limit)
        assert known.cost == pytest.approx(anew.cost, rel=1e-12)
        assert known.cost != pytest.approx(fit.cost, rel=1e-6)
        for block in ("shared", "shared_gradient", "shared_pose", "pose", "pose_gradient"):
            np.testing.assert_array_equal(getattr(known.normal, block), getattr(anew.normal, block))


def test_nothing_is_known_of_another_state(cubic):
    fit = cubic.fit
    same = State(fit.lens, fit.poses, fit.world)
    other_pairs = replace(fit.pairs, pixel=fit.pairs.pixel + 1)
    other_lens = fit.lens.with_parameters(fit.lens.parameters + 1e-9)
    worst = np.hypot(*fit.residual.T).max()
    for state, pairs, limit in (
        (same, other_pairs, fit.huber_px),
        (same, fit.pairs, 0.9 * worst),
        (replace(same, lens=other_lens), fit.pairs, fit.huber_px),
        (replace(same, poses=fit.poses.scaled(1.0)), fit.pairs, fit.huber_px),
        (
            replace(same, world=DeformableTarget(nominal=fit.world.points + 1e-9)),
            fit.pairs,
            fit.huber_px,
        ),
    ):
        assert adjustment._known(fit, state, pairs, limit) is None
    assert adjustment._known(fit, same, fit.pairs, fit.huber_px) is not None
    ahead = adjust(
        fit.lens, fit.poses, fit.pairs, huber_px=fit.huber_px, damping=1e-8, trust_last=True
    )
    state = State(ahead.lens, ahead.poses, ahead.world)
    assert adjustment._known(ahead, state, fit.pairs, fit.huber_px) is None


def test_a_bend_is_the_same_wherever_it_starts(pairs):
    reference = fit_radial(pairs)
    anew, _ = reference.bent(1e-3)
    again = refit_radial(reference, reference.pairs, reference.poses)
    assert again.bends.keys() == {1e-3}
    near, _ = again.bent(1e-3)
    rays = cone_rays(1.2, 100)
    np.testing.assert_allclose(near.project(rays), anew.project(rays), atol=2e-3)
    followed = again.followed(reference.pairs.world * 1.0)
    assert followed.bent(1e-3)[0] is near


def dense_step(normal, damping):
    """The damped step from the whole Hessian at once."""
    shared, pose, corner = (
        damped(block, damping) for block in (normal.shared, normal.pose, normal.corner)
    )
    blocks = block_diag(shared, *pose, *corner)
    count, photos = len(shared), 6 * len(pose)
    blocks[:count, count : count + photos] = normal.shared_pose
    blocks[:count, count + photos :] = normal.shared_corner
    blocks[count : count + photos, count + photos :] = normal.pose_corner
    upper = np.triu(blocks)
    dense = upper + np.triu(blocks, 1).T
    gradient = np.concatenate(
        [
            normal.shared_gradient,
            normal.pose_gradient.ravel(),
            normal.corner_gradient.ravel(),
        ]
    )
    scale = 1 / np.sqrt(np.diag(dense))
    return -scale * np.linalg.solve(dense * scale * scale[:, None], scale * gradient)


@pytest.mark.parametrize("level", ["off", "shape", "points", "points, many photos"])
def test_schur_complement_is_the_dense_step(pairs, cubic, level):
    if level == "points, many photos":  # more pose than corner unknowns: poses are eliminated
        pairs, _ = select(pairs, (pairs.board == 0) & (pairs.column < 2) & (pairs.row < 4))
    poses = cubic.poses[np.arange(len(pairs.images))]
    world = None
    if level != "off":
        world = DeformableTarget.from_nominal(
            pairs, TARGET, noise=0.2, offset_spread=0.01 if level.startswith("points") else None
        )
    normal = normal_equations(cubic.lens, poses, pairs, 0.5, world)
    assert (len(normal.corner) > 0) == level.startswith("points")
    step = np.concatenate([part.ravel() for part in normal.solve(1e-3)])
    np.testing.assert_allclose(step, dense_step(normal, 1e-3), rtol=1e-4, atol=1e-9)


def test_reduced_hessian_is_the_inverse_of_the_covariance(pairs, cubic):
    world = DeformableTarget.from_nominal(pairs, TARGET, noise=0.2, offset_spread=0.01)
    normal = normal_equations(cubic.lens, cubic.poses, pairs, 0.5, world)
    count = len(normal.shared)
    blocks = block_diag(normal.shared, *normal.pose, *normal.corner)
    blocks[:count, count : count + 30] = normal.shared_pose
    blocks[:count, count + 30 :] = normal.shared_corner
    blocks[count : count + 30, count + 30 :] = normal.pose_corner
    dense = np.triu(blocks) + np.triu(blocks, 1).T
    scale = 1 / np.sqrt(np.diag(dense))
    covariance = scale * scale[:, None] * np.linalg.inv(dense * scale * scale[:, None])
    expected = np.linalg.inv(normal.reduced_shared())
    sigma = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        covariance[:count, :count] / sigma / sigma[:, None],
        expected / sigma / sigma[:, None],
        atol=1e-4,
    )


def test_gradient_is_the_slope_of_the_cost(pairs, cubic):
    """Away from the optimum, against the cost itself: Huber loss and prior included."""
    lens = cubic.lens.with_parameters(cubic.lens.parameters * (1 + 1e-3))
    normal = normal_equations(lens, cubic.poses, pairs, 0.3)
    for index in (0, 5, 20, 33, 46, 47):
        step = np.zeros(48)
        step[index] = 1e-7
        up = cost(lens.with_parameters(lens.parameters + step), cubic.poses, pairs, 0.3)
        down = cost(lens.with_parameters(lens.parameters - step), cubic.poses, pairs, 0.3)
        assert normal.shared_gradient[index] == pytest.approx((up - down) / 2e-7, rel=1e-4)
    for index in range(6):
        step = np.zeros((5, 6))
        step[2, index] = 1e-6
        up = cost(lens, cubic.poses.moved(step), pairs, 0.3)
        down = cost(lens, cubic.poses.moved(-step), pairs, 0.3)
        assert normal.pose_gradient[2, index] == pytest.approx((up - down) / 2e-6, rel=1e-4)


def test_a_perturbed_start_returns_to_the_same_optimum(pairs, cubic):
    rng = np.random.default_rng(0)
    again = adjust(
        cubic.lens.with_parameters(cubic.lens.parameters + 1e-3 * rng.standard_normal(48)),
        cubic.poses.moved(1e-3 * rng.standard_normal((5, 6))),
        pairs,
        huber_px=5.0,
    )
    once = adjust(cubic.lens, cubic.poses, pairs, huber_px=5.0)
    assert again.cost == pytest.approx(once.cost, rel=1e-8)
    np.testing.assert_allclose(again.residual, once.residual, atol=1e-4)


class Valley:
    """Pixels that depend on two parameters: Rosenbrock's valley, a floor that bends."""

    def __init__(self, parameters):
        self.parameters = np.asarray(parameters, float)

    def with_parameters(self, parameters):
        return Valley(parameters)

    def project_jacobian(self, points):
        x, y = self.parameters
        pixel = np.tile([100 * (y - x * x), 1 - x], (len(points), 1))
        slope = np.tile([[-200 * x, 100.0], [-1.0, 0.0]], (len(points), 1, 1))
        return pixel, np.zeros((len(points), 2, 3)), slope

    def project(self, points):
        return self.project_jacobian(points)[0]

    def prior(self):
        return np.zeros((3, 3))


def test_a_valley_that_bends_is_followed(pairs, cubic):
    """Not crept along: whoever takes back what ends on its side is not there in a hundred steps."""
    still = replace(pairs, pixel=np.zeros_like(pairs.pixel))
    fit = adjust(Valley([-1.2, 1.0]), cubic.poses, still, huber_px=1e6)
    np.testing.assert_allclose(fit.lens.parameters, 1.0, atol=1e-6)
    assert fit.iterations <= 20


@pytest.mark.parametrize("axis", range(3))
def test_a_photo_far_off_does_not_hold_up_the_others(pairs, axis):
    """It finds back by itself; to damp all for it takes twenty to a hundred steps."""
    pairs = pairs.with_world(pairs.world / 300)
    poses = fit_radial(pairs).poses
    turn = np.zeros((5, 6))
    turn[3, axis] = np.deg2rad(175)
    lens = FreeLens.of(replace(TRUTH, fx=250.0))
    fit = adjust(lens, poses.moved(turn), pairs, huber_px=2.0)
    once = adjust(lens, poses, pairs, huber_px=2.0)
    assert fit.cost == pytest.approx(once.cost, rel=1e-8)
    assert fit.iterations <= 12


def test_huber_loss_and_its_weight_belong_together():
    distance = np.linspace(0.01, 5, 200)
    slope = (huber_cost(distance + 1e-6, 1.2) - huber_cost(distance - 1e-6, 1.2)) / 2e-6
    np.testing.assert_allclose(slope, huber_weight(distance, 1.2) * distance, atol=1e-6)
    # No step where the one passes into the other.
    np.testing.assert_allclose(*huber_cost(np.array([1.2 - 1e-9, 1.2 + 1e-9]), 1.2), rtol=1e-8)


def test_a_start_at_infinity_is_refused(pairs, cubic):
    behind = Poses(rotation=cubic.poses.rotation, translation=np.full((5, 3), np.nan))
    with pytest.raises(FitError, match="infinity"):
        adjust(cubic.lens, behind, pairs, huber_px=1.0)


def test_the_pull_of_offsets_is_in_hessian_and_gradient(pairs, cubic):
    world = DeformableTarget.from_nominal(pairs, TARGET, noise=0.2, offset_spread=0.01)
    world = world.moved(np.zeros(len(world.parameters)), np.full(world.offsets.shape, 0.003))
    held = normal_equations(cubic.lens, cubic.poses, pairs, 5.0, world)
    free = normal_equations(cubic.lens, cubic.poses, pairs, 5.0, world.with_noise(0.2, 1e9))
    pull = (0.2 / 0.01) ** 2
    np.testing.assert_allclose(
        held.corner - free.corner, np.broadcast_to(pull * np.eye(3), held.corner.shape), atol=1e-6
    )
    np.testing.assert_allclose(held.corner_gradient - free.corner_gradient, 0.003 * pull)


def test_a_last_step_that_is_trusted_ends_nearer_to_the_optimum(pairs, cubic):
    start = cubic.lens.with_parameters(cubic.lens.parameters * (1 + 1e-5))
    rough = {"huber_px": 5.0, "relative_decrease": 1e-2, "damping": adjustment.WARM_DAMPING}
    best = adjust(start, cubic.poses, pairs, huber_px=5.0)

    def above(fit):
        return cost(fit.lens, fit.poses, pairs, 5.0) / best.cost - 1

    seen = adjust(start, cubic.poses, pairs, **rough)
    trusted = adjust(start, cubic.poses, pairs, trust_last=True, **rough)
    assert seen.iterations == trusted.iterations
    assert above(trusted) < 0.01 * above(seen)
    assert above(seen) > 0
