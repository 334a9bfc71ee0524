from dataclasses import replace

import numpy as np
import pytest
import synthetic
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import synthetic_lens

from cubicfish.fit.calibrate import calibrate
from cubicfish.scene.truth import camera_points

EXACT = CornerErrors(noise=0, shared=0, spread=0)
TARGET = synthetic.flat_board()
LENS = synthetic_lens("equisolid")


@pytest.fixture(scope="module")
def exact():
    poses = tuple(synthetic.poses_around(TARGET, 6, distance=(0.3, 0.6), off_axis_deg=30))
    return simulated_corners(LENS, TARGET, 6, errors=EXACT, poses=poses)


@pytest.mark.slow
def test_without_errors_corners_are_where_the_lens_sees_them(exact):
    corners, truth = exact
    assert len(truth.poses) == len(corners.images) == 6
    world = corners.with_target(TARGET).world
    for index, pose in enumerate(truth.poses):
        here = corners.image == index
        seen = LENS.project(camera_points(pose, world[here]))
        np.testing.assert_allclose(corners.pixel[here], seen, atol=1e-9)
    np.testing.assert_array_equal(corners.pixel, truth.pixel)
    assert truth.lens is not LENS


def test_errors_have_the_size_that_is_asked_and_photos_their_own_factor(exact):
    _, truth = exact
    errors = CornerErrors(noise=0.3, shared=0, spread=0.7)
    corners, other = simulated_corners(LENS, TARGET, 6, errors=errors, poses=truth.poses, seed=4)
    miss = corners.pixel - other.pixel
    assert np.ptp(np.log(other.factor)) > 0.5
    for index, factor in enumerate(other.factor):
        here = miss[corners.image == index]
        assert here.std() == pytest.approx(0.3 * factor, rel=0.2)


def test_shared_errors_are_shared_by_neighbours_of_one_photo_only(exact):
    _, truth = exact
    errors = CornerErrors(noise=0, shared=0.3, spread=0)
    poses = truth.poses[:1] * 40
    corners, other = simulated_corners(LENS, TARGET, 40, errors=errors, poses=poses)
    miss = (corners.pixel - other.pixel).reshape(40, -1, 2)
    place = other.pixel.reshape(40, -1, 2)[0]
    assert miss.std() == pytest.approx(0.3, rel=0.1)
    apart = np.linalg.norm(place - place[0], axis=1)
    alike = [np.corrcoef(miss[:, 0, 0], miss[:, i, 0])[0, 1] for i in range(len(place))]
    near, far = np.argsort(apart)[1], np.argmax(apart)
    assert alike[near] > 0.8
    assert abs(alike[far]) < 0.5
    assert abs(np.corrcoef(miss[0, :, 0], miss[1, :, 0])[0, 1]) < 0.9


def test_the_same_seed_gives_the_same_corners_and_another_others(exact):
    _, truth = exact
    errors = CornerErrors()
    first, second, third = (
        simulated_corners(LENS, TARGET, 6, seed=seed, errors=errors, poses=truth.poses)[0].pixel
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, second)
    assert np.abs(first - third).max() > 0.01


@pytest.mark.slow
def test_any_lens_serves_and_one_that_is_not_central_is_made_so(exact):
    _, truth = exact
    plain, same = simulated_corners(synthetic.TRUE_LENS, TARGET, 6, errors=EXACT)
    assert same.lens is synthetic.TRUE_LENS
    assert plain.image_size == synthetic.IMAGE_SIZE
    lens = synthetic_lens("moving-pupil")
    _, other = simulated_corners(lens, TARGET, 6, errors=EXACT, poses=truth.poses)
    assert other.lens == lens.far


@pytest.mark.slow
def test_a_fit_of_them_is_near_the_truth():
    target = synthetic.corner_of_three()
    corners, _ = simulated_corners(LENS, target, 8, errors=replace(EXACT, noise=0.05))
    fitted = calibrate(corners.with_target(target), hold_out=False)
    assert fitted.errors.rms_px == pytest.approx(0.07, rel=0.15)
