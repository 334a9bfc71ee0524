"""Photos of several cameras as the views of one body, and what its fit knows of the set-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from cubicfish_cli.fitting.adjustment import Adjustment, huber_weight, linearised
from cubicfish_cli.fitting.evidence import Evidence
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.rig.clocks import Clocks, Moving
from cubicfish_cli.fitting.rig.shots import Shots
from cubicfish_cli.fitting.rig.start import RigStart
from cubicfish_cli.fitting.rig_lens import RigLens
from cubicfish_cli.fitting.robust import huber_px
from cubicfish_cli.fitting.subset import select
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray


class OneCamera(Protocol):
    """A camera whose photos are placed."""

    @property
    def lens(self) -> FitLens:
        """Its lens."""

    @property
    def pairs(self) -> Observations:
        """Of its photos."""

    @property
    def poses(self) -> Poses:
        """camera_from_world of each photo."""


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
    alone: Sequence[OneCamera],
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


def without_strays(
    lens: RigLens, start: RigStart, views: Poses, seen: Seen
) -> tuple[RigLens, Poses, Seen]:
    """Views that are of another shot than they are said to be get a shot of their own."""
    lens = replace(lens, places=start.places)
    stray = np.flatnonzero(start.apart)
    if not stray.size:
        return lens, start.shots, seen
    shot = lens.shot.copy()
    shot[stray] = len(start.shots) + np.arange(len(stray))
    own = start.places[lens.camera[stray]].inverse() @ views[stray]
    poses = Poses.joined([start.shots, own])
    names = (*seen.shot, *(f"{seen.shot[lens.shot[view]]} ({seen.photo[view]})" for view in stray))
    # A shot may be left without any view.
    used, shot = np.unique(shot, return_inverse=True)
    lens = replace(lens, shot=shot.astype(np.intp))
    return lens, poses[used], replace(seen, shot=tuple(names[number] for number in used))


@dataclass(frozen=True, kw_only=True, eq=False)
class RigEvidence(Evidence):
    """A fitted rig.

    Attributes:
        names: of the cameras.
        fit: of the rig.
        lens: the lenses and places of that.
        pairs: its pairs.
        clocks: by how much cameras were late, which was taken out; None where it is not known.
        start: where it started from.
        photos: of each view, its photo's name.
        shots: the shots' names, in the order in which they were taken.
        scale: the target's units in one unit of the pairs.

    """

    names: Sequence[str]
    fit: Adjustment
    lens: RigLens
    pairs: Observations
    clocks: Clocks | None
    start: RigStart
    photos: Sequence[str]
    shots: Sequence[str]
    scale: float

    @cached_property
    def of_views(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Of each view's shot's pose: Hessian (V, 6, 6), gradient (V, 6), and (V,) its corners."""
        limit = huber_px(self.fit.residual)
        bounds = np.searchsorted(self.pairs.image, np.arange(len(self.lens.shot) + 1))
        hessians, gradients = [], []
        for start, stop in pairwise(bounds.tolist()):
            run = slice(start, stop)
            terms = linearised(self.fit.lens, self.fit.poses, self.fit.world, self.pairs, run)
            length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
            root = np.sqrt(self.pairs.weight[run] * huber_weight(length, limit))[:, None, None]
            pose = (np.concatenate([terms.d_turn, terms.d_shift], axis=2) * root).reshape(-1, 6)
            hessians.append(pose.T @ pose)
            gradients.append(pose.T @ (terms.residual[:, :, None] * root).reshape(-1))
        return np.array(hessians), np.array(gradients), np.diff(bounds)
