"""Cameras that stood elsewhere on the body from some shot on."""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.app.diagnosis.two_groups import best_cut
from cubicfish_cli.core.fit.robust import noise_px
from cubicfish_cli.core.types import FloatArray, IntArray
from cubicfish_cli.extensions.rigs.fit.evidence import Moved, RigEvidence

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
    pull, floor = -gradient, _RCOND * np.trace(hessian, axis1=1, axis2=2)
    weight = hessian + floor[:, None, None] * np.eye(6)
    found = best_cut(np.arange(len(shots))[None], weight, pull, _LEAST_SHOTS)
    if found is None:
        return None
    ratio, between, after = found
    sides = [(hessian[side].sum(axis=0), pull[side].sum(axis=0)) for side in (~after, after)]
    means = [np.linalg.lstsq(h, p, rcond=_RCOND)[0] for h, p in sides]
    cuts, freedom = len(shots) - 2 * _LEAST_SHOTS + 1, len(shots) - 2
    # Where both sides are alike, the later one is how the rig is now.
    before = 2 * int(after.sum()) >= len(shots)
    apart = np.isin(evidence.lens.shot, shots[~after if before else after])
    return Moved(
        camera=camera,
        shot=evidence.shots[shots[int(np.argmax(after))]],
        step=means[1] - means[0],
        effect_px=float(np.sqrt(between / corners.sum())),
        chance=float(fdtrc(6, 6 * freedom, ratio)) * cuts,
        share=ratio / (ratio + freedom),
        apart=np.flatnonzero((evidence.lens.camera == camera) & apart),
        before=before,
    )


def explained(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(S,) the squared error that a step of its own takes away in each shot."""
    both = zip(hessian, gradient, strict=True)
    return np.array([g @ np.linalg.lstsq(h, g, rcond=_RCOND)[0] for h, g in both])
