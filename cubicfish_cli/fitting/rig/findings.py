"""What is likely wrong with a rig's shots: a camera that moved, photos of other shots, too few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.adjustment import Adjustment, huber_weight, linearised
from cubicfish_cli.fitting.rig.start import RigStart, common_shots
from cubicfish_cli.fitting.rig_lens import RigLens
from cubicfish_cli.fitting.robust import huber_px, noise_px
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

# Two cameras that fewer shots connect stand where one shot's errors put them.
_FEW = 5
# Shots on either side of where a camera may have moved.
_LEAST_SHOTS = 3
_RCOND = 1e-10
# A camera has moved where so little chance would show as much,
_CHANCE = 1e-5
# and what it does to its corners is as large as so much of their noise.
_VISIBLE = 0.5


@dataclass(frozen=True, kw_only=True)
class RigFinding(Finding):
    """Something that is likely wrong with a rig.

    Attributes:
        cameras: whose.
        shots: of which shots, or of which photos where these are not of their shot.

    """

    cameras: tuple[str, ...] = ()
    shots: tuple[str, ...] = ()

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return {
            **super().as_record(),
            "cameras": list(self.cameras),
            "shots": list(self.shots),
            "line": self.line,
        }

    @property
    def _about(self) -> dict[str, tuple[str, ...]]:
        return {**super()._about, "cameras": self.cameras, "of_shots": self.shots}


def find_rig_faults(
    names: Sequence[str],
    fit: Adjustment,
    pairs: Correspondences,
    start: RigStart,
    photos: Sequence[str],
    shots: Sequence[str],
    scale: float,
) -> list[RigFinding]:
    """What is likely wrong with a set-up of which the fit succeeded.

    Args:
        names: of the cameras.
        fit: of the rig.
        pairs: its pairs.
        start: where it started from.
        photos: of each view, its photo's name.
        shots: the shots' names, in the order in which they were taken.
        scale: the target's units in one unit of the pairs.

    """
    lens = fit.lens
    if not isinstance(lens, RigLens):
        raise TypeError("the adjustment must be of a rig")
    found = _mismatched(names, lens, start, photos)
    moved = camera_moved(lens, fit, pairs)
    if moved is not None:
        found.append(_said(names, shots, moved, scale))
    return found + _few(names, lens)


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """A camera that stood elsewhere from some shot on.

    Attributes:
        camera: which.
        shot: the first shot after it moved.
        step: (6,) turn in the camera's frame, radians, and shift.
        effect_px: RMS of what that does to the camera's corners.
        chance: of as much by chance, over all cameras and shots.

    """

    camera: int
    shot: int
    step: FloatArray
    effect_px: float
    chance: float


def camera_moved(lens: RigLens, fit: Adjustment, pairs: Correspondences) -> Moved | None:
    """Whether one camera stood elsewhere before some shot than after.

    What each shot says of each camera's place beside the others', its pose left free, is linear
    where the fit stopped. Two means, before and after, are judged against how shots differ
    among themselves (an F test), which knows of all errors that shots do not share.
    """
    best: Moved | None = None
    of_views = _by_pose(lens, fit, pairs)
    for camera in range(len(lens.lenses)):
        found = _split(*_says(lens, *of_views, camera), camera)
        if found is not None and (best is None or found.chance < best.chance):
            best = found
    if best is None or best.chance * len(lens.lenses) > _CHANCE:
        return None
    return best if best.effect_px > _VISIBLE * noise_px(fit.residual) else None


def _by_pose(
    lens: RigLens, fit: Adjustment, pairs: Correspondences
) -> tuple[FloatArray, FloatArray, IntArray]:
    """What each view says of its shot's pose: Hessian (V, 6, 6), gradient (V, 6), and corners."""
    limit = huber_px(fit.residual)
    bounds = np.searchsorted(pairs.image, np.arange(len(lens.shot) + 1))
    hessians, gradients = [], []
    for start, stop in pairwise(bounds.tolist()):
        run = slice(start, stop)
        terms = linearised(fit.lens, fit.poses, fit.world, pairs, run)
        length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
        root = np.sqrt(pairs.weight[run] * huber_weight(length, limit))[:, None, None]
        pose = (np.concatenate([terms.d_turn, terms.d_shift], axis=2) * root).reshape(-1, 6)
        hessians.append(pose.T @ pose)
        gradients.append(pose.T @ (terms.residual[:, :, None] * root).reshape(-1))
    return np.array(hessians), np.array(gradients), np.diff(bounds)


def _says(
    lens: RigLens, hessian: FloatArray, gradient: FloatArray, corners: IntArray, camera: int
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """What shots say of one camera's place beside the others', their poses left free.

    Returns:
        Shots (S,) that others saw too, in order; Hessian (S, 6, 6), gradient (S, 6) by a step in
        the camera's frame, and how many corners the camera saw.

    """
    shots = int(lens.shot.max()) + 1
    hessian_of, gradient_of = np.zeros((shots, 6, 6)), np.zeros((shots, 6))
    np.add.at(hessian_of, lens.shot, hessian)
    np.add.at(gradient_of, lens.shot, gradient)
    several = np.bincount(lens.shot)[lens.shot] > 1
    views = np.flatnonzero((lens.camera == camera) & several)
    views = views[np.argsort(lens.shot[views], kind="stable")]
    shot = lens.shot[views]
    own, pull = hessian[views], gradient[views]
    # Less what the shot's pose would make up for.
    share = own @ np.linalg.pinv(hessian_of[shot], hermitian=True)
    turned = np.kron(np.eye(2), lens.places.rotation[camera])
    left = turned @ (own - share @ own) @ turned.T
    pulled = (pull - (share @ gradient_of[shot][:, :, None])[:, :, 0]) @ turned.T
    return shot, left, pulled, corners[views]


def _split(
    shots: IntArray, hessian: FloatArray, gradient: FloatArray, corners: IntArray, camera: int
) -> Moved | None:
    """The shot from which on the camera stands elsewhere, if it does anywhere."""
    count = len(shots)
    if count < 2 * _LEAST_SHOTS:
        return None
    explained = np.array(
        [g @ np.linalg.lstsq(h, g, rcond=_RCOND)[0] for h, g in zip(hessian, gradient, strict=True)]
    )
    best: Moved | None = None
    for first in range(_LEAST_SHOTS, count - _LEAST_SHOTS + 1):
        sides = slice(0, first), slice(first, count)
        sums = [(hessian[side].sum(axis=0), gradient[side].sum(axis=0)) for side in sides]
        means = [-np.linalg.lstsq(h, g, rcond=_RCOND)[0] for h, g in sums]
        whole = -np.linalg.lstsq(sums[0][0] + sums[1][0], sums[0][1] + sums[1][1], rcond=_RCOND)[0]
        between = sum(
            float((mean - whole) @ h @ (mean - whole))
            for (h, _), mean in zip(sums, means, strict=True)
        )
        by_means = sum(float(-g @ mean) for (_, g), mean in zip(sums, means, strict=True))
        within = max(float(explained.sum()) - by_means, 1e-300)
        freedom = 6 * (count - 2)
        chance = float(fdtrc(6, freedom, (between / 6) / (within / freedom)))
        chance *= count - 2 * _LEAST_SHOTS + 1
        if best is None or chance < best.chance:
            best = Moved(
                camera=camera,
                shot=int(shots[first]),
                step=means[1] - means[0],
                effect_px=float(np.sqrt(between / corners.sum())),
                chance=chance,
            )
    return best


def _said(names: Sequence[str], shots: Sequence[str], moved: Moved, scale: float) -> RigFinding:
    turn = float(np.rad2deg(np.linalg.norm(moved.step[:3])))
    shift = float(np.linalg.norm(moved.step[3:])) * scale
    whom = (names[moved.camera],) if len(names) > 2 else tuple(names)
    return RigFinding(
        code=Code.CAMERA_MOVED,
        severity=Severity.BAD,
        case="" if len(whom) == 1 else "either",
        cameras=whom,
        shots=(shots[moved.shot],),
        figures={"turn_deg": turn, "shift": shift, "effect_px": moved.effect_px},
    )


def _mismatched(
    names: Sequence[str],
    lens: RigLens,
    start: RigStart,
    photos: Sequence[str],
) -> list[RigFinding]:
    return [
        RigFinding(
            code=Code.SHOT_MISMATCHED,
            severity=Severity.BAD,
            cameras=(names[lens.camera[view]],),
            shots=(photos[view],),
            figures={"off_px": float(start.misfit[view])},
        )
        for view in np.flatnonzero(start.apart).tolist()
    ]


def _few(names: Sequence[str], lens: RigLens) -> list[RigFinding]:
    """Cameras whose strongest connection to the others is weak."""
    common = common_shots(lens, len(names))
    found: list[RigFinding] = []
    for camera, name in enumerate(names):
        others = np.delete(np.arange(len(names)), camera)
        best = int(others[np.argmax(common[camera, others])])
        shared = int(common[camera, others].sum())
        said = any({name, names[best]} == set(one.cameras) for one in found)
        if shared < _FEW and not said:
            found.append(
                RigFinding(
                    code=Code.FEW_COMMON_SHOTS,
                    severity=Severity.CARE,
                    cameras=(name, names[best]),
                    figures={"shots": float(shared), "wanted": float(_FEW - shared)},
                )
            )
    return found
