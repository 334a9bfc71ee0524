"""Poses of the camera, one per photo: rotation matrices and translations, ``camera_from_world``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray, IntArray
from cubicfish.wording import Brief


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Poses(Brief):
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

    def with_photos(self, photos: IntArray, poses: Poses) -> Poses:
        """The same poses with those of some photos replaced."""
        rotation, translation = self.rotation.copy(), self.translation.copy()
        rotation[photos], translation[photos] = poses.rotation, poses.translation
        return Poses(rotation=rotation, translation=translation)

    def apply(self, image: IntArray, world: FloatArray) -> FloatArray:
        """World points in their photos' camera frames: (N,) photos, (N, 3) -> (N, 3)."""
        return (self.rotation[image] @ world[:, :, None])[:, :, 0] + self.translation[image]

    def moved(self, step: FloatArray) -> Poses:
        """Apply (M, 6) steps: a rotation vector on the left of R, and a shift of t."""
        return Poses(
            rotation=rotation_from_vector(step[:, :3]) @ self.rotation,
            translation=self.translation + step[:, 3:],
        )

    def __matmul__(self, other: Poses) -> Poses:
        """Compose with other poses, which act first: one by one, or one of either with each."""
        return Poses(
            rotation=self.rotation @ other.rotation,
            translation=(self.rotation @ other.translation[:, :, None])[:, :, 0] + self.translation,
        )

    def inverse(self) -> Poses:
        """The inverse poses."""
        turned = self.rotation.transpose(0, 2, 1)
        return Poses(rotation=turned, translation=-(turned @ self.translation[:, :, None])[:, :, 0])

    def scaled(self, factor: float) -> Poses:
        """The same poses in a unit of length, of which ``factor`` are one of theirs."""
        return Poses(rotation=self.rotation, translation=self.translation * factor)

    @classmethod
    def of_photos(
        cls, known: Mapping[str, tuple[FloatArray, FloatArray]], names: Sequence[str]
    ) -> Poses | None:
        """The poses of some photos; None where one is not known.

        Args:
            known: rotation vectors (3,) in radians and translations (3,) by photo, as
                :attr:`~cubicfish.judge.fit_record.FitRecord.poses` has them.
            names: of the photos.

        """
        if not names or any(name not in known for name in names):
            return None
        vectors, shifts = zip(*(known[name] for name in names), strict=True)
        return cls(rotation=rotation_from_vector(vectors), translation=np.array(shifts))

    @classmethod
    def joined(cls, parts: Sequence[Poses]) -> Poses:
        """All poses of some parts, one after the other."""
        return cls(
            rotation=np.concatenate([part.rotation for part in parts]),
            translation=np.concatenate([part.translation for part in parts]),
        )

    @classmethod
    def chosen(cls, ways: Sequence[Poses], way: IntArray) -> Poses:
        """For each photo the pose of one of W ``ways``: ``way`` (M,) is the index, below W."""
        every = np.arange(len(way))
        return cls(
            rotation=np.stack([one.rotation for one in ways])[way, every],
            translation=np.stack([one.translation for one in ways])[way, every],
        )

    def of_world(self, origin: FloatArray) -> Poses:
        """The same poses for a world in which their own world's origin is at ``origin`` (3,)."""
        return Poses(rotation=self.rotation, translation=self.translation - self.rotation @ origin)

    def of_moved(self, rotation: FloatArray, shift: FloatArray) -> Poses:
        """The same views of a world whose points a motion, (3, 3) and (3,), has moved."""
        turned = self.rotation @ rotation.T
        return Poses(rotation=turned, translation=self.translation - turned @ shift)

    @property
    def rotation_vector(self) -> FloatArray:
        """(M, 3) rotation vectors, radians."""
        return vector_from_rotation(self.rotation)


def rotation_from_vector(vector: npt.ArrayLike) -> FloatArray:
    """Rotation vectors (..., 3), radians -> matrices (..., 3, 3)."""
    vector = np.asarray(vector, float)
    if not len(vector):
        return np.zeros((0, 3, 3))
    turns = np.linalg.norm(vector, axis=-1)[..., None, None] / np.pi
    cross = cross_matrix(vector)
    # Rodrigues: 1 + sin a / a [v]x + (1 - cos a) / a^2 [v]x [v]x
    return np.eye(3) + np.sinc(turns) * cross + 0.5 * np.sinc(0.5 * turns) ** 2 * (cross @ cross)


def vector_from_rotation(rotation: FloatArray) -> FloatArray:
    """Rotation matrices (M, 3, 3) -> rotation vectors (M, 3), radians, no longer than π."""
    # Four times the products of a unit quaternion's numbers (w, x, y, z): any of its rows is a
    # multiple of it, and the one with the largest diagonal the most exact (Shepperd 1978).
    products = np.empty((len(rotation), 4, 4))
    trace = np.trace(rotation, axis1=1, axis2=2)
    turned = rotation.transpose(0, 2, 1)
    products[:, 1:, 1:] = rotation + turned + (1 - trace)[:, None, None] * np.eye(3)
    products[:, 0, 0] = 1 + trace
    odd = (rotation - turned)[:, [2, 0, 1], [1, 2, 0]]
    products[:, 0, 1:] = products[:, 1:, 0] = odd
    largest = np.diagonal(products, axis1=1, axis2=2).argmax(axis=1)
    quaternion = products[np.arange(len(rotation)), largest]
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    quaternion *= np.where(quaternion[:, :1] < 0, -1.0, 1.0)
    half = np.arctan2(np.linalg.norm(quaternion[:, 1:], axis=1), quaternion[:, 0])
    # The vector part is the axis times sin(half).
    return np.asarray(2 * quaternion[:, 1:] / np.sinc(half / np.pi)[:, None])


def cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross products (..., 3, N) of vectors (3, N) and (..., 3, N)."""
    after, before = [1, 2, 0], [2, 0, 1]
    product: FloatArray = first[after] * second[..., before, :]
    product -= first[before] * second[..., after, :]
    return product


def cross_matrix(vector: FloatArray) -> FloatArray:
    """The matrix of v ×: (..., 3) -> (..., 3, 3)."""
    matrix = np.zeros((*vector.shape, 3))
    for row, column, axis in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        matrix[..., row, column] = vector[..., axis]
        matrix[..., column, row] = -vector[..., axis]
    return matrix
