"""Several cameras on one body, as least squares sees them: a lens and a place for each.

A photo of a rig is a view: what one camera saw of one shot. The adjustment knows one pose per shot
and looks at the views camera by camera; a `RigLens` is the body that carries them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.poses import Poses, cross_matrix, rotation_from_vector
from cubicfish.types import FloatArray, IntArray

_PLACE = 6  # a turn and a shift of camera_from_rig
# How late a camera usually is, is held so much less firmly than its photos are to that.
_USUAL = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoTimes:
    """How much later than its shot each view was seen, and how the target moves meanwhile.

    Attributes:
        late: (V,) by how much; in the unit of time of ``path``.
        stated: (V,) what is known of that already.
        usual: (C,) how late each camera usually is beyond that; 0 for the first.
        prior_weight: (V,) how firmly the view is held to that: pixels of noise over the scatter's
            width.
        path: (V, P, 6) the target's turn (in its own frame) and shift (in the rig's) since the
            shot, as factors of the powers of the time since, from the first on.
        known: whether views are as late as they are, and that is no parameter.

    """

    late: FloatArray
    stated: FloatArray
    usual: FloatArray
    prior_weight: FloatArray
    path: FloatArray
    known: bool = False

    def along(self) -> tuple[FloatArray, FloatArray]:
        """(V, 6) how far the target moved in each view, and (V, 6) its speed then."""
        power = np.arange(1, self.path.shape[1] + 1)
        before = self.late[:, None] ** (power - 1)
        moved = np.einsum("vp,vpk->vk", before * self.late[:, None], self.path)
        return moved, np.einsum("vp,vpk->vk", before * power, self.path)

    def moved(self, shots: Poses) -> Poses:
        """Poses of every view's shot (V) as they were when it was seen."""
        step = self.along()[0]
        return Poses(
            rotation=shots.rotation @ rotation_from_vector(step[:, :3]),
            translation=shots.translation + step[:, 3:],
        )

    def speed(self, shots: Poses) -> FloatArray:
        """(V, 6) turn and shift of these poses per unit of time, in the rig's frame."""
        step, rate = self.along()
        # The derivative of a rotation vector's rotation, to second order.
        turn = rate[:, :3] - 0.5 * np.cross(step[:, :3], rate[:, :3])
        turned = self.moved(shots).rotation @ turn[:, :, None]
        return np.concatenate([turned[:, :, 0], rate[:, 3:]], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigLens(FitLens):
    """The lenses of a rig and camera_from_rig of each: all that its shots have in common.

    Views are sorted by camera. The first camera's frame is the rig's.

    Attributes:
        lenses: one per camera.
        places: camera_from_rig of each camera; the first is the identity.
        camera: (V,) camera of each view, non-decreasing.
        shot: (V,) shot of each view.
        places_fixed: whether the places are as they are, and no parameters.
        times: when each view was seen; None where a shot's views are of one moment.

    """

    lenses: tuple[FitLens, ...]
    places: Poses
    camera: IntArray
    shot: IntArray
    places_fixed: bool = False
    times: PhotoTimes | None = None

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """Where each camera's parameters stand: its lens's, the six of its place, its times.

        Times are how late it usually is (but of the first camera), then each of its views.
        """
        sizes = [
            len(lens.parameters)
            + (_PLACE if number and not self.places_fixed else 0)
            + self._count_times(number)
            for number, lens in enumerate(self.lenses)
        ]
        ends = np.cumsum([0, *sizes])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def free_times(self) -> PhotoTimes | None:
        """When each view was seen, where that is a parameter."""
        return None if self.times is None or self.times.known else self.times

    def _count_times(self, camera: int) -> int:
        views = int(np.sum(self.camera == camera)) if self.free_times is not None else 0
        return views + (1 if views and camera else 0)

    @cached_property
    def usual_columns(self) -> IntArray:
        """(C - 1,) where it stands how late the cameras but the first usually are."""
        times = [own.stop - self._count_times(n) for n, own in enumerate(self.columns)]
        return np.array(times[1:], np.intp)

    @cached_property
    def late_columns(self) -> IntArray:
        """(V,) where it stands how late each view is."""
        views = np.bincount(self.camera, minlength=len(self.lenses)).tolist()
        ends = zip(self.columns, views, strict=True)
        return np.concatenate([np.arange(own.stop - n, own.stop) for own, n in ends])

    @cached_property
    def common_shots(self) -> IntArray:
        """(C, C) in how many shots two cameras both see the target."""
        seen = np.zeros((len(self.lenses), int(self.shot.max()) + 1), np.intp)
        seen[self.camera, self.shot] = 1
        return np.asarray(seen @ seen.T)

    def place_columns(self, camera: int) -> slice:
        """Where the turn and the shift of a camera that is not the first stand."""
        first = self.columns[camera].start + len(self.lenses[camera].parameters)
        return slice(first, first + _PLACE)

    @property
    def parameters(self) -> FloatArray:
        """(K,); turns are counted from where the cameras stand, and so are 0."""
        parts = []
        for number, lens in enumerate(self.lenses):
            parts.append(lens.parameters)
            if number and not self.places_fixed:
                parts += [np.zeros(3), self.places.translation[number]]
            if self.free_times is not None:
                late = self.free_times.late[self.camera == number]
                parts += [self.free_times.usual[number : number + 1][: 1 if number else 0], late]
        return np.concatenate(parts)

    def with_parameters(self, parameters: FloatArray) -> RigLens:
        """The same rig with other lenses and places."""
        lenses, step = [], np.zeros((len(self.lenses), _PLACE))
        for number, (lens, columns) in enumerate(zip(self.lenses, self.columns, strict=True)):
            if number and not self.places_fixed:
                step[number] = parameters[self.place_columns(number)]
                step[number, 3:] -= self.places.translation[number]
            lenses.append(lens.with_parameters(parameters[columns][: len(lens.parameters)]))
        times = self.times
        if self.free_times is not None:
            usual = np.append(0.0, parameters[self.usual_columns])
            times = replace(self.free_times, late=parameters[self.late_columns], usual=usual)
        places = self.places.moved(step)
        return replace(self, lenses=tuple(lenses), places=places, times=times)

    def with_lenses(self, lenses: Sequence[FitLens]) -> RigLens:
        """The same rig with other lenses."""
        return replace(self, lenses=tuple(lenses))

    def views(self, shots: Poses) -> Poses:
        """camera_from_world of every view, from rig_from_world of every shot."""
        return self.places[self.camera] @ self.at_views(shots)

    def at_views(self, shots: Poses) -> Poses:
        """rig_from_world when each view was seen."""
        own = shots[self.shot]
        return own if self.times is None else self.times.moved(own)

    def by_body(
        self, photos: IntArray, shots: Poses, by_view: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        camera = int(self.camera[photos[0]])
        parts = [np.zeros((len(photos), 2, 0))]
        if camera:
            turned, shift = self.places.rotation[camera], self.places.translation[camera]
            by_turn, by_shift = by_view[:, :, :3], by_view[:, :, 3:]
            if not self.places_fixed:
                # A turn of the camera on the body swings the whole way from the body's origin.
                arm = cross_matrix(self.views(shots).translation[photos] - shift)
                parts += [by_turn - by_shift @ arm, by_shift]
            by_view = np.concatenate([by_turn @ turned, by_shift @ turned], axis=2)
        if self.free_times is not None:
            speed = self.free_times.speed(shots[self.shot])
            parts.append(self._differentiate_by_times(by_view, speed, photos))
        own = self.columns[camera]
        return np.arange(own.start, own.stop), np.concatenate(parts, axis=2), by_view

    def _differentiate_by_times(
        self, by_pose: FloatArray, speed: FloatArray, image: IntArray
    ) -> FloatArray:
        """(n, 2, T) what pairs of one camera's views change by with its times.

        Args:
            by_pose: (n, 2, 6) what they change by with their shot's pose.
            speed: (V, 6) of every view.
            image: (n,) their views.

        """
        camera = int(self.camera[image[0]])
        count, rows = self._count_times(camera), np.arange(len(image))
        found = np.zeros((len(image), 2, count))
        own = self.late_columns[image] - self.columns[camera].stop + count
        found[rows, :, own] = (by_pose @ speed[image][:, :, None])[:, :, 0]
        return found

    def shot_of(self, photos: IntArray) -> IntArray:
        """(n,) the shots of some views."""
        return self.shot[photos]

    def camera_of(self, photos: IntArray) -> IntArray:
        """(n,) which camera they are of."""
        return self.camera[photos]

    def lens_of(self, photo: int) -> FitLens:
        """The lens of a view."""
        return self.lenses[self.camera[photo]]

    def pulls(self) -> FloatArray:
        """The lenses' priors, each where its parameters stand."""
        count = self.columns[-1].stop
        whole = np.zeros((count + 1, count + 1))
        for lens, columns in zip(self.lenses, self.columns, strict=True):
            own = lens.pulls()
            at = np.append(columns.start + np.arange(len(own) - 1), count)
            whole[np.ix_(at, at)] += own
        times, views = self.free_times, np.arange(len(self.camera))
        if times is None:
            return whole
        prior_weight, usual = times.prior_weight, np.append(count, self.usual_columns)
        rows = np.zeros((len(views), count + 1))
        # The first camera's usual lateness is 0: its column is the residual's, written over.
        rows[views, usual[self.camera]] = -prior_weight
        rows[views, self.late_columns] = prior_weight
        rows[:, -1] = prior_weight * (times.late - times.stated - times.usual[self.camera])
        whole += rows.T @ rows
        pull = _USUAL**2 * np.bincount(self.camera, np.square(prior_weight), len(self.lenses))[1:]
        whole[self.usual_columns, self.usual_columns] += pull
        whole[self.usual_columns, -1] += pull * times.usual[1:]
        whole[-1, self.usual_columns] += pull * times.usual[1:]
        whole[-1, -1] += pull @ np.square(times.usual[1:])
        return whole
