"""A plane's picture: its points where they belong, from its front only."""

import numpy as np
import pytest
from lenses import cubic_camera

from cubicfish import Target, ViewError, build_map, build_plane
from cubicfish.target.boards.types import Checkerboard

CAMERA = cubic_camera(100.0)
ORIGIN = np.array([-30.0, -20.0, 60.0])
TILT = np.radians(35)
X, Y = np.array([np.cos(TILT), 0, np.sin(TILT)]), np.array([0.0, 1, 0])


def made(origin=ORIGIN, x_axis=X, y_axis=Y, **options):
    """A board of corners 10 apart over 60 x 40, the first of them 5 before the origin along x."""
    pose = np.eye(3), np.zeros(3)
    places = {"x_axis": tuple(x_axis.tolist()), "y_axis": tuple(y_axis.tolist())}
    first = tuple((np.asarray(origin) - 5 * x_axis).tolist())
    board = Checkerboard(name="b", columns=7, rows=5, square=10.0, origin=first, **places)
    target = Target(units="mm", boards=(board,))
    return build_plane(CAMERA, target, "b", *pose, margin=0.0, **options)


def test_a_pixel_is_a_point_of_the_plane_at_the_scale():
    view = made(pixels_per_unit=4.0)
    assert view.size == (240, 160)
    # The middle of the first pixel is half a pixel inside the rectangle's corner.
    np.testing.assert_allclose(view.rays([0, 0]), ORIGIN + (-5 + 0.125) * X + 0.125 * Y)
    np.testing.assert_allclose(view.rays([239.5, 159.5]), ORIGIN + 55 * X + 40 * Y, atol=1e-9)
    result = build_map(CAMERA, view)
    expected = CAMERA.project(view.rays([100, 50]))
    np.testing.assert_allclose([result.map_x[50, 100], result.map_y[50, 100]], expected, atol=1e-4)


def test_the_default_scale_is_the_photos_largest():
    view = made()
    result = build_map(CAMERA, view)
    steps = [
        np.gradient(m.astype(float), axis=a) for a in (0, 1) for m in (result.map_x, result.map_y)
    ]
    down, across = np.hypot(*steps[:2]), np.hypot(*steps[2:])
    largest = max(down[result.valid].max(), across[result.valid].max())
    assert largest == pytest.approx(1, abs=0.08)


def test_from_behind_there_is_no_picture():
    with pytest.raises(ViewError, match="behind this plane"):
        made(x_axis=-X)
    with pytest.raises(ViewError, match="behind this plane"):
        made(x_axis=Y, y_axis=X)


def test_a_plane_that_is_not_seen_is_refused():
    with pytest.raises(ViewError, match="does not see this plane"):
        made(origin=np.array([0.0, 0, -500]))
