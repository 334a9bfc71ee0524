"""How far two lenses differ, after the rotation between their camera frames is taken out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from cubicfish_cli.core.fit.linearise import huber_weight
from cubicfish_cli.core.lenses.sphere import all_around
from cubicfish_cli.core.types import FloatArray, IntArray

_HUBER_PX = 1.0
# A ray and the one whose pixel is nearest in the other lens say how the frames are turned; the
# farthest of such pairs come from outside the other's field and are left out in the next round.
_START_ROUNDS = 4
_START_SHARE = 0.8
# Rounds of least squares: each takes the rays that are in both fields under the last rotation.
_FIT_ROUNDS = 3
_MOST_STEPS = 50
# Radians: of the differences that stand for derivatives, of a step that hardly changes these, and
# of the last step.
_SIDE, _SAME_SLOPE, _SETTLED = 1e-5, 1e-5, 1e-9


class ProjectingLens(Protocol):
    """Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""

    def project(self, points: FloatArray, /) -> FloatArray:
        """Camera-frame points (..., 3) -> pixels (..., 2)."""


def aligned_difference(
    first: ProjectingLens, second: ProjectingLens, rays: FloatArray, *, near: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of two lenses under the rotation that makes them smallest.

    A calibration determines the camera frame only as well as its corners do, and the poses make
    up for the rest: two calibrations of one lens may differ by a small rotation and still be the
    same camera. The rotation may also be large, such as between frames with other axes.

    Args:
        first: one lens.
        second: the other.
        rays: (N, 3) unit rays in the second lens's frame; best spread over its whole field.
        near: whether the frames are nearly the same already.

    Returns:
        Differences first(R d) − second(d), (N, 2) pixels, NaN where either lens
        has no pixel; and R (3, 3).

    """
    return aligned_to_pixels(first, rays, second.project(rays), near=near)


def aligned_to_pixels(
    first: ProjectingLens, rays: FloatArray, wanted: FloatArray, *, near: bool = False
) -> tuple[FloatArray, FloatArray]:
    """:func:`aligned_difference`, of a second lens that sees the rays at pixels (N, 2)."""
    rotation = Rotation.identity() if near else _start(first, rays, wanted)

    def difference(rotation: Rotation, index: IntArray) -> FloatArray:
        return first.project(rotation.apply(rays[index])) - wanted[index]

    everyone, common = np.arange(len(rays)), np.zeros(0, np.intp)
    miss = difference(rotation, everyone)
    for _ in range(_FIT_ROUNDS):
        before, common = common, np.flatnonzero(np.isfinite(miss).all(axis=1))
        if len(common) < 3 or np.array_equal(before, common):
            break
        rotation = _small_turn(difference, rotation, common) * rotation
        miss = difference(rotation, everyone)
    return miss, rotation.as_matrix()


def _small_turn(
    difference: Callable[[Rotation, IntArray], FloatArray],
    rotation: Rotation,
    common: IntArray,
) -> Rotation:
    """The turn on the left of ``rotation`` with the smallest Huber loss.

    Gauss and Newton, with the loss's weights anew in each step.
    """

    def miss(turn: Rotation) -> FloatArray:
        return difference(turn * rotation, common).ravel()

    turn, slope = Rotation.identity(), np.empty((2 * len(common), 3))
    step = np.full(3, np.inf)
    for _ in range(_MOST_STEPS):
        now = miss(turn)
        if np.linalg.norm(step) > _SAME_SLOPE:
            for axis, side in enumerate(_SIDE * np.eye(3)):
                slope[:, axis] = (miss(Rotation.from_rotvec(side) * turn) - now) / _SIDE
        # A ray that leaves the field as R changes pulls neither way.
        seen = np.isfinite(now) & np.isfinite(slope).all(axis=1)
        weight = huber_weight(np.abs(now[seen]), _HUBER_PX)[:, None] * slope[seen]
        step = np.linalg.lstsq(slope[seen].T @ weight, -weight.T @ now[seen], rcond=None)[0]
        turn = Rotation.from_rotvec(step) * turn
        if np.linalg.norm(step) < _SETTLED:
            break
    return turn


def _start(first: ProjectingLens, rays: FloatArray, wanted: FloatArray) -> Rotation:
    """Turn each ray onto that ray whose pixel in ``first`` is nearest to its own (Wahba 1965)."""
    # Rays of the whole sphere: the first lens may look along any axis of its frame.
    probes = all_around(max(4 * len(rays), 4000))
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
