"""How far two lenses differ, after the rotation between their camera frames is taken out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]

_HUBER_PX = 1.0
# A ray and the one whose pixel is nearest in the other lens say how the frames are turned; the
# farthest of such pairs come from outside the other's field and are left out in the next round.
_START_ROUNDS = 4
_START_SHARE = 0.8
# Rounds of least squares: each takes the rays that are in both fields under the last rotation.
_FIT_ROUNDS = 3


class ProjectingLens(Protocol):
    """Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""

    def project(self, points: FloatArray, /) -> FloatArray:
        """Camera-frame points (..., 3) -> pixels (..., 2)."""


def aligned_difference(
    first: ProjectingLens, second: ProjectingLens, rays: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of two lenses under the rotation that makes them smallest.

    A calibration determines the camera frame only as well as its corners do, and the poses make
    up for the rest: two calibrations of one lens may differ by a small rotation and still be the
    same camera. The rotation may also be large, such as between frames with other axes.

    Args:
        first: one lens.
        second: the other.
        rays: (N, 3) unit rays in the second lens's frame; best spread over its whole field.

    Returns:
        Differences first(R d) − second(d), (N, 2) pixels, NaN where either lens
        has no pixel; and R (3, 3).

    """
    wanted = second.project(rays)
    rotation = _start(first, rays, wanted)

    def difference(rotation: Rotation, index: npt.NDArray[np.intp]) -> FloatArray:
        return first.project(rotation.apply(rays[index])) - wanted[index]

    everyone = np.arange(len(rays))
    for _ in range(_FIT_ROUNDS):
        common = np.flatnonzero(np.isfinite(difference(rotation, everyone)).all(axis=1))
        if len(common) < 3:
            break
        step = _small_turn(difference, rotation, common)
        rotation = step * rotation
        if step.magnitude() < 1e-10:
            break
    return difference(rotation, everyone), rotation.as_matrix()


def _small_turn(
    difference: Callable[[Rotation, npt.NDArray[np.intp]], FloatArray],
    rotation: Rotation,
    common: npt.NDArray[np.intp],
) -> Rotation:
    """The turn on the left of ``rotation`` with the smallest Huber loss."""
    # Only here, since it takes a tenth of a second to load and calibrations do not come here.
    from scipy.optimize import least_squares

    def residual(vector: FloatArray) -> FloatArray:
        # A ray that leaves the field as R changes pulls neither way.
        miss = difference(Rotation.from_rotvec(vector) * rotation, common)
        return np.nan_to_num(miss).ravel()

    fit = least_squares(
        residual, np.zeros(3), loss="huber", f_scale=_HUBER_PX, xtol=1e-14, gtol=1e-12
    )
    return Rotation.from_rotvec(fit.x)


def _start(first: ProjectingLens, rays: FloatArray, wanted: FloatArray) -> Rotation:
    """Turn each ray onto that ray whose pixel in ``first`` is nearest to its own (Wahba 1965)."""
    # Rays of the whole sphere: the first lens may look along any axis of its frame.
    probes = _sphere(max(4 * len(rays), 4000))
    seen = first.project(probes)
    good = np.isfinite(seen).all(axis=1)
    pairs = np.isfinite(wanted).all(axis=1)
    if good.sum() < 3 or pairs.sum() < 3:
        return Rotation.identity()
    distance, nearest = KDTree(seen[good]).query(wanted[pairs])
    matched = probes[good][nearest]
    own = rays[pairs]
    near = distance <= np.quantile(distance, _START_SHARE)
    rotation = Rotation.identity()
    for _ in range(_START_ROUNDS):
        if near.sum() < 3:
            break
        rotation, _ = Rotation.align_vectors(matched[near], own[near])
        off = np.linalg.norm(rotation.apply(own) - matched, axis=1)
        near = off <= np.quantile(off, _START_SHARE)
    return rotation


def _sphere(count: int) -> FloatArray:
    """``count`` unit vectors spread evenly over the sphere (Fibonacci)."""
    index = np.arange(count)
    z = 1 - (2 * index + 1) / count
    azimuth = index * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], axis=-1)
