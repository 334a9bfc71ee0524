"""Maths that several parts share."""

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish.geometry import (
    inside_polygon,
    kannala_brandt,
    kannala_brandt_slope,
    mean_rotation,
    nearest_rotation,
    similarity,
)


def test_the_similarity_between_points_is_found_and_never_a_mirror():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20, 3))
    turn = 2.5 * Rotation.random(random_state=rng).as_matrix()
    found = similarity(points, points @ turn.T + [1, 2, 3])
    np.testing.assert_allclose(found.scale * found.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(found.shift, [1, 2, 3], atol=1e-12)
    assert np.linalg.det(similarity(points, points * [1, 1, -1]).rotation) > 0
    found = similarity(points, 3 * points, scaled=False)
    assert found.scale == 1
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-12)


def test_what_is_left_by_a_similarity_is_reported():
    points = np.random.default_rng(2).normal(size=(50, 3))
    moved = points + np.array([5.0, 0, 0])
    moved[7] += [0, 0.3, 0]
    found = similarity(points, moved)
    assert 0.2 < found.error < 0.3
    np.testing.assert_allclose(
        np.linalg.norm(found(points) - moved, axis=1).max(), found.error, rtol=1e-12
    )


def test_the_nearest_rotation_is_no_mirror():
    rng = np.random.default_rng(3)
    turns = Rotation.random(6, random_state=rng).as_matrix()
    stretched = turns @ (np.eye(3) + 0.01 * np.diag([1.0, -1, 2]))
    found = nearest_rotation(stretched)
    np.testing.assert_allclose(found, turns, atol=0.02)
    mirrored = nearest_rotation(turns @ np.diag([1.0, 1.0, -0.5]))
    np.testing.assert_allclose(np.linalg.det(mirrored), 1, atol=1e-12)


def test_a_mean_rotation_lies_between_by_weight():
    turns = Rotation.from_rotvec([[0, 0, 0.2], [0, 0, -0.2]]).as_matrix()
    np.testing.assert_allclose(mean_rotation(turns, np.ones(2)), np.eye(3), atol=1e-12)
    angle = Rotation.from_matrix(mean_rotation(turns, np.array([3.0, 1.0]))).as_rotvec()[2]
    assert 0.08 < angle < 0.12


def test_points_are_inside_a_polygon_or_not():
    corner = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4.0]])
    x, y = np.random.default_rng(4).uniform(-1, 5, (2, 10_000))
    points = np.stack([x, y], axis=-1)
    points[5000] = np.nan
    right = (x > 0) & (y > 0) & (x < 4) & (y < 4) & ((x < 1) | (y < 1))
    right[5000] = False
    np.testing.assert_array_equal(inside_polygon(points, corner), right)
    np.testing.assert_array_equal(inside_polygon(points, corner[::-1]), right)


def test_the_slope_is_that_of_the_profile():
    k, theta, step = [-0.02, 0.004, -0.0007, 5e-5], np.linspace(0.01, 1.9, 40), 1e-6
    rise = kannala_brandt(theta + step, k) - kannala_brandt(theta - step, k)
    np.testing.assert_allclose(kannala_brandt_slope(theta, k), rise / (2 * step), rtol=1e-8)
