"""Cameras that stood elsewhere on the body from some shot on."""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.fitting.rig.evidence import Moved, RigEvidence
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.types import FloatArray, IntArray

# Shots on either side of where a camera may have moved.
_LEAST_SHOTS = 3
_RCOND = 1e-10
# A camera has moved where so little chance would show as much,
_CHANCE = 1e-5
# and what it does to its corners is as large as so much of their noise.
_VISIBLE = 0.5


def moved_camera(evidence: RigEvidence) -> Moved | None:
    """The camera that most clearly stood elsewhere before some shot than after; None if none did.

    What each shot says of each camera's place beside the others', its pose left free, is linear
    where the fit stopped. Two means, before and after, are judged against how shots differ
    among themselves (an F test), which knows of all errors that shots do not share.
    """
    cameras = range(len(evidence.lens.lenses))
    moved = [one for camera in cameras if (one := _split(evidence, camera))]
    best = min(moved, key=lambda one: (one.chance, -one.effect_px), default=None)
    if best is None or best.chance * len(cameras) > _CHANCE:
        return None
    return best if best.effect_px > _VISIBLE * noise_px(evidence.fit.residual) else None


def says(evidence: RigEvidence, camera: int) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """What shots say of one camera's place beside the others', their poses left free.

    Returns:
        Shots (S,) that others saw too, in order; Hessian (S, 6, 6), gradient (S, 6) by a step in
        the camera's frame, and how many corners the camera saw.

    """
    lens, (hessian, gradient, corners) = evidence.lens, evidence.of_views
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


def _split(evidence: RigEvidence, camera: int) -> Moved | None:
    """The shot from which on the camera stands elsewhere, if it does anywhere."""
    shots, hessian, gradient, corners = says(evidence, camera)
    count = len(shots)
    if count < 2 * _LEAST_SHOTS:
        return None
    by_steps = float(explained(hessian, gradient).sum())
    best, clearest = None, (1.0, 0.0)
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
        within = max(by_steps - by_means, 1e-300)
        freedom = 6 * (count - 2)
        chance = float(fdtrc(6, freedom, (between / 6) / (within / freedom)))
        chance *= count - 2 * _LEAST_SHOTS + 1
        if (chance, -between) < clearest:
            clearest = chance, -between
            # Where both sides are alike, the later one is how the rig is now.
            before = first <= count - first
            own = (evidence.lens.camera == camera) & np.isin(
                evidence.lens.shot, shots[sides[0] if before else sides[1]]
            )
            best = Moved(
                camera=camera,
                shot=evidence.shots[shots[first]],
                step=means[1] - means[0],
                effect_px=float(np.sqrt(between / corners.sum())),
                chance=chance,
                share=between / (between + within),
                apart=np.flatnonzero(own),
                before=before,
            )
    return best


def explained(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(S,) the squared error that a step of its own takes away in each shot."""
    both = zip(hessian, gradient, strict=True)
    return np.array([g @ np.linalg.lstsq(h, g, rcond=_RCOND)[0] for h, g in both])
