"""Magnitudes as colours, with a scale that says which."""

import numpy as np
import pytest

from cubicfish_cli.render.difference_picture import difference_picture


def test_colours_grow_lighter_with_the_magnitude_and_the_unknown_is_white():
    magnitude = np.tile(np.linspace(0, 1, 240), (40, 1))
    magnitude[0] = np.nan
    picture = difference_picture(magnitude, top=1.0)
    assert picture.dtype == np.uint8
    assert picture.shape[1] == 240
    assert (picture[0] == 255).all()
    lightness = picture[1].astype(float) @ [0.114, 0.587, 0.299]
    assert (np.diff(lightness) > -2).all()
    assert lightness[-1] - lightness[0] > 150
    above = difference_picture(magnitude + 5, top=1.0)
    assert (above[1] == picture[1, -1]).all()


def test_the_scale_below_shows_the_colours_from_none_to_the_top_and_says_it():
    magnitude = np.full((50, 480), 0.25)
    below = difference_picture(magnitude)[50:]
    full = difference_picture(np.tile(np.linspace(0, 1, 480), (1, 1)), top=1.0)
    np.testing.assert_array_equal(below[0], full[0])
    ink = (below[-10:] < 100).all(axis=-1)  # below the bar
    assert 20 < ink.sum() < 2000
    wider = difference_picture(magnitude, top=20)[50:]
    assert not np.array_equal(wider, below)


def test_nothing_known_is_drawn_too():
    assert (difference_picture(np.full((30, 300), np.nan))[:30] == 255).all()


@pytest.mark.parametrize("size", [0, 1e-12, 3e-5, 0.02, 5e7])
def test_differences_of_any_size_are_drawn(size):
    picture = difference_picture(np.full((20, 240), size))
    assert (picture[-8:] < 130).all(axis=-1).any()
    first, last = difference_picture(np.array([[0.0, 1.0]] * 8), top=1.0)[0].astype(int)
    assert np.abs(picture[0, 0] - (last if size > 1e-3 else first)).max() < 20
