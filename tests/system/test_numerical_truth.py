"""Whatever the lens, the object and the poses: the camera that comes out is the true one.

Each example is a whole calibration, so a run tries few of them: more with, say,
``CUBICFISH_TEST_EXAMPLES=300 pytest tests/system/test_numerical_truth.py``.
"""

import os
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import synthetic
from asymmetric_lens import AsymmetricLens
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cubicfish import Calibration, Target, aligned_difference, load_camera
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.evaluate import evaluate
from cubicfish.io.camera_yaml import camera_text
from cubicfish.models import cone_rays

EXAMPLES = int(os.environ.get("CUBICFISH_TEST_EXAMPLES", "5"))
NOISE = 0.1
# Sums in another order, or of other roundings, end a little apart: 1e-6 px at most were seen.
SAME_PX = 1e-5


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A lens, an object, and what photos of it show."""

    lens: AsymmetricLens
    target: Target
    pairs: object


@cache
def problem(seed: int) -> Problem:
    """A lens of 60° to 220°, decentred and tilted; a corner or a box; 6 to 14 photos."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(30, 110)
    theta = np.radians(half)
    k = tuple(rng.uniform(-1, 1, 4) * [0.04, 0.006, 0.001, 0.0001])
    width, height = synthetic.IMAGE_SIZE
    radius = theta * (1 + sum(value * theta ** (2 * n + 2) for n, value in enumerate(k)))
    focal = rng.uniform(0.42, 0.6) * height / radius
    lens = AsymmetricLens(
        image_size=(width, height),
        fx=focal,
        fy=focal * rng.uniform(0.98, 1.02),
        cx=width / 2 + rng.uniform(-0.06, 0.06) * width,
        cy=height / 2 + rng.uniform(-0.06, 0.06) * height,
        k=k,
        p=tuple(rng.uniform(-5e-4, 5e-4, 2)),
        tilt=tuple(rng.uniform(-2e-3, 2e-3, 2)),
        max_angle_deg=half,
    )
    target = synthetic.box_of_four() if rng.random() < 0.5 else synthetic.corner_of_three()
    poses = synthetic.poses_around(
        target,
        int(rng.integers(6, 15)),
        distance=(0.3, 0.9),
        off_axis_deg=min(75, half),
        seed=int(rng.integers(2**31)),
    )
    pairs = synthetic.synthetic_correspondences(
        target, poses, lens=lens, noise=NOISE, seed=int(rng.integers(2**31))
    )
    return Problem(lens=lens, target=target, pairs=pairs)


def fit(one: Problem) -> Calibration:
    return calibrate(one.pairs, hold_out=False)


def miss_px(camera, truth, angle_deg: float) -> np.ndarray:
    """Pixel differences over a cone after the best rotation, those both see."""
    miss, _ = aligned_difference(camera, truth, cone_rays(np.deg2rad(angle_deg), 2000))
    return np.linalg.norm(miss[np.isfinite(miss[:, 0])], axis=1)


# In a usual run the tests share a few problems and their fits.
SEEDS = st.integers(0, 2**31) if EXAMPLES >= 20 else st.sampled_from(range(EXAMPLES))


@cache
def fit_of(seed: int) -> Calibration:
    return fit(problem(seed))


@pytest.mark.slow
@settings(max_examples=EXAMPLES, derandomize=EXAMPLES < 20)
@given(seed=SEEDS)
def test_the_true_camera_comes_out(seed):
    one, result = problem(seed), fit_of(seed)
    assert not result.unfit
    assert len(result.fit.dropped_corners) <= 1e-3 * len(one.pairs.pixel)
    assert result.errors.rms_px == pytest.approx(NOISE * np.sqrt(2), rel=0.08)
    angle = min(result.fit.covered_deg, one.lens.max_angle_deg - 0.1)
    miss = miss_px(result.camera, one.lens, angle)
    # The uncertainty is the median's over the photo; errors at the rim are a few times that, and
    # a cubic meets such a lens to 0.03 px.
    assert np.median(miss) < 0.03 + 2.5 * result.fit.uncertainty.median_px
    assert np.sqrt(np.mean(miss**2)) < 0.03 + 3 * result.fit.uncertainty.median_px


@pytest.mark.slow
@settings(max_examples=EXAMPLES, derandomize=EXAMPLES < 20)
@given(seed=SEEDS)
def test_pixels_and_rays_go_both_ways_and_through_a_file(seed, tmp_path_factory):
    result = fit_of(seed)
    camera = result.camera
    path = tmp_path_factory.mktemp("camera") / "camera.yaml"
    path.write_text(camera_text(camera, fit=result.fit, made_by={}))
    read = load_camera(path).camera
    np.testing.assert_array_equal(read.P, camera.P)
    assert read.max_angle_deg == camera.max_angle_deg
    assert read.image_size == camera.image_size
    rays = cone_rays(np.deg2rad(0.999 * camera.max_angle_deg), 3000)
    pixel = read.project(rays)
    inside = np.isfinite(pixel[:, 0])
    assert inside.mean() > 0.5
    width, height = camera.image_size
    on_photo = inside & ((pixel >= 0) & (pixel <= [width - 1, height - 1])).all(axis=1)
    again = read.unproject(pixel[on_photo])
    np.testing.assert_allclose(again, rays[on_photo], atol=1e-9)
    np.testing.assert_allclose(read.project(again), pixel[on_photo], atol=1e-6)


@pytest.mark.slow
@settings(max_examples=EXAMPLES, derandomize=EXAMPLES < 20)
@given(seed=SEEDS, factor=st.sampled_from([1e-3, 0.1, 39.37, 1e3]))
def test_units_and_the_worlds_frame_change_nothing(seed, factor):
    one = problem(seed)
    rotation = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    world = factor * (one.pairs.world @ rotation.T + [310.0, -20.0, 75.0])
    first, second = fit_of(seed), fit(replace(one, pairs=replace(one.pairs, world=world)))
    assert miss_px(second.camera, first.camera, first.fit.covered_deg).max() < SAME_PX
    assert second.errors.rms_px == pytest.approx(first.errors.rms_px, rel=1e-6)


@pytest.mark.slow
@settings(max_examples=EXAMPLES, derandomize=EXAMPLES < 20)
@given(seed=SEEDS)
def test_the_order_of_photos_changes_nothing(seed):
    one = problem(seed)
    pairs = one.pairs
    order = np.random.default_rng(seed).permutation(len(pairs.images))
    place = np.argsort(order)
    rows = np.argsort(place[pairs.image], kind="stable")
    turned = replace(
        pairs,
        images=tuple(pairs.images[index] for index in order),
        image=place[pairs.image][rows],
        **{
            name: getattr(pairs, name)[rows]
            for name in ("world", "pixel", "weight", "board", "column", "row")
        },
    )
    first, second = fit_of(seed), fit(replace(one, pairs=turned))
    assert miss_px(second.camera, first.camera, first.fit.covered_deg).max() < SAME_PX


def same_fits(first: Calibration, second: Calibration) -> None:
    assert miss_px(second.camera, first.camera, first.fit.covered_deg).max() < SAME_PX
    assert second.errors.rms_px == pytest.approx(first.errors.rms_px, rel=1e-5)
    assert second.fit.uncertainty.median_px == pytest.approx(
        first.fit.uncertainty.median_px, rel=1e-3
    )
    assert second.held_out.rms_px == pytest.approx(first.held_out.rms_px, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("refine_target", ["off", "points"])
@settings(
    max_examples=max(1, EXAMPLES // 2),
    derandomize=EXAMPLES < 20,
    deadline=None,
    # A smaller example of a whole calibration tells no more.
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
)
@given(
    seed=SEEDS,
    # In the unit of the object, which is some hundreds wide: surveyors' metres in millimetres too.
    shift=st.tuples(*[st.floats(-1, 1)] * 3).map(np.array),
    size=st.sampled_from([3e2, 3e4, 1e6, 5e8]),
)
def test_a_shift_of_the_world_changes_nothing(refine_target, seed, shift, size):
    one = problem(seed)
    offset = size * shift
    moved = one.target.moved(offset)
    pairs = replace(
        one.pairs, world=moved.world_points(one.pairs.board, one.pairs.column, one.pairs.row)
    )
    near = calibrate(one.pairs, target=one.target, refine_target=refine_target)
    far = calibrate(pairs, target=moved, refine_target=refine_target)
    same_fits(near, far)
    # What comes out is in the user's own frame: the same camera, before the same object.
    rounding = 1e-15 * np.linalg.norm(offset)
    scale = np.ptp(one.pairs.world, axis=0).max()
    middles = [
        fit.poses.apply(np.arange(len(fit.poses)), np.tile(middle, (len(fit.poses), 1)))
        for fit, middle in ((near, np.zeros(3)), (far, offset))
    ]
    np.testing.assert_allclose(*middles, atol=1e-5 * scale + 10 * rounding)
    corners = [fit.target.corners()[3] for fit in (near, far)]
    np.testing.assert_allclose(corners[0] + offset, corners[1], atol=1e-6 * scale + rounding)
    np.testing.assert_allclose(far.pairs.world - offset, near.pairs.world, atol=1e-6 * scale)
    again = evaluate(far.camera, far.pairs)
    assert again.errors.rms_px == pytest.approx(far.errors.rms_px, rel=1e-4)


@pytest.mark.slow
@settings(max_examples=max(1, EXAMPLES // 2), derandomize=EXAMPLES < 20, deadline=None)
@given(seed=SEEDS, exponent=st.floats(-6, 6), uneven=st.booleans())
def test_a_factor_on_all_weights_changes_nothing(seed, exponent, uneven):
    one = problem(seed)
    own = np.random.default_rng(seed).uniform(0.2, 5, len(one.pairs.pixel)) if uneven else 1.0
    weight = own * np.ones(len(one.pairs.pixel))
    fits = [
        calibrate(replace(one.pairs, weight=factor * weight)) for factor in (1.0, 10.0**exponent)
    ]
    same_fits(*fits)
    np.testing.assert_allclose(fits[1].pairs.weight, 10.0**exponent * fits[0].pairs.weight)
    records = [
        evaluate(fit.camera, replace(one.pairs, weight=factor * weight)).errors.rms_px
        for fit, factor in zip(fits, (1.0, 10.0**exponent), strict=True)
    ]
    assert records[1] == pytest.approx(records[0], rel=1e-5)
