"""When each photo of a shot was taken, where cameras are not triggered together and things move.

A camera that runs free shows its newest frame, whenever it is asked: it is late by another amount
in every shot. So every photo has a time of its own, which is held to how late its camera usually is
as firmly as the photos themselves say; a constant clock is what is left in the mean. How the target
moves is known from the shots beside it, or from frames of a film before and after.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cubicfish.rigs.motion import paths_between
from cubicfish.rigs.rig_lens import PhotoTimes, RigLens
from cubicfish.rigs.shots import Shots, Times, times_of
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, linearise
from cubicfish.solve.normal_equations import solve_scaled
from cubicfish.solve.statistics import huber_px, noise_px
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray

# Shots farther apart than so many usual steps say nothing of each other's motion.
_NEAR = 2.5
# Photos get times where the rig's corners are off by so many times more than each photo's alone:
# where only shots beside tell of motion, and where times or films do.
_STRAINED, _INFORMED = 1.5, 1.05
# And they keep these times where times explain this share of the squared error above the photos'
# own. Of simulated hand-held motion they explain 0.96 or more in each of 16 rigs; of cameras that
# turn by chance, in 20 shots, 0.44 to 0.83, since one of two directions is explained by chance.
# Times that are kept wrongly cost little; a hand-held rig that loses them cannot be trusted.
_EXPLAINED = 0.8
# The scatter at first: of the step between shots, or seconds of films.
_FIRST_SHARE, _FIRST_S = 0.3, 0.03
_ROUNDS, _LEAST_SHARE, _ROUGH_DECREASE = 8, 1e-3, 1e-5
# Corners of shots that are left out count so little: enough to place these shots.
_LEFT_OUT, _ROUNDS_WITHOUT = 1e-6, 2
# A clock is off where the fit says so at so many standard deviations,
_SURE = 4.0
# and what it does to its corners is as large as so much of their noise.
_VISIBLE = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerMotion:
    """How the corners of some photos move, row by row.

    Attributes:
        late: (N,) by how much each corner's photo is later than its shot's moment, seconds.
        velocity: (N, 2) pixels per second; NaN where not known.
        acceleration: (N, 2) pixels per second squared; NaN where not known.

    """

    late: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def of_cameras(
        cls,
        cameras: Sequence[tuple[Observations, CornerMotion | None]],
        camera: IntArray,
        pairs: Observations,
    ) -> CornerMotion:
        """The same for a rig's pairs; nothing is known of corners that are not here.

        Args:
            cameras: of each its corners, and how these move, where that is known.
            camera: (N,) which camera saw each of the pairs.
            pairs: of all cameras, N.

        """
        found = cls(
            late=np.zeros(len(camera)),
            velocity=np.full((len(camera), 2), np.nan),
            acceleration=np.full((len(camera), 2), np.nan),
        )
        for number, (seen, moving) in enumerate(cameras):
            if moving is None:
                continue
            row = {key: at for at, key in enumerate(_make_keys(seen))}
            own = np.flatnonzero(camera == number)
            at = np.array([row.get(key, -1) for key in _make_keys(pairs.select(own))], np.intp)
            own, at = own[at >= 0], at[at >= 0]
            for name, values in vars(moving).items():
                getattr(found, name)[own] = values[at]
        return found

    @classmethod
    def joined(cls, parts: Sequence[CornerMotion]) -> CornerMotion:
        """All of some parts, one after the other."""
        names = ("late", "velocity", "acceleration")
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})

    @classmethod
    def between(
        cls, before: FloatArray | None, after: FloatArray | None, seconds: tuple[float, float]
    ) -> CornerMotion:
        """Of one photo's corners, by where they are in the frames before and after it.

        Args:
            before: (N, 2) how far they are elsewhere in the frame before, pixels; NaN where not
                known, None where there is no such frame.
            after: the same of the frame after.
            seconds: to the frame before (less than 0) and to that after.

        """
        count = len(before if before is not None else after if after is not None else ())
        back, on = (np.full((count, 2), np.nan) if one is None else one for one in (before, after))
        first, second = (way / time for way, time in zip((back, on), seconds, strict=True))
        # A parabola through three places, or a line where one is not known.
        bend = (second - first) / (seconds[1] - seconds[0])
        speed = second - bend * seconds[1]
        speed = np.where(np.isfinite(speed), speed, np.where(np.isfinite(second), second, first))
        return cls(late=np.zeros(count), velocity=speed, acceleration=2 * bend)


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """What is known of when photos were taken and how the target moves.

    Attributes:
        moment: by shot's name, when it was; shots that are not here say nothing of motion.
        stated: by camera and photo, how much later than its shot's moment it was, as far as known.
        flow: how corners move (of the pairs that are fitted), from films.
        in_seconds: whether these are seconds; else steps from shot to shot.

    """

    moment: Mapping[str, float]
    stated: Sequence[Mapping[str, float]]
    flow: CornerMotion | None = None
    in_seconds: bool = True

    @classmethod
    def of_shots(cls, cameras: Sequence[str], shots: Shots, times: Times | None) -> Motion:
        """By the photos' times, their names' times, or else the shots' numbers.

        Args:
            cameras: names of the cameras.
            shots: which photos are of one shot.
            times: by camera and photo, when it was taken, seconds, as far as known.

        """
        taken = [
            times_of(listed, None if times is None else times.get(camera, {}))
            for camera, listed in zip(cameras, shots.photos, strict=True)
        ]
        middle = _find_middles(shots, taken)
        if not middle:
            moment = _number_shots(shots.names)
            return cls(moment=moment, stated=[{} for _ in cameras], in_seconds=False)
        stated = [
            {photo: time - middle[listed[photo]] for photo, time in own.items()}
            for listed, own in zip(shots.photos, taken, strict=True)
        ]
        moment = {shots.names[number]: time for number, time in middle.items()}
        return cls(moment=moment, stated=stated)

    def with_flow(
        self,
        cameras: Sequence[tuple[Observations, CornerMotion | None]],
        camera: IntArray,
        pairs: Observations,
    ) -> Motion:
        """The same of films: how corners of the pairs move, and how late their photos are.

        The arguments are those of :meth:`CornerMotion.of_cameras`.
        """
        stated = [
            {}
            if own is None
            else dict(zip(seen.images, _average_by_photo(seen, own.late), strict=True))
            for seen, own in cameras
        ]
        flow = CornerMotion.of_cameras(cameras, camera, pairs)
        return replace(self, flow=flow, stated=stated, in_seconds=True)

    def step(self) -> float:
        """The usual time between shots; 0 where it is not known."""
        gaps = np.diff(np.sort(list(self.moment.values())))
        return float(np.median(gaps)) if len(gaps) else 0.0

    def paths(self, fit: Adjustment[RigLens], shots: Sequence[str], late: FloatArray) -> FloatArray:
        """(V, P, 6) how the target moves about each view's shot; see :class:`PhotoTimes`."""
        shot = fit.lens.shot
        if self.flow is not None:
            path = _fit_paths_of_flow(fit, self.flow)[shot]
        else:
            moment = np.array([self.moment.get(name, np.nan) for name in shots])
            path = paths_between(fit.poses, moment, _NEAR * self.step(), shot, late)
        path[np.bincount(shot)[shot] < 2] = 0  # a view by itself is of its own moment
        return path


def _fit_paths_of_flow(fit: Adjustment[RigLens], flow: CornerMotion) -> FloatArray:
    """(S, 2, 6) the same by how corners move in the frames before and after."""
    found = np.zeros((len(fit.poses), 2, 6))
    hessian, pull = np.zeros((len(fit.poses), 6, 6)), np.zeros((len(fit.poses), 6, 2))
    speeds = np.stack([flow.velocity, 0.5 * flow.acceleration], axis=2)
    for run, terms in linearise(fit, fit.pairs, fit.huber_px):
        known = np.isfinite(speeds[run]).all(axis=(1, 2))
        by = terms.by_pose[known]
        across = by.transpose(0, 2, 1)
        np.add.at(hessian, terms.pose[known], across @ by)
        moved = speeds[run][known] * terms.root[known, None, None]
        np.add.at(pull, terms.pose[known], across @ moved)
    seen = np.linalg.norm(hessian, axis=(1, 2)) > 0
    steps = np.linalg.pinv(hessian[seen], hermitian=True, rcond=1e-9) @ pull[seen]
    found[seen] = steps.transpose(0, 2, 1)
    found[:, :, :3] = found[:, :, :3] @ fit.poses.rotation
    return found


def _find_middles(shots: Shots, taken: Sequence[Mapping[str, float]]) -> dict[int, float]:
    """When each shot (by index) was taken: the median of the times of its photos, where known."""
    of_shot: dict[int, list[float]] = {}
    for listed, own in zip(shots.photos, taken, strict=True):
        for photo, time in own.items():
            of_shot.setdefault(listed[photo], []).append(time)
    return {shot: float(np.median(own)) for shot, own in of_shot.items()}


def _number_shots(names: Sequence[str]) -> dict[str, float]:
    """The last number in each shot's name; none where two shots have the same, or no name has."""
    numbers = [re.findall(r"[0-9]+", Path(name).stem) for name in names]
    found = {name: float(own[-1]) for name, own in zip(names, numbers, strict=True) if own}
    return found if len(set(found.values())) == len(names) else {}


@dataclass(frozen=True, kw_only=True, eq=False)
class Clocks:
    """By how much each camera is later than the first one, in the usual photo and from it.

    Attributes:
        late: (C,) by how much it usually is, seconds; 0 where it is not sure that it is.
        sigma: (C,) standard deviations.
        effect_px: (C,) RMS of what that does to its corners.
        scatter_px: (C,) RMS of what its photos' times about that do to its corners.
        in_seconds: whether these are seconds; else steps from shot to shot.

    """

    late: FloatArray
    sigma: FloatArray
    effect_px: FloatArray
    scatter_px: FloatArray
    in_seconds: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Timing:
    """How the times of photos are fitted.

    Attributes:
        motion: when photos were taken, and how the target moves.
        shots: the shots' names.
        noise_px: of corners, with each photo's pose left free.
        least: the least scatter of a camera's photos.

    """

    motion: Motion
    shots: Sequence[str]
    noise_px: float
    least: float

    def again(self, fit: Adjustment[RigLens]) -> Adjustment[RigLens]:
        """The fit with the motion of its own shots, and cameras' scatter as its photos tell it."""
        lens, times = fit.lens, fit.lens.times
        assert times is not None
        free = ~firsts(lens)
        left = times.late - times.stated - times.usual[lens.camera]
        # Expectation and maximisation: what is not sure of a photo's time counts as scatter, too.
        total = np.square(left) + self.noise_px**2 * _compute_variances(fit)
        count = np.bincount(lens.camera, free, len(lens.lenses))
        width = np.bincount(lens.camera, total * free, len(count)) / np.maximum(count, 1)
        prior_weight = self.noise_px / np.maximum(np.sqrt(width), self.least)[lens.camera]
        prior_weight[~free] = self.noise_px / self.least
        path = self.motion.paths(fit, self.shots, times.late)
        return replace(
            fit, lens=replace(lens, times=replace(times, prior_weight=prior_weight, path=path))
        )

    def blocks(self, count: int) -> list[IntArray]:
        """The shots in at most so many blocks of time."""
        moment = [self.motion.moment.get(name, np.inf) for name in self.shots]
        return np.array_split(np.argsort(moment, kind="stable"), min(count, len(moment)))

    def without(self, fit: Adjustment[RigLens], shots: IntArray) -> RigLens:
        """The rig that is fitted without some shots (K,), photos' times and motion too."""
        out = np.isin(fit.lens.shot[fit.pairs.image], shots)
        pairs = replace(fit.pairs, weight=fit.pairs.weight * np.where(out, _LEFT_OUT, 1.0))
        for _ in range(_ROUNDS_WITHOUT):
            fit = fit.again(
                pairs, relative_decrease=_ROUGH_DECREASE, damping=WARM_DAMPING, limit=huber_px
            )
            fit = self.again(fit)
        return fit.lens


def on_time(
    fit: Adjustment[RigLens], motion: Motion, views: JoinedViews
) -> tuple[Adjustment[RigLens], Timing | None]:
    """The fit with a time for every photo, where that explains what is wrong with the rig.

    Args:
        fit: of a rig whose shots are of one moment.
        motion: when photos were taken, and how the target moves.
        views: what is fitted.

    """
    lens, alone, before = fit.lens, _measure_alone_px(fit), noise_px(fit.residual)
    of_views = zip(lens.camera.tolist(), views.photos, strict=True)
    stated = np.array([motion.stated[camera].get(photo, 0.0) for camera, photo in of_views])
    informed = motion.flow is not None or bool(stated.any())
    first = _FIRST_S if motion.flow is not None else _FIRST_SHARE * motion.step()
    if not first or before < (_INFORMED if informed else _STRAINED) * alone:
        return fit, None
    prior_weight = alone / np.where(firsts(lens), _LEAST_SHARE * first, first)
    times = PhotoTimes(
        late=stated,
        stated=stated,
        usual=np.zeros(len(lens.lenses)),
        prior_weight=prior_weight,
        path=motion.paths(fit, views.shots, stated),
    )
    least = _LEAST_SHARE * first
    timing = Timing(motion=motion, shots=views.shots, noise_px=alone, least=least)
    found = replace(fit, lens=replace(lens, times=times))
    for _ in range(_ROUNDS):
        found = found.again(fit.pairs, relative_decrease=_ROUGH_DECREASE)
        found = timing.again(found)
    found = found.again(fit.pairs, relative_decrease=_ROUGH_DECREASE)
    gained = before**2 - noise_px(found.residual) ** 2
    return (found, timing) if gained > _EXPLAINED * (before**2 - alone**2) else (fit, None)


def firsts(lens: RigLens) -> BoolArray:
    """(V,) of each shot the view of its first camera, by which its moment is set."""
    found = np.zeros(len(lens.shot), bool)
    found[np.unique(lens.shot, return_index=True)[1]] = True
    return found


def _compute_covariance(fit: Adjustment[RigLens]) -> FloatArray:
    """(K, K) of the shared unknowns, for corners' noise of 1."""
    hessian = fit.normal.reduced_shared()
    return solve_scaled(hessian, np.eye(len(hessian)))


def _compute_variances(fit: Adjustment[RigLens]) -> FloatArray:
    """(V,) of how much later than usual views are, for corners' noise of 1."""
    lens, covariance = fit.lens, _compute_covariance(fit)
    own = lens.late_columns
    variance = covariance[own, own].copy()
    later = lens.camera > 0
    usual = lens.usual_columns[lens.camera[later] - 1]
    variance[later] += covariance[usual, usual] - 2 * covariance[own[later], usual]
    return variance


def _measure_alone_px(fit: Adjustment[RigLens]) -> float:
    """Noise of the corners with each view's pose left free, to first order."""
    left, image = fit.residual.copy(), fit.pairs.image
    for run, terms in linearise(fit, fit.pairs, np.inf):
        by = terms.by_pose / terms.root[:, None, None]
        for view in np.unique(image[run]).tolist():
            rows = np.flatnonzero(image[run] == view)
            matrix = by[rows].reshape(-1, 6)
            step = np.linalg.lstsq(matrix, -left[run][rows].ravel(), rcond=1e-10)[0]
            left[run.start + rows] += (matrix @ step).reshape(-1, 2)
    return noise_px(left)


def clocks_of(fit: Adjustment[RigLens], timing: Timing) -> Clocks:
    """What the times of a fit's photos say of its cameras' clocks."""
    lens, times = fit.lens, fit.lens.times
    assert times is not None
    in_seconds = timing.motion.in_seconds
    unit = noise_px(fit.residual)
    own, before = lens.usual_columns, times.stated
    sigma = unit * np.sqrt(np.append(0.0, np.diagonal(_compute_covariance(fit))[own]))
    effect = _measure_effect_px(fit, times.usual[lens.camera])
    sure = in_seconds & (np.abs(times.usual) > _SURE * sigma) & (effect > _VISIBLE * unit)
    left = times.late - before - times.usual[lens.camera]
    return Clocks(
        late=np.where(sure, times.usual, 0.0),
        sigma=sigma,
        effect_px=np.where(sure, effect, 0.0),
        scatter_px=_measure_effect_px(fit, left),
        in_seconds=in_seconds,
    )


def _measure_effect_px(fit: Adjustment[RigLens], late: FloatArray) -> FloatArray:
    """(C,) RMS of how far corners are off if a part (V,) of their lateness is not known."""
    lens, image = fit.lens, fit.pairs.image
    assert lens.times is not None
    total, count = np.zeros(len(lens.lenses)), np.zeros(len(lens.lenses))
    speed = lens.times.speed(fit.poses[lens.shot])
    for run, terms in linearise(fit, fit.pairs, np.inf):
        by = terms.by_pose @ speed[image[run]][:, :, None] / terms.root[:, None, None]
        camera = lens.camera[image[run.start]]
        total[camera] += np.square(by[:, :, 0] * late[image[run]][:, None]).sum()
        count[camera] += len(by)
    return np.sqrt(total / np.maximum(count, 1))


def _average_by_photo(seen: Observations, values: FloatArray) -> list[float]:
    """The mean of each photo's values (N,)."""
    count = np.bincount(seen.image, minlength=len(seen.images))
    total = np.bincount(seen.image, values, len(seen.images))
    return list((total / np.maximum(count, 1)).tolist())


def _make_keys(pairs: Observations) -> Iterator[tuple[str, int, int, int]]:
    images = (pairs.images[image] for image in pairs.image)
    return zip(images, pairs.board.tolist(), pairs.column.tolist(), pairs.row.tolist(), strict=True)
