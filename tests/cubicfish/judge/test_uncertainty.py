"""The uncertainty on record, between the points of its grid."""

import numpy as np

from cubicfish.judge.uncertainty import UncertaintyGrid

GRID = UncertaintyGrid(
    x=(0.0, 10.0, 30.0), y=(5.0, 25.0), sigma_px=((1.0, 2.0, np.nan), (3.0, 4.0, 6.0))
)


def test_it_is_interpolated_between_the_known_points_around() -> None:
    pixel = np.array([[0, 5], [5, 5], [5, 15], [20, 25], [-9, 99], [20, 5], [30, 5], [30, 15.0]])
    found = GRID.at(pixel)
    # Beyond the grid it is as at its edge; beside an unknown point the others count.
    np.testing.assert_allclose(found, [1, 1.5, 2.5, 5, 3, 2, np.nan, 6], atol=1e-12)
    assert UncertaintyGrid().at(pixel) is None


def test_columns_and_rows_are_the_same_as_their_pixels() -> None:
    x, y = np.linspace(-3, 33, 41), np.linspace(0, 30, 29)
    pixel = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    single, grid = GRID.at(pixel), GRID.over_grid(x, y)
    assert single is not None
    assert grid is not None
    np.testing.assert_allclose(grid.ravel(), single, atol=1e-12)
    assert np.isfinite(grid).mean() > 0.9
    assert UncertaintyGrid().over_grid(x, y) is None
