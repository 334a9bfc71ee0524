"""Where a fit ends from other starts, under the prior and with the loss that it ended with.

These are the starts that it might have chosen (its own end, the nearest cubic, safer ones), and its
own end with lens, poses and target thrown off::

    own, others = ends(pairs, target, thrown=8)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cubicfish import Observations, Target
from cubicfish.errors import FitError
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.calibration import Evidence, FitEvidence
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.solve.adjustment import COLD_DAMPING, WARM_DAMPING, State, adjust
from cubicfish.solve.statistics import huber_px

# A narrow camera's optimum lies in a long valley that bends.
_STEPS = 1000
# By how far corners are thrown off, pixels; poses by so many radians, and this share of the way.
_THROWN_PX, _THROWN_POSE = (1.0, 5.0, 20.0), 0.02


def ends(pairs: Observations, target: Target | None, thrown: int) -> tuple[float, list[float]]:
    """The cost at which a camera's fit ends, and the costs that other starts lead to.

    Args:
        pairs: the pairs.
        target: the target.
        thrown: how many starts are thrown off.

    Returns:
        The cost of the fit; and those of other starts, infinite where one leads nowhere.

    """
    kept: list[FitEvidence] = []

    def keep(evidence: Evidence) -> tuple[()]:
        if isinstance(evidence, FitEvidence):
            kept.append(evidence)
        return ()

    calibrate(pairs, target=target, diagnose=keep)
    fit = kept[0].fit
    known = fit.prior.starts(fit.reference, fit, fit.errors)
    starts = [State(lens, poses, fit.world) for lens, poses in known]
    others = [_follow(fit, start, WARM_DAMPING) for start in starts]
    rng = np.random.default_rng(0)
    return fit.cost, others + [_follow(fit, _throw(fit, one, rng)) for one in range(thrown)]


def _throw(fit: CameraFit, number: int, rng: np.random.Generator) -> State:
    """The fit's end, thrown off; every second time the target is as drawn."""
    world, hessian = fit.world, fit.normal.shared[:, :-1]
    step = rng.normal(size=len(hessian)) / np.sqrt(np.maximum(np.diagonal(hessian), 1e-12))
    step *= _THROWN_PX[number % 3] * np.sqrt(len(fit.residual) / (step @ hessian @ step))
    if number % 2:
        world = replace(
            world, parameters=0 * world.parameters, offsets=np.zeros_like(world.offsets)
        )
        step[len(fit.lens.parameters) :] = 0
    far = np.linalg.norm(fit.poses.translation, axis=1)[:, None]
    pose = _THROWN_POSE * rng.normal(size=(len(far), 6)) * np.hstack([far**0] * 3 + [far] * 3)
    return State(fit.lens, fit.poses, world).moved(step, pose, np.zeros_like(world.offsets))


def _follow(fit: CameraFit, start: State, damping: float = COLD_DAMPING) -> float:
    """The cost at which a start ends."""
    pairs, limit = fit.reference.pairs, huber_px(fit.errors)
    try:
        first = adjust(start.lens, start.poses, pairs, limit, world=start.world, damping=damping)
        # Steps to the very bottom, from the best that was found.
        return adjust(
            first.lens,
            first.poses,
            pairs,
            fit.huber_px,
            world=first.world,
            max_iterations=_STEPS,
            damping=WARM_DAMPING,
        ).cost
    except (FitError, np.linalg.LinAlgError):
        return np.inf
