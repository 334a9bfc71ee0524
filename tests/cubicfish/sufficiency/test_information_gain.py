"""What photos add to a camera that is not fitted yet."""

from dataclasses import replace

import numpy as np
import pytest
from simulated import simulated_corners
from synthetic import flat_board, lens_of_size, poses_around

from cubicfish import FitError
from cubicfish.models.radial import project_jacobian
from cubicfish.solve.poses import cross_matrix
from cubicfish.sufficiency import InformationGain
from cubicfish.sufficiency.information_gain import _compute_information

LENS = lens_of_size(1.0)


@pytest.fixture(scope="module")
def pairs():
    target = flat_board()
    poses = tuple(poses_around(target, 12, seed=5))
    corners, _ = simulated_corners(LENS, target, 12, seed=5, poses=poses)
    return corners.with_target(target)


def information_gain(pairs, quality=1.0) -> InformationGain:
    """By the places of the photos among those that have corners."""
    return InformationGain(pairs, pairs.images, np.broadcast_to(quality, len(pairs.images)))


def test_a_photo_taken_again_adds_less_and_all_add_something(pairs) -> None:
    gain, photos = information_gain(pairs), range(len(pairs.images))
    before = [gain.of(photo) for photo in photos]
    assert min(before) > 0.01
    gain.take(0)
    assert gain.of(0) < 0.4 * before[0]
    for photo in photos[1:]:
        gain.take(photo)
    # Each for the second time, with 12 of as much before it.
    again = [gain.of(photo) for photo in photos]
    assert 0.01 < np.median(again) < 1 / 12


def test_what_is_wanted_is_the_goal_of_uncertainty(pairs) -> None:
    """Above it counts by how many pixels uncertainty falls, below how much information there is."""
    gain = information_gain(pairs)
    for photo in range(len(pairs.images)):
        gain.take(photo)
    sigma, fallen = np.exp(gain._now / 2), np.exp(-0.02)
    gain._goal = sigma / 4
    assert gain.share(0.02) == pytest.approx(4 * (1 - fallen))
    gain._goal = 4 * sigma
    assert gain.share(0.02) == pytest.approx(16 * (fallen**-2 - 1) / 2)
    gain._goal = sigma
    assert gain.share(0.02) == pytest.approx(0.02, rel=0.05)
    assert gain.share(0.0) == 0


def test_what_is_seen_elsewhere_adds_more_than_what_was_seen(pairs) -> None:
    """Of two photos that are left, that adds more whose corners are where no others are."""
    middle = [pairs.pixel[pairs.image == n, 0].mean() for n in range(len(pairs.images))]
    ordered = np.argsort(middle).tolist()
    gain = information_gain(pairs)
    for photo in ordered[1:6]:
        gain.take(photo)
    assert gain.of(ordered[-1]) > 1.5 * gain.of(ordered[0])


def test_blur_lowers_what_a_photo_adds(pairs) -> None:
    quality = np.ones(len(pairs.images))
    quality[0] = 0.1
    poor, good = information_gain(pairs, quality), information_gain(pairs)
    for photo in range(1, len(pairs.images)):
        poor.take(photo)
        good.take(photo)
    assert poor.of(0) < 0.4 * good.of(0)


def test_the_unit_of_the_object_does_not_count(pairs) -> None:
    metres = replace(pairs, world=pairs.world / 1000 + [5.0, 0, 0])
    one, other = information_gain(pairs), information_gain(metres)
    for photo in range(3):
        assert other.of(photo) == pytest.approx(one.of(photo), rel=1e-3)


def test_photos_that_fit_no_common_lens_add_nothing(pairs) -> None:
    wrong = replace(pairs, pixel=pairs.pixel.copy())
    own = pairs.image == 3
    wrong.pixel[own] = wrong.pixel[own][np.random.default_rng(1).permutation(own.sum())]
    gain = information_gain(wrong)
    assert gain.of(3) == 0
    assert gain.of(4) > 0
    random = np.random.default_rng(2).uniform(0, 700, pairs.pixel.shape)
    with pytest.raises(FitError):
        information_gain(replace(pairs, pixel=random))


def test_what_a_pose_would_explain_tells_nothing_of_the_lens() -> None:
    points = np.random.default_rng(4).normal(size=(40, 3)) * [1, 1, 0.2] + [0, 0, 3]
    _, by_point, _ = project_jacobian(np.array([300.0, 300, 0, 0, 0, 0, 0, 0]), points)
    shift = by_point.reshape(80, 3)
    turn = (-by_point @ cross_matrix(points)).reshape(80, 3)
    other = np.random.default_rng(5).normal(size=(80, 1))
    information = _compute_information(
        np.concatenate([shift, turn, other], axis=1), by_point, points
    )
    assert np.abs(information[:6, :6]).max() < 1e-9 * np.square(shift).sum()
    assert information[6, 6] > 0.7 * float((other**2).sum())
