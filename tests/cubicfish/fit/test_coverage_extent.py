"""The rim: how far corners reach around it, what is off there, and where trust ends."""

from dataclasses import replace

import numpy as np
import pytest
from lenses import cubic_camera

from cubicfish.fit.coverage import certain_angle_deg, coverage_extent, trusted_angle_deg
from cubicfish.judge.uncertainty import end_px
from cubicfish.models.sphere import ray_at

CAMERA = cubic_camera(100.0, bend=0.002)  # a photo that shows all of the cone


def corners(*fields: tuple[float, float, float]) -> np.ndarray:
    """Points at angles up to a first number, degrees, in directions from a second to a third."""
    parts = []
    for upto, start, stop in fields:
        theta, around = np.meshgrid(np.arange(1.0, upto + 0.5), np.arange(start, stop, 5.0))
        parts.append(ray_at(np.radians(theta.ravel()), np.radians(around.ravel())))
    return 3.0 * np.concatenate(parts)


def known(rays: np.ndarray) -> np.ndarray:
    return np.full(len(rays), 0.02)


def looked(points: np.ndarray, residual: np.ndarray | None = None):
    return coverage_extent(
        CAMERA, points, np.zeros((len(points), 2)) if residual is None else residual, known
    )


def test_corners_all_around_reach_the_rim():
    found = looked(corners((90.0, 0.0, 360.0)))
    assert found.rim_coverage == 1
    assert found.all_around_deg == pytest.approx(90, abs=1.5)
    assert found.extrapolated_deg == pytest.approx(CAMERA.max_angle_deg - 90, abs=0.6)
    assert found.edge_uncertainty_px == pytest.approx(0.02)


def test_an_empty_side_of_the_rim_is_no_full_coverage():
    found = looked(corners((90.0, 0.0, 180.0), (55.0, 180.0, 360.0)))
    assert 0.4 < found.rim_coverage < 0.65
    assert found.all_around_deg == pytest.approx(58, abs=4)


def test_what_the_photo_does_not_show_is_not_missed():
    narrow = cubic_camera(100.0, bend=0.002)
    width, height = narrow.image_size
    cropped = type(narrow)(
        image_size=(width, height // 2), P=narrow.P, max_angle_deg=100.0, radial=narrow.radial
    )
    pixel = cropped.project(points := corners((90.0, 0.0, 360.0)))
    seen = (pixel >= -0.5).all(axis=1) & (pixel[:, 1] < height // 2) & (pixel[:, 0] < width)
    found = coverage_extent(cropped, points[seen], np.zeros((seen.sum(), 2)), known)
    assert found.rim_coverage > 0.9


def test_errors_at_the_rim_are_told_from_those_in_the_middle():
    points = corners((90.0, 0.0, 360.0))
    angle = np.degrees(np.arctan2(np.hypot(*points.T[:2]), points[:, 2]))
    residual = np.where(angle[:, None] > 80, [0.3, 0.0], [0.0, 0.06])
    found = looked(points, residual)
    assert found.rim_rms_px == pytest.approx(0.3)
    assert found.middle_rms_px == pytest.approx(0.06)
    assert 80 < found.rim_from_deg < 90
    few = looked(points[:10], residual[:10])
    assert np.isnan([few.rim_rms_px, few.middle_rms_px, few.rim_from_deg]).all()


def test_trust_ends_where_the_camera_is_no_longer_certain():
    def growing(rays: np.ndarray) -> np.ndarray:
        theta = np.degrees(np.arccos(np.clip(rays[:, 2], -1, 1)))
        return 0.1 + np.maximum(theta - 90, 0) ** 2 / 10

    def blurred(rays: np.ndarray) -> np.ndarray:
        return 5 * growing(rays)

    whole = CAMERA.max_angle_deg
    assert trusted_angle_deg(CAMERA, 90.0, known) == whole
    assert trusted_angle_deg(CAMERA, 90.0, growing) == pytest.approx(92, abs=0.3)
    # What is uncertain all over ends where that doubles, and a little beyond the corners always.
    assert trusted_angle_deg(CAMERA, 90.0, blurred) == pytest.approx(91, abs=0.3)
    assert trusted_angle_deg(CAMERA, 90.0, lambda rays: 9.0 * known(rays)) == whole
    assert trusted_angle_deg(CAMERA, whole - 0.2, growing) <= whole


def test_the_field_ends_where_its_rim_is_uncertain_by_a_pixel():
    def growing(rays: np.ndarray) -> np.ndarray:
        return 0.01 * np.degrees(np.arccos(np.clip(rays[:, 2], -1, 1))) + 0.35

    def mirrored(rays: np.ndarray) -> np.ndarray:
        return np.where(rays[:, 2] > np.cos(np.radians(20)), 30.0, growing(rays))

    assert certain_angle_deg(CAMERA, growing, 1.0) == pytest.approx(65, abs=0.3)
    # In the middle of a mirror's picture nothing is certain, and the field is not there at fault.
    assert certain_angle_deg(CAMERA, mirrored, 1.0) == pytest.approx(65, abs=0.3)
    assert certain_angle_deg(CAMERA, known, 1.0) == CAMERA.max_angle_deg
    assert certain_angle_deg(CAMERA, growing, 1.15) == pytest.approx(80, abs=0.3)


@pytest.mark.parametrize(
    ("size", "goal_px", "expected"),
    [((640, 480), None, 1), ((640, 480), 0.1, 1), ((640, 480), 3, 3), ((4000, 90), 1.5, 2)],
)
def test_a_goal_does_not_end_a_field_before_the_usual_pixel(size, goal_px, expected):
    assert end_px(size, goal_px) == expected


def test_sides_that_a_photo_does_not_show_do_not_end_its_field():
    width, height = CAMERA.image_size
    shown = replace(CAMERA, image_size=(width, height // 2 + 1))

    def uncertain_below(rays: np.ndarray) -> np.ndarray:
        aside = np.degrees(np.arctan2(rays[:, 1], np.abs(rays[:, 0])))
        return np.where((aside > -10) & (rays[:, 2] < 0.5), 9.0, 0.1)

    assert certain_angle_deg(CAMERA, uncertain_below, 1.0) == pytest.approx(60, abs=0.3)
    assert certain_angle_deg(shown, uncertain_below, 1.0) == CAMERA.max_angle_deg
