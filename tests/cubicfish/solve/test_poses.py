"""Rotation vectors of matrices, up to half a turn."""

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish.solve.poses import rotation_from_vector, vector_from_rotation


def test_a_rotation_vector_comes_back():
    rng = np.random.default_rng(1)
    axis = rng.normal(size=(3000, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    near_half = np.pi - 10 ** -rng.uniform(1, 12, 1000)
    angle = [rng.uniform(0, np.pi, 1000), 10 ** -rng.uniform(1, 12, 1000), near_half]
    vector = axis * np.concatenate(angle)[:, None]
    np.testing.assert_allclose(
        vector_from_rotation(rotation_from_vector(vector)), vector, atol=1e-9
    )
    matrix = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(vector_from_rotation(matrix), vector, atol=1e-14)


def test_no_turn_and_half_turns():
    turns = np.array([np.eye(3), *(2 * np.outer(axis, axis) - np.eye(3) for axis in np.eye(3))])
    wanted = np.pi * np.vstack([np.zeros((1, 3)), np.eye(3)])
    np.testing.assert_allclose(vector_from_rotation(turns), wanted, atol=1e-15)
    assert vector_from_rotation(np.zeros((0, 3, 3))).shape == (0, 3)
