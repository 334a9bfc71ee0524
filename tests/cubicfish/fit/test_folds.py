"""Which photos are left out together."""

import numpy as np
import pytest

from cubicfish.files.frame_names import FrameName
from cubicfish.fit.folds import dealt


def frames(film, *seconds):
    return [f"{FrameName(film, second)}.png" for second in seconds]


def test_frames_are_left_out_in_blocks_of_time():
    images = frames("walk", *range(20))
    part = dealt(np.arange(20), images, 5)
    np.testing.assert_array_equal(part, np.repeat(np.arange(5), 4))


def test_blocks_follow_time_and_not_the_order_given():
    order = np.random.default_rng(0).permutation(20)
    images = frames("walk", *order)
    np.testing.assert_array_equal(dealt(np.arange(20), images, 5), order // 4)


def test_a_block_lies_within_a_film_before_the_next_begins():
    images = frames("a", *range(10)) + frames("b", *range(10))
    np.testing.assert_array_equal(dealt(np.arange(20), images, 2), np.repeat([0, 1], 10))


def test_photos_are_dealt_out_in_turn():
    images = [f"{number:02d}.jpg" for number in range(12)]
    np.testing.assert_array_equal(dealt(np.arange(12), images, 5), np.arange(12) % 5)


def test_repeats_stay_together():
    images = [f"{number}.jpg" for number in range(6)]
    part = dealt(np.array([0, 1, 0, 2, 1, 3]), images, 2)
    assert part[0] == part[2]
    assert part[1] == part[4]


@pytest.mark.parametrize("seed", range(20))
def test_no_part_takes_many_more_than_its_share(seed):
    rng = np.random.default_rng(seed)
    films, photos = rng.integers(0, 20, 2)
    images = frames("f", *rng.random(films) * 60) + [f"{n}.png" for n in range(photos + 5)]
    part = dealt(np.arange(len(images)), images, 5)
    assert np.ptp(np.bincount(part, minlength=5)) <= 2


@pytest.mark.parametrize("seconds", [0, 0.001, 59.9994, 3599, 123456.789])
def test_a_frame_keeps_its_film_and_time(seconds):
    film, time = FrameName.read(f"{FrameName('my_film_2', seconds)}.png")
    assert film == "my_film_2"
    assert time == pytest.approx(seconds, abs=6e-4)


def test_a_frame_of_the_same_millisecond_is_one_too():
    assert FrameName.read(f"{FrameName('f', 1)}_17.png") == ("f", 1.0)


@pytest.mark.parametrize("name", ["IMG_0012.jpg", "f_12.5s.png", "_s.png", "000001.000s.png"])
def test_other_names_are_photos(name):
    assert FrameName.read(name) is None
