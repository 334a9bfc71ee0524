"""The whole fit on known truth: it recovers, says how right it is, and refuses what cannot be."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation
from synthetic_lenses import synthetic_lens

from cubicfish.comparison import aligned_difference
from cubicfish.errors import FitError
from cubicfish.fit import cubic_fit
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.evaluate import evaluate
from cubicfish.fit.prior import Prior
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.subset import select, select_photos, world_scale

pytestmark = pytest.mark.slow

TARGET = synthetic.corner_of_three()
NOISE = 0.1


@pytest.fixture(scope="module")
def pairs():
    poses = synthetic.poses_around(TARGET, 12, seed=21)
    return synthetic.synthetic_correspondences(TARGET, poses, noise=NOISE, seed=22)


@pytest.fixture(scope="module")
def fitted(pairs):
    return calibrate(pairs)


def difference_px(camera, truth, angle_deg):
    """RMS pixel difference over a cone after the best rotation."""
    miss, _ = aligned_difference(camera, truth, cone_rays(np.deg2rad(angle_deg), 2000))
    assert np.isfinite(miss).all()
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=1))))


def test_exact_corners_give_the_exact_camera():
    poses = synthetic.poses_around(TARGET, 10, seed=1)
    exact = synthetic.synthetic_correspondences(TARGET, poses)
    result = calibrate(exact, hold_out=False)
    # Twenty coefficients meet a lens of another family, decentred and tilted, this closely.
    assert result.errors.rms_px < 0.005
    assert difference_px(result.camera, synthetic.TRUE_LENS, result.fit.covered_deg) < 0.05
    assert result.fit.radial_rms_px > 10 * result.errors.rms_px


def test_residuals_spread_as_the_noise_does(pairs, fitted):
    parameters = 44 + 6 * 12
    expected = NOISE * np.sqrt(2 - parameters / len(pairs.pixel))
    assert fitted.errors.rms_px == pytest.approx(expected, rel=0.04)
    assert fitted.held_out is not None
    assert fitted.errors.rms_px < fitted.held_out.rms_px < 1.2 * expected
    assert fitted.held_out.rms_px < fitted.held_out.radial_rms_px
    assert fitted.fit.rank == 16
    assert not fitted.fit.dropped_corners
    assert not fitted.unfit


def test_camera_is_sound_to_the_margin(fitted):
    assert fitted.fit.covered_deg + 1 <= fitted.camera.max_angle_deg <= fitted.fit.covered_deg + 5.5
    assert pole_or_fold_deg(fitted.camera.P, fitted.camera.max_angle_deg) is None
    assert np.linalg.norm(fitted.camera.P) == pytest.approx(1, abs=1e-12)


def test_poses_are_the_true_ones_up_to_the_gauge(fitted):
    """One rotation, the gauge, turns all fitted poses into the true ones."""
    truth = synthetic.poses_around(TARGET, 12, seed=21)
    true_rotation = Rotation.from_matrix(
        np.stack([np.asarray(Rotation.from_rotvec(v).as_matrix()) for v, _ in truth])
        if np.shape(truth[0][0]) == (3,)
        else np.stack([np.asarray(r) for r, _ in truth])
    )
    turned = true_rotation * Rotation.from_matrix(fitted.poses.rotation).inv()
    mean = turned.mean()
    assert np.abs((turned * mean.inv()).magnitude()).max() < 2e-3
    centre = -np.einsum("mji,mj->mi", fitted.poses.rotation, fitted.poses.translation)
    true_centre = np.stack(
        [-r.T @ np.asarray(t) for r, (_, t) in zip(true_rotation.as_matrix(), truth, strict=True)]
    )
    np.testing.assert_allclose(centre, true_centre, atol=0.3)


@pytest.mark.parametrize(
    ("half_angle", "focal"), [(35, 640), (60, 380), (110, 195)], ids=["70", "120", "220"]
)
def test_fields_from_narrow_to_beyond_180_degrees(half_angle, focal):
    lens = replace(
        synthetic.TRUE_LENS, fx=float(focal), fy=float(focal) + 0.5, max_angle_deg=half_angle
    )
    target = synthetic.box_of_four()
    poses = synthetic.poses_around(
        target, 12, seed=3, distance=(0.3, 0.6), off_axis_deg=min(80, half_angle)
    )
    pairs = synthetic.synthetic_correspondences(target, poses, lens=lens, noise=0.05, seed=4)
    result = calibrate(pairs, hold_out=False)
    assert result.fit.covered_deg > 0.85 * half_angle
    assert not result.unfit
    angle = min(result.fit.covered_deg, half_angle - 0.1)
    assert difference_px(result.camera, lens, angle) < 0.12


def test_one_photo_of_an_object_with_walls_is_enough():
    target = synthetic.box_of_four()
    pose = synthetic.poses_around(target, 1, seed=8, distance=(0.3, 0.35), off_axis_deg=20)
    one = synthetic.synthetic_correspondences(target, pose, noise=0.05, seed=1)
    result = calibrate(one)
    assert result.held_out is None
    assert result.errors.rms_px < 0.08
    others = synthetic.synthetic_correspondences(
        target, synthetic.poses_around(target, 6, seed=9), noise=0.05, seed=2
    )
    assert evaluate(result.camera, others).errors.rms_px < 0.3


def test_ten_percent_of_gross_outliers_change_nothing(pairs, fitted):
    rng = np.random.default_rng(5)
    bad = rng.random(len(pairs.pixel)) < 0.1
    shift = rng.uniform(4, 60, bad.sum())[:, None] * _directions(rng, bad.sum())
    spoilt = replace(pairs, pixel=pairs.pixel.copy())
    spoilt.pixel[bad] += shift
    result = calibrate(spoilt, hold_out=False)
    assert len(result.fit.dropped_corners) == bad.sum()
    assert result.errors.corners == (~bad).sum()
    dropped = {(c.image, c.board, c.column, c.row) for c in result.fit.dropped_corners}
    first = np.flatnonzero(bad)[0]
    assert (
        pairs.images[pairs.image[first]],
        pairs.boards[pairs.board[first]],
        pairs.column[first],
        pairs.row[first],
    ) in dropped
    clean = calibrate(select(pairs, ~bad)[0], hold_out=False)
    assert result.errors.rms_px == pytest.approx(clean.errors.rms_px, rel=0.05)
    probe = fitted.fit.covered_deg - 1
    assert difference_px(result.camera, clean.camera, probe) < 0.05


def _directions(rng, count):
    turn = rng.uniform(-np.pi, np.pi, count)
    return np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def test_small_errors_are_never_dropped(pairs):
    nudged = replace(pairs, pixel=pairs.pixel.copy())
    nudged.pixel[::50] += [0.6, -0.6]  # eight standard deviations
    assert not calibrate(nudged, hold_out=False).fit.dropped_corners


def test_order_of_photos_and_corners_does_not_matter(pairs, fitted):
    rng = np.random.default_rng(7)
    photos = rng.permutation(len(pairs.images))
    order = rng.permutation(len(pairs.pixel))
    image = np.argsort(photos)[pairs.image[order]]
    order = order[np.argsort(image, kind="stable")]
    shuffled = replace(
        pairs,
        images=tuple(pairs.images[photo] for photo in photos),
        image=np.argsort(photos)[pairs.image[order]],
        world=pairs.world[order],
        pixel=pairs.pixel[order],
        board=pairs.board[order],
        column=pairs.column[order],
        row=pairs.row[order],
    )
    again = calibrate(shuffled, hold_out=False)
    assert difference_px(again.camera, fitted.camera, fitted.fit.covered_deg) < 1e-4


@pytest.mark.parametrize("change", ["metres", "moved world"])
def test_units_and_world_frame_do_not_matter(pairs, fitted, change):
    if change == "metres":
        other = replace(pairs, world=pairs.world / 1000)
    else:
        turn = Rotation.from_rotvec([0.5, -1.0, 2.0]).as_matrix()
        other = replace(pairs, world=pairs.world @ turn.T + [300.0, -200.0, 1000.0])
    again = calibrate(other, hold_out=False)
    assert difference_px(again.camera, fitted.camera, fitted.fit.covered_deg) < 1e-4
    if change == "metres":
        np.testing.assert_allclose(
            again.poses.translation * 1000, fitted.poses.translation, atol=1e-2
        )


def test_scaling_the_photos_scales_the_camera(pairs, fitted):
    width, height = pairs.image_size
    half = replace(pairs, image_size=(2 * width, 2 * height), pixel=(pairs.pixel + 0.5) * 2 - 0.5)
    again = calibrate(half, hold_out=False)
    rays = cone_rays(np.deg2rad(fitted.fit.covered_deg), 500)
    expected = (fitted.camera.project(rays) + 0.5) * 2 - 0.5
    miss, _ = aligned_difference(again.camera, _Pixels(rays, expected), rays)
    assert np.sqrt(np.mean(miss**2)) < 0.02


class _Pixels:
    """A lens that knows its pixels at given rays only."""

    def __init__(self, rays, pixel):
        self._rays, self._pixel = rays, pixel

    def project(self, points):
        np.testing.assert_array_equal(points, self._rays)
        return self._pixel


def test_too_few_corners_are_refused(pairs):
    few, _ = select(pairs, np.arange(len(pairs.pixel)) < 29)
    with pytest.raises(FitError, match="29 corners are too few"):
        calibrate(few)


def test_one_photo_of_one_flat_board_is_refused_with_what_to_add():
    target = synthetic.flat_board()
    pose = synthetic.poses_around(target, 1, seed=3)
    one = synthetic.synthetic_correspondences(target, pose)
    with pytest.raises(FitError, match=r"one flat board.*add photos") as caught:
        calibrate(one)
    assert "\n" not in str(caught.value)


def test_a_target_that_does_not_fit_is_refused(pairs):
    world = pairs.world.copy()
    right = pairs.board == 2
    world[right] = world[right] * [1, 1, 2.5] + [80, 0, 0]
    with pytest.raises(FitError, match="do not fit the target"):
        calibrate(replace(pairs, world=world))


def test_random_pixels_are_refused(pairs):
    rng = np.random.default_rng(0)
    pixel = rng.uniform([0, 0], pairs.image_size, pairs.pixel.shape)
    with pytest.raises(FitError, match="do not fit the target"):
        calibrate(replace(pairs, pixel=pixel))


def test_flat_boards_all_seen_head_on_are_refused():
    """Without tilt, distance and focal length cannot be told apart on a perspective lens."""
    lens = RadialCamera(
        image_size=(960, 720), fx=900, fy=900, cx=480, cy=360, k=np.array([1 / 3, 2 / 15, 0, 0])
    )
    target = synthetic.flat_board()
    middle = synthetic.object_middle(target)
    poses = [(np.zeros(3), np.array([0, 0, far]) - middle) for far in (500.0, 600.0, 700.0)]
    pairs = synthetic.synthetic_correspondences(target, poses, lens=lens, noise=0.1)
    with pytest.raises(FitError, match="do not determine the lens"):
        calibrate(pairs)


def test_held_out_needs_three_photos(pairs):
    assert calibrate(select_photos(pairs, np.arange(2))).held_out is None


def test_held_out_counts_what_a_fold_never_saw(pairs):
    """Spoil the names of one photo a little: in-sample follows it, held-out tells."""
    result = calibrate(select_photos(pairs, np.arange(6)))
    assert result.held_out is not None
    assert result.held_out.folds == 5
    assert result.held_out.rms_px > result.errors.rms_px


def test_weak_prior_still_gives_a_sound_camera(pairs):
    result = fit_cubic(fit_radial(pairs), Prior(spread=0.01, weight=1e-4))
    assert pole_or_fold_deg(result.lens.P, result.max_angle_deg) is None
    assert result.prior.weight >= 1e-4


def test_a_pole_ties_p_closer_to_the_radial_reference(pairs, monkeypatch):
    """Whatever weight gives a bad P is raised until the check passes; it never passes silently."""
    reference = fit_radial(pairs)
    checked = []

    def fold_twice(P, angle_deg):
        checked.append(angle_deg)
        real = pole_or_fold_deg(P, angle_deg)
        # Starts are checked, too: the second and the fourth are fits.
        return angle_deg - 1 if len(checked) in (2, 4) else real

    monkeypatch.setattr(cubic_fit, "pole_or_fold_deg", fold_twice)
    result = fit_cubic(reference, Prior(spread=0.01, weight=0.2))
    assert len(checked) == 6
    assert result.prior.weight == pytest.approx(2.0)
    monkeypatch.setattr(cubic_fit, "pole_or_fold_deg", lambda P, angle_deg: 50.0)
    with pytest.raises(FitError, match="folds at 50°"):
        fit_cubic(reference, Prior(spread=0.01, weight=1000.0))


def test_a_lens_that_flattens_out_keeps_its_profile():
    """An orthographic fisheye folds at 90°: its reference keeps its coefficients."""
    lens = RadialCamera(
        image_size=(960, 720),
        fx=340,
        fy=340,
        cx=480,
        cy=360,
        k=np.array([-1 / 6, 1 / 120, -1 / 5040, 1 / 362880]),
    )
    target = synthetic.box_of_four()
    poses = synthetic.poses_around(target, 10, seed=3, distance=(0.3, 0.5))
    pairs = synthetic.synthetic_correspondences(target, poses, lens=lens, noise=0.05, seed=4)
    points = calibrate(pairs, hold_out=False)
    assert points.fit.covered_deg > 80
    assert points.errors.rms_px < 0.08
    assert points.fit.radial_rms_px < 0.08
    assert points.fit.covered_deg <= points.camera.max_angle_deg < 90.5


def test_left_out_photos_choose_how_p_is_held(pairs):
    """Three noisy photos say little of a lens: P is held so that it is no worse than radial."""
    few = select_photos(pairs, np.arange(3))
    rng = np.random.default_rng(1)
    noisy = replace(few, pixel=few.pixel + rng.normal(0, 0.6, few.pixel.shape))
    result = calibrate(noisy)
    assert result.held_out.rms_px <= 1.005 * result.held_out.radial_rms_px


def test_p_is_held_firmly_only_as_far_from_the_axis_as_corners_are():
    """In the middle of a mirror camera's picture no corner is, and its radial lens is a guess."""
    lens, target = synthetic_lens("mirror"), synthetic.corner_of_three()
    poses = synthetic.poses_around(target, 6, seed=2, off_axis_deg=100)
    pairs = synthetic.synthetic_correspondences(
        target, poses, lens=lens, image_size=lens.image_size, noise=0.1
    )
    pairs, _ = select(pairs, lens.unproject(pairs.pixel)[:, 2] < np.cos(np.radians(55)))
    reference = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
    nearest, farthest = np.rad2deg(reference.covered_angles)
    assert 54 < nearest < 56
    assert 102 < farthest < 103
    prior = Prior(spread=0.0, weight=3.0)
    start, _ = next(prior.starts(reference, None, reference.errors))
    prior = start.tie
    angle = np.rad2deg(np.arccos(prior.near.rays[:, 2]))
    held = (angle > nearest) & (angle < farthest)
    assert set(prior.weights[held]) == {3.0}
    assert set(prior.weights[~held]) == {0.1}
    miss = start.project(prior.near.rays) - reference.camera.project(prior.near.rays)
    assert np.abs(miss[held]).max() < 0.02
