"""Several cameras on one body, as least squares sees them: a lens and a place for each.

A photo of a rig is a view: what one camera saw of one shot. The adjustment knows one pose per shot
and looks at the views camera by camera; one camera alone is a rig of one, whose views are shots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from cubicfish_cli.core.fit.lenses import FitLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.types import FloatArray, IntArray

_PLACE = 6  # a turn and a shift of camera_from_rig


@dataclass(frozen=True, kw_only=True, eq=False)
class Through:
    """The lens that some photos were taken through, and how its camera stands on the body.

    Attributes:
        lens: of one camera: points in its frame -> pixels.
        columns: where its parameters stand among all lenses'; those of its place come last.
        place: camera_from_rig, (3, 3) and (3,); None where the camera's frame is the rig's.
        free: whether that place is a parameter.

    """

    lens: FitLens
    columns: slice
    place: tuple[FloatArray, FloatArray] | None = None
    free: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class RigLens:
    """The lenses of a rig and camera_from_rig of each: all that its shots have in common.

    Views are sorted by camera. The first camera's frame is the rig's.

    Attributes:
        lenses: one per camera.
        places: camera_from_rig of each camera; the first is the identity.
        camera: (V,) camera of each view, non-decreasing.
        shot: (V,) shot of each view.
        held: whether the places are as they are, and no parameters.

    """

    lenses: tuple[FitLens, ...]
    places: Poses
    camera: IntArray
    shot: IntArray
    held: bool = False

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """Where each camera's parameters stand: its lens's, then the six of its place."""
        sizes = [
            len(lens.parameters) + (_PLACE if number and not self.held else 0)
            for number, lens in enumerate(self.lenses)
        ]
        ends = np.cumsum([0, *sizes])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @cached_property
    def common_shots(self) -> IntArray:
        """(C, C) in how many shots two cameras both see the target."""
        seen = np.zeros((len(self.lenses), int(self.shot.max()) + 1), np.intp)
        seen[self.camera, self.shot] = 1
        return np.asarray(seen @ seen.T)

    def place_columns(self, camera: int) -> slice:
        """Where the turn and the shift of a camera that is not the first stand."""
        return slice(self.columns[camera].stop - _PLACE, self.columns[camera].stop)

    @property
    def parameters(self) -> FloatArray:
        """(K,); turns are counted from where the cameras stand, and so are 0."""
        parts = []
        for number, lens in enumerate(self.lenses):
            parts.append(lens.parameters)
            if number and not self.held:
                parts += [np.zeros(3), self.places.translation[number]]
        return np.concatenate(parts)

    def with_parameters(self, parameters: FloatArray) -> RigLens:
        """The same rig with other lenses and places."""
        lenses, step = [], np.zeros((len(self.lenses), _PLACE))
        for number, (lens, columns) in enumerate(zip(self.lenses, self.columns, strict=True)):
            own = parameters[columns]
            if number and not self.held:
                step[number] = own[-_PLACE:]
                step[number, 3:] -= self.places.translation[number]
                own = own[:-_PLACE]
            lenses.append(lens.with_parameters(own))
        return replace(self, lenses=tuple(lenses), places=self.places.moved(step))

    def with_lenses(self, lenses: Sequence[FitLens]) -> RigLens:
        """The same rig with other lenses."""
        return replace(self, lenses=tuple(lenses))

    def views(self, shots: Poses) -> Poses:
        """camera_from_world of every view, from rig_from_world of every shot."""
        return self.places[self.camera] @ shots[self.shot]

    def shot_of(self, views: IntArray) -> IntArray:
        """(n,) the shots of some views."""
        return self.shot[views]

    @property
    def starts(self) -> IntArray:
        """Views at which another camera's begin."""
        return np.flatnonzero(np.diff(self.camera)) + 1

    def through(self, view: int) -> Through:
        """The lens of a view, and of all others of its camera."""
        camera = int(self.camera[view])
        own = self.places.rotation[camera], self.places.translation[camera]
        return Through(
            lens=self.lenses[camera],
            columns=self.columns[camera],
            place=own if camera else None,
            free=not self.held,
        )

    def prior(self) -> FloatArray:
        """The lenses' priors, each where its parameters stand."""
        count = self.columns[-1].stop
        whole = np.zeros((count + 1, count + 1))
        for lens, columns in zip(self.lenses, self.columns, strict=True):
            own = lens.prior()
            at = np.append(columns.start + np.arange(len(own) - 1), count)
            whole[np.ix_(at, at)] += own
        return whole

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Not of a rig: which camera sees the points is a matter of the view."""
        raise TypeError("a rig projects through the lens of a view")

    def project(self, points: FloatArray) -> FloatArray:
        """Not of a rig: which camera sees the points is a matter of the view."""
        raise TypeError("a rig projects through the lens of a view")


def body_of(lens: FitLens, photos: int) -> RigLens:
    """A lens as that of a body: one camera alone is a rig of one, whose photos are its shots."""
    if isinstance(lens, RigLens):
        return lens
    return RigLens(
        lenses=(lens,),
        places=Poses(rotation=np.eye(3)[None], translation=np.zeros((1, 3))),
        camera=np.zeros(photos, np.intp),
        shot=np.arange(photos),
    )
