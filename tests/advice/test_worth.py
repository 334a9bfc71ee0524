"""What photos add to a camera that is not fitted yet."""

from dataclasses import replace

import numpy as np
import pytest
from simulated import simulated_corners
from synthetic import flat_board, lens_of_size

from cubicfish_cli.advice.worth import Worth, _told
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.poses import cross_matrix
from cubicfish_cli.lenses.radial import project_jacobian

LENS = lens_of_size(1.0)


@pytest.fixture(scope="module")
def pairs():
    target = flat_board()
    corners, _ = simulated_corners(LENS, target, 12, seed=5)
    return corners.with_target(target)


def even(pairs) -> dict[str, float]:
    return dict.fromkeys(pairs.images, 1.0)


def test_a_photo_taken_again_adds_less_and_all_add_something(pairs) -> None:
    worth = Worth(pairs, even(pairs))
    first = pairs.images[0]
    before = {name: worth.of(name) for name in pairs.images}
    assert min(before.values()) > worth.flat
    worth.take(first)
    assert worth.of(first) < 0.4 * before[first]
    for name in pairs.images[1:]:
        worth.take(name)
    # Each for the second time, with 12 of as much before it.
    again = [worth.of(name) for name in pairs.images]
    assert worth.flat < np.median(again) < 1 / 12


def test_what_is_seen_elsewhere_adds_more_than_what_was_seen(pairs) -> None:
    """Of two photos that are left, that adds more whose corners are where no others are."""
    middle = {
        name: pairs.pixel[pairs.image == n].mean(axis=0) for n, name in enumerate(pairs.images)
    }
    ordered = sorted(pairs.images, key=lambda name: middle[name][0])
    worth = Worth(pairs, even(pairs))
    for name in ordered[1:6]:
        worth.take(name)
    assert worth.of(ordered[-1]) > 1.5 * worth.of(ordered[0])


def test_blur_lowers_what_a_photo_adds(pairs) -> None:
    quality = even(pairs)
    quality[pairs.images[0]] = 0.1
    poor, good = Worth(pairs, quality), Worth(pairs, even(pairs))
    for name in pairs.images[1:]:
        poor.take(name)
        good.take(name)
    assert poor.of(pairs.images[0]) < 0.4 * good.of(pairs.images[0])


def test_the_unit_of_the_object_does_not_count(pairs) -> None:
    metres = replace(pairs, world=pairs.world / 1000 + [5.0, 0, 0])
    one, other = Worth(pairs, even(pairs)), Worth(metres, even(pairs))
    for name in pairs.images[:3]:
        assert other.of(name) == pytest.approx(one.of(name), rel=1e-3)


def test_photos_that_fit_no_common_lens_add_nothing(pairs) -> None:
    wrong = replace(pairs, pixel=pairs.pixel.copy())
    own = pairs.image == 3
    wrong.pixel[own] = wrong.pixel[own][np.random.default_rng(1).permutation(own.sum())]
    worth = Worth(wrong, even(pairs))
    assert worth.of(pairs.images[3]) == 0
    assert worth.of(pairs.images[4]) > 0
    random = np.random.default_rng(2).uniform(0, 700, pairs.pixel.shape)
    with pytest.raises(FitError):
        Worth(replace(pairs, pixel=random), even(pairs))


def test_what_a_pose_would_explain_tells_nothing_of_the_lens() -> None:
    points = np.random.default_rng(4).normal(size=(40, 3)) * [1, 1, 0.2] + [0, 0, 3]
    _, by_point, _ = project_jacobian(np.array([300.0, 300, 0, 0, 0, 0, 0, 0]), points)
    shift = by_point.reshape(80, 3)
    turn = (-by_point @ cross_matrix(points)).reshape(80, 3)
    other = np.random.default_rng(5).normal(size=(80, 1))
    told = _told(np.concatenate([shift, turn, other], axis=1), by_point, points)
    assert np.abs(told[:6, :6]).max() < 1e-9 * np.square(shift).sum()
    assert told[6, 6] > 0.7 * float((other**2).sum())
