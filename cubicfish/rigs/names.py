"""Names of corners that all cameras of a rig agree on, where a target looks the same turned.

Each camera names such a target's corners by what it sees, so a camera that is mounted the other way
up names them the other way round. In one shot they see one thing: that tells.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.start import apart, median_pose
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import world_scale
from cubicfish.target.placement import chosen, symmetries
from cubicfish.target.target import Target
from cubicfish.types import IntArray

# Places of a camera, one per shot, from which the one is sought that the others agree with.
_SEEDS = 20
# Radians and lengths of about the target's, from which on a place is none of a camera's.
_FAR = 0.5
# Names stay where they do not make cameras stand so many times farther from one place.
_CLEARLY = 2.0


def with_agreeing_names(
    joined: JoinedViews, target: Target, scale: float, *, known: bool = False
) -> JoinedViews:
    """The same views and corners by names by which each camera stands in one place in all shots.

    Args:
        joined: the views, as each camera found and named them alone.
        target: the target, of whose boards the pairs have indices.
        scale: its units in one unit of poses and pairs.
        known: whether the cameras stand where the lens says.

    """
    motions = symmetries(target)
    if not motions:
        return joined
    lens, views, pairs = joined.lens, joined.poses, joined.pairs
    turned = [views, *(views.of_moved(one.rotation, one.shift / scale) for one in motions)]
    # Places are told apart in radians and in lengths of about the target's.
    size = 1 / world_scale(pairs)
    near = replace(lens, places=lens.places.scaled(size))
    way = _find_ways(near, [one.scaled(size) for one in turned], known=known)
    if not way.any():
        return joined
    named = chosen([pairs, *(one.named(pairs, target, scale) for one in motions)], way)
    return replace(joined, poses=Poses.chosen(turned, way), pairs=named)


def _find_ways(lens: RigLens, turned: Sequence[Poses], *, known: bool) -> IntArray:
    """(V,) which of the ways each view is named in, camera after camera."""
    cameras, shots = len(lens.lenses), int(lens.shot.max()) + 1
    common = lens.common_shots
    way = np.zeros(len(lens.camera), np.intp)
    placed = np.zeros(shots, bool)
    rigs = Poses(rotation=np.zeros((shots, 3, 3)), translation=np.zeros((shots, 3)))
    left = list(range(cameras))
    while left:
        done = [camera for camera in range(cameras) if camera not in left]
        camera = max(left, key=lambda one: (common[one, done].sum(), -one))
        left.remove(camera)
        own = np.flatnonzero(lens.camera == camera)
        both = own[placed[lens.shot[own]]]
        place = lens.places[np.array([camera])]
        if both.size:
            inverse = rigs[lens.shot[both]].inverse()
            relative = [one[both] @ inverse for one in turned]
            way[both] = _choose_way(relative, place if known else None)
            each = Poses.chosen(relative, way[both])
            place = place if known else median_pose(each)
            alike = np.unique(way[both])
            if len(alike) == 1:  # what this camera saw alone it named alike
                way[own] = alike[0]
        new = own[~placed[lens.shot[own]]]
        seen = Poses.chosen([one[new] for one in turned], way[new])
        rigs = rigs.with_photos(lens.shot[new], place.inverse() @ seen)
        placed[lens.shot[new]] = True
    return way


def _choose_way(relative: Sequence[Poses], place: Poses | None) -> IntArray:
    """(S,) the way in which a camera stands in one place, given or not, in most shots."""
    count = len(relative[0])
    if place is not None:
        tried = [place]
    else:
        seeds = np.unique(np.linspace(0, count - 1, min(count, _SEEDS)).astype(int))
        tried = [one[np.array([seed])] for one in relative for seed in seeds]
    far = [np.stack([np.minimum(apart(one, at), _FAR) for one in relative]) for at in tried]
    cost = [float(one.min(axis=0).sum()) for one in far]
    as_named = min(float(one[0].sum()) for one in far)
    best = int(np.argmin(cost))
    if as_named <= _CLEARLY * cost[best]:
        return np.zeros(count, np.intp)
    return np.asarray(far[best].argmin(axis=0))
