"""The entrance pupil that wanders: where near points are seen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import cubic_camera

from cubicfish.errors import CameraFileError
from cubicfish.io.camera_yaml import camera_text, load_camera
from cubicfish.judge.fit_record import FitRecord
from cubicfish.models.pupil import from_pupil, from_pupil_and_slopes
from cubicfish.models.sphere import ray_at

CAMERA = replace(cubic_camera(98.0), pupil_travel=3.5, units="mm")


def some_points(count: int = 40) -> np.ndarray:
    rng = np.random.default_rng(1)
    rays = ray_at(rng.uniform(0.05, 1.6, count), rng.uniform(-3, 3, count))
    return rays * rng.uniform(80, 900, count)[:, None]


def test_a_ray_enters_the_lens_where_gennery_has_it() -> None:
    """Seen from the pupil's place, (0, 0, t(θ/sin θ − 1)), and along the axis from the origin."""
    points = some_points()
    angle = np.arccos(points[:, 2] / np.linalg.norm(points, axis=1))
    place = 3.5 * (angle / np.sin(angle) - 1)
    np.testing.assert_allclose(points - from_pupil(points, 3.5), place[:, None] * [0, 0, 1])
    np.testing.assert_allclose(from_pupil(np.array([0.0, 0, 50]), 3.5), [0, 0, 50], atol=1e-9)


def test_slopes_are_those_of_the_points() -> None:
    points = some_points()
    moved, by_point, by_travel = from_pupil_and_slopes(points, 3.5)
    np.testing.assert_array_equal(moved, from_pupil(points, 3.5))
    for axis, step in enumerate(1e-4 * np.eye(3)):
        found = (from_pupil(points + step, 3.5) - from_pupil(points - step, 3.5)) / 2e-4
        expected = by_point[:, axis, None] * [0, 0, 1] + np.eye(3)[axis]
        np.testing.assert_allclose(found, expected, atol=1e-7)
    found = (from_pupil(points, 3.5 + 1e-3) - from_pupil(points, 3.5 - 1e-3))[:, 2] / 2e-3
    np.testing.assert_allclose(found, by_travel, atol=1e-7)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_the_unit_of_length_does_not_matter(scale: float, more: float) -> None:
    points = some_points()
    np.testing.assert_allclose(
        CAMERA.scaled(scale).scaled(more).project(points * (scale * more), near=True),
        CAMERA.project(points, near=True),
        atol=1e-8,
    )


def test_far_away_it_is_the_central_camera() -> None:
    points = some_points()
    seen, far = CAMERA.project(points, near=True), CAMERA.project(points)
    out, farther_out = (
        np.linalg.norm(one - CAMERA.project([0, 0, 1.0]), axis=1) for one in (far, seen)
    )
    inside = np.isfinite(out + farther_out)
    assert (farther_out > out)[inside].all()
    np.testing.assert_allclose(CAMERA.project(1e9 * points, near=True), far, atol=1e-4)
    np.testing.assert_array_equal(CAMERA.project(2 * points), far)


def test_the_jacobian_is_the_slope_of_near_points() -> None:
    points = some_points()
    pixel, slope = CAMERA.project_jacobian(points, near=True)
    np.testing.assert_array_equal(pixel, CAMERA.project(points, near=True))
    for axis, step in enumerate(1e-3 * np.eye(3)):
        up, down = (CAMERA.project(points + sign * step, near=True) for sign in (1, -1))
        np.testing.assert_allclose((up - down) / 2e-3, slope[..., axis], atol=1e-6)


def test_points_of_any_length_are_seen_or_are_not() -> None:
    ray = np.array([0.6, -0.3, 0.5])
    far = CAMERA.project(ray)
    for length in (1e10, 1e100, 1e200, 1e307):
        np.testing.assert_allclose(CAMERA.project(length * ray, near=True), far, atol=1e-6)
    none = [[0.0, 0, 0], [np.nan, 1, 1], [np.inf, 1, 1], [0, 0, -5]]
    assert np.isnan(CAMERA.project(none, near=True)).all()
    assert np.isnan(CAMERA.project_jacobian(none, near=True)[1]).all()


@pytest.mark.parametrize(
    ("units", "travel"), [("mm", 3.5), ("cm", 0.35), ("m", 0.0035), ("squares", 0.0), (None, 3.5)]
)
def test_it_follows_the_targets_units_where_these_are_known(units, travel) -> None:
    assert CAMERA.in_units(units).pupil_travel == pytest.approx(travel)


def test_the_file_keeps_it(tmp_path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(camera_text(CAMERA, fit=FitRecord(), made_by={}))
    loaded = load_camera(file).camera
    assert (loaded.pupil_travel, loaded.units) == (3.5, "mm")
    text = file.read_text()
    for wrong, what in (("many", "pupil.travel must be a number"), (".inf", "pupil.travel must")):
        file.write_text(text.replace("travel: 3.5", f"travel: {wrong}"))
        with pytest.raises(CameraFileError, match=what):
            load_camera(file)
    file.write_text(text.replace("units: mm", "units: 3"))
    with pytest.raises(CameraFileError, match=r"pupil\.units must be a word"):
        load_camera(file)
