"""Photos of several cameras as the views of one body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.rig_lens import RigLens
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import IntArray
from cubicfish_cli.extensions.rigs.fit.clocks import Moving
from cubicfish_cli.extensions.rigs.fit.shots import Shots


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A camera whose photos are placed.

    Attributes:
        lens: its lens.
        pairs: of its photos.
        poses: camera_from_world of each photo.

    """

    lens: FitLens
    pairs: Observations
    poses: Poses


def unplaced(camera: str) -> FitError:
    """What is raised where no photo of a camera can be placed."""
    return FitError(
        f"camera {camera}: none of its photos can be placed with its lens: check that they are of "
        "this camera and of this target"
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """What is seen in each view.

    Attributes:
        photo: of each view, its camera's photo.
        shot: of each shot, its name.

    """

    photo: tuple[str, ...]
    shot: tuple[str, ...]


def gathered(
    alone: Sequence[Placed],
    shots: Shots,
    moving: Sequence[tuple[Observations, Moving] | None],
) -> tuple[RigLens, Poses, Observations, Seen, Moving | None]:
    """All cameras' photos as the views of one rig, sorted by camera.

    Args:
        alone: each camera by itself, all in one scale.
        shots: which photos are of one shot.
        moving: of each camera how its corners move, and the pairs of these; None where not known.

    Returns:
        Lenses, with all cameras in one place; camera_from_world of each view; the pairs of all,
        as of their shots' moments; names; how the corners move.

    """
    parts, own_views, moves = [], [], []
    camera: list[int] = []
    shot: list[int] = []
    photo: list[str] = []
    for number, (given, one, of_shot) in enumerate(zip(moving, alone, shots.photos, strict=True)):
        listed = np.array([name in of_shot for name in one.pairs.images])
        own, kept = select(one.pairs, listed[one.pairs.image])
        moves.append(Moving.still(len(own.pixel)) if given is None else given[1].of(given[0], own))
        parts.append(own)
        camera += [number] * len(kept)
        shot += [of_shot[name] for name in own.images]
        photo += own.images
        own_views.append(one.poses[kept])
    used, index = np.unique(shot, return_inverse=True)
    lens = RigLens(
        lenses=tuple(one.lens for one in alone),
        places=Poses(
            rotation=np.repeat(np.eye(3)[None], len(alone), axis=0),
            translation=np.zeros((len(alone), 3)),
        ),
        camera=np.array(camera, np.intp),
        shot=index.astype(np.intp),
    )
    width, height = np.max([part.image_size for part in parts], axis=0).tolist()
    pairs = replace(Observations.joined(parts), image_size=(width, height))
    names = tuple(shots.names[number] for number in used)
    known = None
    if any(given is not None for given in moving):
        known = Moving.joined(moves)
        pairs = replace(pairs, pixel=known.at_once(pairs.pixel, known.late))
    return lens, Poses.joined(own_views), pairs, Seen(photo=tuple(photo), shot=names), known


def set_apart(
    lens: RigLens, shots: Poses, views: Poses, seen: Seen, apart: IntArray
) -> tuple[RigLens, Poses, Seen]:
    """Views that do not go with their shots get shots of their own: they say nothing of places.

    Args:
        lens: the lenses and places of the rig.
        shots: rig_from_world of each shot.
        views: camera_from_world of each view.
        seen: names.
        apart: (A,) which views.

    Returns:
        The same of the new shots.

    """
    if not apart.size:
        return lens, shots, seen
    shot = lens.shot.copy()
    shot[apart] = len(shots) + np.arange(len(apart))
    own = lens.places[lens.camera[apart]].inverse() @ views[apart]
    poses = Poses.joined([shots, own])
    names = (*seen.shot, *(f"{seen.shot[lens.shot[view]]} ({seen.photo[view]})" for view in apart))
    # A shot may be left without any view.
    used, shot = np.unique(shot, return_inverse=True)
    lens = replace(lens, shot=shot.astype(np.intp))
    return lens, poses[used], replace(seen, shot=tuple(names[number] for number in used))
