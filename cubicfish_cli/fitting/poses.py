"""Poses of the camera, one a photo: rotation matrices and translations, ``camera_from_world``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses:
    """camera_from_world of every photo: Xc = R X + t.

    Attributes:
        rotation: (M, 3, 3).
        translation: (M, 3), in the target's units.

    """

    rotation: FloatArray
    translation: FloatArray

    def __len__(self) -> int:
        return len(self.rotation)

    def __getitem__(self, index: IntArray) -> Poses:
        return Poses(rotation=self.rotation[index], translation=self.translation[index])

    def apply(self, image: IntArray, world: FloatArray) -> FloatArray:
        """World points in their photos' camera frames: (N,) photos, (N, 3) -> (N, 3)."""
        return (self.rotation[image] @ world[:, :, None])[:, :, 0] + self.translation[image]

    def moved(self, step: FloatArray) -> Poses:
        """Apply (M, 6) steps: a rotation vector on the left of R, and a shift of t."""
        return Poses(
            rotation=rotation_from_vector(step[:, :3]) @ self.rotation,
            translation=self.translation + step[:, 3:],
        )

    @property
    def rotation_vector(self) -> FloatArray:
        """(M, 3) rotation vectors, radians."""
        return vector_from_rotation(self.rotation)


def rotation_from_vector(vector: npt.ArrayLike) -> FloatArray:
    """Rotation vectors (..., 3), radians -> matrices (..., 3, 3) (Rodrigues)."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    skew = cross_matrix(vector)
    small = angle < 1e-8
    safe = np.where(small, 1, angle)
    first = np.where(small, 1, np.sin(safe) / safe)
    second = np.where(small, 0.5, 2 * np.square(np.sin(safe / 2) / safe))
    return np.eye(3) + first * skew + second * (skew @ skew)


def vector_from_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """Matrices (..., 3, 3) -> rotation vectors (..., 3), radians, of length at most π."""
    r = np.asarray(rotation, float)
    # Through the quaternion whose largest component comes first: stable at 0 and at π.
    trace = np.trace(r, axis1=-2, axis2=-1)
    squares = np.stack([1 + trace, *(1 + 2 * r[..., k, k] - trace for k in range(3))], axis=-1)
    odd = np.stack(
        [
            r[..., 2, 1] - r[..., 1, 2],
            r[..., 0, 2] - r[..., 2, 0],
            r[..., 1, 0] - r[..., 0, 1],
        ],
        axis=-1,
    )
    even = r + np.swapaxes(r, -1, -2)
    rows = [np.concatenate([squares[..., :1], odd], axis=-1)]
    for k in range(3):
        row = np.concatenate([odd[..., k : k + 1], even[..., k, :]], axis=-1)
        row[..., 1 + k] = squares[..., 1 + k]
        rows.append(row)
    choice = np.argmax(squares, axis=-1)
    quaternion = np.take_along_axis(np.stack(rows, axis=-2), choice[..., None, None], axis=-2)
    quaternion = quaternion[..., 0, :]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion = np.where(quaternion[..., :1] < 0, -quaternion, quaternion)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1)
    angle = 2 * np.arctan2(sine, quaternion[..., 0])
    factor = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1), 2.0)
    return quaternion[..., 1:] * factor[..., None]


def cross_matrix(vector: FloatArray) -> FloatArray:
    """The matrix of v ×: (..., 3) -> (..., 3, 3)."""
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = np.moveaxis(vector, -1, 0)
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix
