"""Magnitudes as colours, with a scale that says which."""

import numpy as np
import pytest

from cubicfish_cli.app.difference_picture import COLOURS, difference_picture


def test_each_band_has_its_colour_and_the_unknown_is_white():
    magnitude = np.tile(np.arange(10) * 0.1 + 0.05, (40, 24))
    magnitude[0] = np.nan
    picture = difference_picture(magnitude, top=1.0)
    assert picture.dtype == np.uint8
    assert (picture[0] == 255).all()
    np.testing.assert_array_equal(picture[1, :10, ::-1], COLOURS)
    above = difference_picture(magnitude + 5, top=1.0)
    assert (above[1, :10, ::-1] == COLOURS[-1]).all()


def test_colours_grow_lighter_so_that_everyone_can_order_them():
    lightness = COLOURS @ [0.299, 0.587, 0.114]
    assert (np.diff(lightness) > 12).all()


def test_the_scale_is_below_and_shows_every_colour_and_numbers():
    magnitude = np.full((50, 480), 0.25)
    picture = difference_picture(magnitude)
    below = picture[50:, :, ::-1]
    assert picture.shape[1] == 480
    for colour in COLOURS:
        assert (below == colour).all(axis=-1).sum() > 100
    ink = (below[-14:] < 100).all(axis=-1)  # below the bar
    assert 60 < ink.sum() < 2000
    wider = difference_picture(magnitude, top=20)[50:]
    assert not np.array_equal(wider, picture[50:])


def test_nothing_known_is_drawn_too():
    assert (difference_picture(np.full((30, 300), np.nan))[:30] == 255).all()


@pytest.mark.parametrize("size", [0, 1e-12, 3e-5, 0.02, 5e7])
def test_differences_of_any_size_are_drawn(size):
    picture = difference_picture(np.full((20, 240), size))
    assert (picture[-7:] < 100).all(axis=-1).any()
    wanted = COLOURS[0] if size < 1e-4 else COLOURS[-1]
    np.testing.assert_array_equal(picture[0, 0, ::-1], wanted)
