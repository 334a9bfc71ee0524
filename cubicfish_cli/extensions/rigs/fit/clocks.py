"""Cameras whose photos of a shot are not of one moment, where it is known how fast corners move.

A camera that is late by d sees each corner where it is d later: off by its speed in the photo
times d, which no place of the camera on the body makes up for, since every shot moves otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.core.fit.adjustment import Adjustment, State, linearise
from cubicfish_cli.core.fit.rig_lens import RigLens
from cubicfish_cli.core.fit.statistics import huber_px, noise_px
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# Nobody's clocks differ by much more than that once films are matched: what holds a clock of which
# still shots say nothing.
_USUAL_S = 1.0
# A clock is off where the fit says so at so many standard deviations,
_SURE = 4.0
# and what it does to its corners is as large as so much of their noise.
_VISIBLE = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class Moving:
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
        cameras: Sequence[tuple[Observations, Moving | None]],
        camera: IntArray,
        pairs: Observations,
    ) -> Moving:
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
            row = {key: at for at, key in enumerate(_keys(seen))}
            own = np.flatnonzero(camera == number)
            at = np.array([row.get(key, -1) for key in _keys(pairs.select(own))], np.intp)
            own, at = own[at >= 0], at[at >= 0]
            for name, values in vars(moving).items():
                getattr(found, name)[own] = values[at]
        return found

    @classmethod
    def joined(cls, parts: Sequence[Moving]) -> Moving:
        """All of some parts, one after the other."""
        names = ("late", "velocity", "acceleration")
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})

    @classmethod
    def between(
        cls, before: FloatArray | None, after: FloatArray | None, seconds: tuple[float, float]
    ) -> Moving:
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

    def at_once(self, pixel: FloatArray, late: FloatArray) -> FloatArray:
        """Pixels (N, 2) of corners that are ``late`` (N,), as they were at their moment."""
        late = late[:, None]
        way = np.nan_to_num(self.velocity) - 0.5 * late * np.nan_to_num(self.acceleration)
        return np.asarray(pixel - way * late)

    def speeds(self, camera: IntArray, count: int) -> FloatArray:
        """(C,) root mean square speed of each camera's corners (N,), pixels per second."""
        squared = np.sum(np.square(self.velocity), axis=1)
        known = np.isfinite(squared)
        total = np.bincount(camera[known], squared[known], count)
        return np.sqrt(total / np.maximum(np.bincount(camera[known], minlength=count), 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Clocks:
    """By how much each camera is later than the first one.

    Attributes:
        late: (C,) seconds; 0 where it is not sure that there is a difference.
        sigma: (C,) standard deviations.
        effect_px: (C,) RMS of what that does to its corners.

    """

    late: FloatArray
    sigma: FloatArray
    effect_px: FloatArray


def fitted_clocks(fit: Adjustment[RigLens], pairs: Observations, moving: Moving) -> Clocks:
    """How late each camera is, beside the first: a step from a fit that takes all as on time.

    Shots' poses and the cameras' places are free, lenses and target are not.

    Args:
        fit: of a rig.
        pairs: its pairs.
        moving: how their corners move.

    """
    lens = fit.lens
    cameras, shots = len(lens.lenses), len(fit.poses)
    hessian, gradient = _by_shot(lens, fit, pairs, moving, shots)
    unit = noise_px(fit.residual)
    whole = hessian.sum(axis=0)
    late_at = 7 * np.arange(cameras - 1) + 6
    whole[late_at, late_at] += (unit / _USUAL_S) ** 2
    scale = 1 / np.sqrt(np.maximum(np.diagonal(whole), 1e-300))
    inverse = np.linalg.pinv(whole * scale * scale[:, None], hermitian=True, rcond=1e-12)
    inverse *= scale * scale[:, None]
    step = -inverse @ gradient.sum(axis=0)
    # Corners of a shot share their errors: what shots pull says how sure it is.
    pulls = gradient + hessian @ step
    spread = inverse @ (pulls.T @ pulls) @ inverse + inverse * unit**2
    late, sigma = np.zeros(cameras), np.zeros(cameras)
    late[1:], sigma[1:] = step[late_at], np.sqrt(np.diagonal(spread)[late_at])
    effect = np.abs(late) * moving.speeds(lens.camera[pairs.image], cameras)
    sure = (np.abs(late) > _SURE * sigma) & (effect > _VISIBLE * unit)
    return Clocks(
        late=np.where(sure, late, 0.0), sigma=sigma, effect_px=np.where(sure, effect, 0.0)
    )


def _by_shot(
    lens: RigLens, fit: Adjustment[RigLens], pairs: Observations, moving: Moving, shots: int
) -> tuple[FloatArray, FloatArray]:
    """Of each shot, its pose eliminated: Hessian (S, K, K) and gradient (S, K).

    Of every camera but the first: the six of its place, then how late it is.
    """
    count = 7 * (len(lens.lenses) - 1)
    limit = huber_px(fit.residual)
    full = np.zeros((shots, count + 6, count + 6))
    pull = np.zeros((shots, count + 6))
    for run, terms in linearise(State(lens, fit.poses, fit.world), pairs, limit):
        camera = int(lens.camera[pairs.image[run.start]])  # a run is of one camera
        part = np.zeros((len(terms.root), 2, count + 6))
        part[:, :, count:] = terms.by_pose
        if camera:
            first = 7 * (camera - 1)
            place = np.isin(terms.columns, np.r_[lens.place_columns(camera)])
            part[:, :, first : first + 6] = terms.by_shared[:, :, place]
            part[:, :, first + 6] = np.nan_to_num(moving.velocity[run]) * terms.root[:, None]
        across = part.transpose(0, 2, 1)
        np.add.at(full, terms.pose, across @ part)
        np.add.at(pull, terms.pose, (across @ terms.miss[:, :, None])[:, :, 0])
    pose = full[:, count:, count:]
    share = full[:, :count, count:] @ np.linalg.pinv(pose, hermitian=True)
    hessian = full[:, :count, :count] - share @ full[:, count:, :count]
    gradient = pull[:, :count] - (share @ pull[:, count:, None])[:, :, 0]
    return hessian, gradient


def _keys(pairs: Observations) -> Iterator[tuple[str, int, int, int]]:
    images = (pairs.images[image] for image in pairs.image)
    return zip(images, pairs.board.tolist(), pairs.column.tolist(), pairs.row.tolist(), strict=True)
