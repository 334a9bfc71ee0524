"""Levenberg–Marquardt: at the truth nothing moves, and the Schur complement is a dense step."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from scipy.linalg import block_diag

from cubicfish.errors import FitError
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.prior import Prior, decentred_lens, tie_to
from cubicfish.fit.radial_reference import fit_radial, refit_radial
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.solve import adjustment
from cubicfish.solve import normal_equations as equations
from cubicfish.solve.adjustment import State, adjust, huber_cost, huber_weight
from cubicfish.solve.deformable_target import DeformableTarget, NominalTarget
from cubicfish.solve.fit_lens import FitLens, FreeLens
from cubicfish.solve.normal_equations import damped
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import select

TRUTH = RadialCamera(
    image_size=(960, 720), fx=255, fy=256, cx=500, cy=340, k=np.array([-0.03, 0.002, 0, 0])
)
TARGET = synthetic.corner_of_three()
POSES = synthetic.poses_around(TARGET, 5, seed=2)


def normal_equations(lens, poses, pairs, huber_px, world=None):
    world = DeformableTarget(nominal=pairs.world) if world is None else world
    return adjustment._evaluate(State(lens, poses, world), pairs, huber_px).normal


def cost(lens, poses, pairs, huber_px, world=None):
    world = DeformableTarget(nominal=pairs.world) if world is None else world
    return adjustment._evaluate(State(lens, poses, world), pairs, huber_px).cost


@pytest.fixture(scope="module")
def pairs():
    return synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH, noise=0.2, seed=3)


@pytest.fixture(scope="module")
def cubic(pairs):
    return fit_cubic(fit_radial(pairs), Prior(spread=0.01, weight=0.5))


def test_at_the_truth_residual_and_gradient_are_zero():
    exact = synthetic.synthetic_correspondences(TARGET, POSES, lens=TRUTH)
    reference = fit_radial(exact)
    lens = FreeLens.of(TRUTH)
    normal = normal_equations(lens, reference.poses, exact, 1.0)
    assert np.abs(reference.residual).max() < 1e-6
    shared, pose, _ = normal.gradient
    assert np.abs(shared).max() < 1e-2 * np.sqrt(np.diag(normal.shared)).max() * 1e-3
    assert np.abs(pose).max() < 1e-5 * np.sqrt(normal.pose.max())


def test_a_bend_is_the_same_from_near_by(pairs):
    reference = fit_radial(pairs)
    again = refit_radial(reference, reference.pairs, reference.poses)
    rays = cone_rays(1.2, 100)
    anew, near = (decentred_lens(one, 1e-3)[0].project(rays) for one in (reference, again))
    np.testing.assert_allclose(near, anew, atol=2e-3)
    followed = again.followed(reference.pairs.world * 1.0)
    assert decentred_lens(followed, 1e-3)[0] is decentred_lens(again, 1e-3)[0]
    assert (
        tie_to(again.followed(reference.pairs.world), 1e-3).lens is decentred_lens(again, 1e-3)[0]
    )


def dense(normal, damping=0.0):
    """The whole Hessian at once, (D, D), and the gradient, (D,)."""
    shared, pose, corner = (
        damped(block, damping) if damping else block
        for block in (normal.shared[:, :-1], normal.pose, normal.corner)
    )
    whole = block_diag(shared, *pose, *corner)
    count, poses = len(shared), 6 * len(pose)
    whole[count : count + poses, :count] = normal.pose_shared[:, :, :-1].reshape(poses, count)
    whole[count + poses :, :count] = normal.corner_shared[:, :, :-1].reshape(-1, count)
    both = normal.pose_corner.reshape(poses, 3 * len(corner))
    whole[count + poses :, count : count + poses] = both.T
    gradient = np.concatenate([part.ravel() for part in normal.gradient])
    return np.tril(whole) + np.tril(whole, -1).T, gradient


def dense_step(normal, damping):
    """The damped step from the whole Hessian at once."""
    whole, gradient = dense(normal, damping)
    scale = 1 / np.sqrt(np.diag(whole))
    return -scale * np.linalg.solve(whole * scale * scale[:, None], scale * gradient)


@pytest.mark.parametrize("level", ["off", "shape", "points", "points, many photos"])
def test_schur_complement_is_the_dense_step(pairs, cubic, level):
    if level == "points, many photos":  # more pose than corner unknowns: poses are eliminated
        pairs, _ = select(pairs, (pairs.board == 0) & (pairs.column < 2) & (pairs.row < 4))
    poses = cubic.poses[np.arange(len(pairs.images))]
    world = None
    if level != "off":
        world = NominalTarget(pairs=pairs, target=TARGET).free(
            noise=0.2, offset_spread=0.01 if level.startswith("points") else None
        )
    normal = normal_equations(cubic.lens, poses, pairs, 0.5, world)
    assert (len(normal.corner) > 0) == level.startswith("points")
    step = np.concatenate([part.ravel() for part in normal.solve(1e-3)])
    np.testing.assert_allclose(step, dense_step(normal, 1e-3), rtol=1e-4, atol=1e-9)


def test_reduced_hessian_is_the_inverse_of_the_covariance(pairs, cubic):
    world = NominalTarget(pairs=pairs, target=TARGET).free(noise=0.2, offset_spread=0.01)
    normal = normal_equations(cubic.lens, cubic.poses, pairs, 0.5, world)
    count = len(normal.shared)
    whole, _ = dense(normal)
    scale = 1 / np.sqrt(np.diag(whole))
    covariance = scale * scale[:, None] * np.linalg.inv(whole * scale * scale[:, None])
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
        assert normal.gradient[0][index] == pytest.approx((up - down) / 2e-7, rel=1e-4)
    for index in range(6):
        step = np.zeros((5, 6))
        step[2, index] = 1e-6
        up = cost(lens, cubic.poses.moved(step), pairs, 0.3)
        down = cost(lens, cubic.poses.moved(-step), pairs, 0.3)
        assert normal.gradient[1][2, index] == pytest.approx((up - down) / 2e-6, rel=1e-4)


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


class Valley(FitLens):
    """Pixels that depend on two parameters: Rosenbrock's valley, a floor that bends."""

    def __init__(self, values):
        self.values = np.asarray(values, float)

    @property
    def parameters(self):
        return self.values

    def with_parameters(self, parameters):
        return Valley(parameters)

    def pixel_and_slopes(self, points):
        x, y = self.parameters
        pixel = np.tile([100 * (y - x * x), 1 - x], (len(points), 1))
        slope = np.tile([[-200 * x, 100.0], [-1.0, 0.0]], (len(points), 1, 1))
        return pixel, np.zeros((len(points), 2, 3)), slope


def test_a_valley_that_bends_is_followed(pairs, cubic):
    """Not crept along: whoever takes back what ends on its side is not there in a hundred steps."""
    still = replace(pairs, pixel=np.zeros_like(pairs.pixel))
    fit = adjust(Valley([-1.2, 1.0]), cubic.poses, still, huber_px=1e6)
    np.testing.assert_allclose(fit.lens.parameters, 1.0, atol=1e-6)
    assert fit.iterations <= 20


class Gorge(Valley):
    """One that bends twice as much as its slopes say: a residual stays, and its slope changes."""

    def with_parameters(self, parameters):
        return Gorge(parameters)

    def pixel_and_slopes(self, points):
        x, _ = self.parameters
        pixel = np.tile([x, 10 + 0.049 * x * x], (len(points), 1))
        slope = np.tile([[1.0, 0.0], [0.098 * x, 0.0]], (len(points), 1, 1))
        return pixel, np.zeros((len(points), 2, 3)), slope


def test_steps_do_not_lead_from_one_side_of_a_gorge_to_the_other(pairs, cubic):
    still = replace(pairs, pixel=np.zeros_like(pairs.pixel))
    fit = adjust(Gorge([1.0, 0.0]), cubic.poses, still, huber_px=1e6)
    assert abs(fit.lens.parameters[0]) < 1e-3
    assert fit.iterations <= 40


@pytest.mark.parametrize("axis", range(3))
def test_a_photo_far_off_does_not_hold_up_the_others(pairs, axis):
    """It is damped by itself; where all are damped for it, a hundred steps do not do."""
    pairs = pairs.with_world(pairs.world / 300)
    poses = fit_radial(pairs).poses
    turn = np.zeros((5, 6))
    turn[3, axis] = np.deg2rad(175)
    lens = FreeLens.of(replace(TRUTH, fx=250.0))
    fit = adjust(lens, poses.moved(turn), pairs, huber_px=2.0)
    once = adjust(lens, poses, pairs, huber_px=2.0)
    assert fit.cost == pytest.approx(once.cost, rel=1e-8)
    assert fit.iterations <= 30


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
    world = NominalTarget(pairs=pairs, target=TARGET).free(noise=0.2, offset_spread=0.01)
    world = world.moved(np.zeros(len(world.parameters)), np.full(world.offsets.shape, 0.003))
    held = normal_equations(cubic.lens, cubic.poses, pairs, 5.0, world)
    free = normal_equations(cubic.lens, cubic.poses, pairs, 5.0, replace(world, offset_spread=1e9))
    pull = (0.2 / 0.01) ** 2
    np.testing.assert_allclose(
        held.corner - free.corner, np.broadcast_to(pull * np.eye(3), held.corner.shape), atol=1e-6
    )
    np.testing.assert_allclose(held.gradient[2] - free.gradient[2], 0.003 * pull)


def test_a_step_is_the_same_however_many_photos_are_eliminated_at_once(cubic, monkeypatch):
    whole = cubic.normal.solve(1e-3)
    monkeypatch.setattr(equations, "_NUMBERS_AT_ONCE", 2 * 6 * len(cubic.normal.shared))
    for part, wanted in zip(cubic.normal.solve(1e-3), whole, strict=True):
        np.testing.assert_allclose(part, wanted, atol=1e-9 * np.abs(wanted).max(initial=0))


def test_a_step_that_is_trusted_leads_on_without_a_look(pairs, cubic, monkeypatch):
    looks = []
    evaluate = adjustment._evaluate
    monkeypatch.setattr(adjustment, "_evaluate", lambda *given: looks.append(0) or evaluate(*given))
    moved = cubic.lens.parameters + 1e-4 * np.abs(cubic.lens.parameters)
    start = cubic.lens.with_parameters(moved), cubic.poses, cubic.pairs, cubic.huber_px
    costs, numbers = [], []
    for trusted in (False, True):
        looks.clear()
        fit = adjust(
            *start,
            relative_decrease=1e-3,
            damping=adjustment.WARM_DAMPING,
            trust_last=trusted,
        )
        numbers.append(len(looks))
        costs.append(cost(fit.lens, fit.poses, pairs, cubic.huber_px))
    best = cost(cubic.lens, cubic.poses, pairs, cubic.huber_px)
    assert numbers[1] <= numbers[0]
    assert costs[1] - best < 0.5 * (costs[0] - best)


def test_what_led_to_the_start_tells_whether_a_step_is_trusted(pairs, cubic, monkeypatch):
    looks = []
    evaluate = adjustment._evaluate
    monkeypatch.setattr(adjustment, "_evaluate", lambda *given: looks.append(0) or evaluate(*given))
    lens = cubic.lens.with_parameters(1.0001 * cubic.lens.parameters)
    start = lens, cubic.poses, cubic.pairs, cubic.huber_px
    far = cost(*start)
    numbers = []
    for before in (0.0, 1e6 * far):
        looks.clear()
        adjust(
            *start,
            relative_decrease=1e-4,
            damping=adjustment.WARM_DAMPING,
            trust_last=True,
            cost_before=before,
        )
        numbers.append(len(looks))
    assert numbers[0] > numbers[1] == 1


@pytest.mark.parametrize("level", ["off", "points"])
def test_photos_of_any_sizes_add_up_to_the_dense_products(pairs, cubic, level):
    some = pairs.select(np.flatnonzero(np.arange(len(pairs.pixel)) % 7 < 2 + 2 * pairs.image))
    counts = np.bincount(some.image)
    alike = pairs.select(
        np.concatenate([np.flatnonzero(pairs.image == photo)[: counts.min()] for photo in range(5)])
    )
    assert len(set(counts)) > 1
    for own in (some, alike):
        world = DeformableTarget(nominal=own.world)
        if level == "points":
            nominal = NominalTarget(target=TARGET, pairs=own)
            world = nominal.free(noise=1.0, offset_spread=1e-2)
        state = State(cubic.lens, cubic.poses, world)
        normal = equations.NormalEquations.zeros(*state.size)
        dense = np.zeros((normal.shared.shape[0], normal.shared.shape[1]))
        by_pose = np.zeros_like(normal.pose_shared)
        corner = np.zeros_like(normal.corner_shared)
        for run, terms in adjustment.linearise(state, own, 1e9):
            normal.add(terms, world.corner[run])
            whole = terms.by_shared(np.eye(len(dense)))
            whole = np.concatenate([whole, terms.miss[:, :, None]], axis=2)
            dense += np.einsum("nak,nal->kl", whole, whole)[:-1]
            np.add.at(by_pose, terms.pose, np.einsum("nap,nal->npl", terms.by_pose, whole))
            if level == "points":
                product = np.einsum("nac,nal->ncl", terms.by_corner, whole)
                np.add.at(corner, world.corner[run], product)
        np.testing.assert_allclose(normal.shared, dense, rtol=1e-9, atol=1e-9 * np.abs(dense).max())
        np.testing.assert_allclose(normal.pose_shared, by_pose, atol=1e-9 * np.abs(by_pose).max())
        if level == "points":
            close = 1e-9 * np.abs(corner).max()
            np.testing.assert_allclose(normal.corner_shared, corner, atol=close)


def test_runs_end_between_photos_but_where_one_is_very_long(pairs, cubic, monkeypatch):
    state = State(cubic.lens, cubic.poses, DeformableTarget(nominal=pairs.world))
    starts = np.flatnonzero(np.diff(pairs.image, prepend=-1))
    longest = int(np.bincount(pairs.image).max())
    for size, whole in ((longest, True), (longest // 4, False)):
        monkeypatch.setattr(adjustment, "_RUN_PAIRS", size)
        monkeypatch.setattr(adjustment, "_RUN_UNKNOWNS", 0)
        runs = adjustment._cut_runs(state, pairs)
        assert len(runs) > 1
        assert [run.start for run in runs] == [0, *(run.stop for run in runs[:-1])]
        assert runs[-1].stop == len(pairs.pixel)
        assert max(run.stop - run.start for run in runs) <= 2 * size
        assert ({run.start for run in runs} <= {*starts.tolist()}) == whole
