"""The way round in which photos show a target that looks the same after a turn.

A single photo does not show which end of such a board is which, so its corners' names are a guess.
The print does show it: corners are a little off their nominal places, and these deviations repeat
in all photos, one way round. If photos are named at random, the deviations average out and stay in
the residuals.

To first order, every photo pulls at the corners' places by its residuals, its pose fitted anew, in
one direction under the one name and in another under the other. Photos that are named rightly pull
together: the likelihood of a choice, with the corners' places left open, grows with the squared
length of the sum of all pulls, in the metric of their covariance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.solve.adjustment import State, linearise
from cubicfish.solve.normal_equations import NormalEquations
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import huber_px, noise_px
from cubicfish.target.observations import Observations
from cubicfish.target.placement import chosen, symmetries
from cubicfish.types import FloatArray, IntArray

# Expected deviation of corners, as a share of the target's typical extent.
_SPREAD = 1e-3
# A photo is renamed where that is likelier by this factor (its logarithm), given errors as large as
# its present residuals.
_LIKELIER = np.log(10.0)
# Corners that are exact to this, pixels, exert no pull.
_NO_ERROR = 1e-6
_STARTS = 30
_SWEEPS = 50


def oriented(fit: CameraFit) -> list[CameraFit]:
    """Fits with each photo named as given, and with photos named consistently with each other.

    Returns:
        The given fit, below the level ``points``; then, where other names are likelier, one with
        other names, and the poses that leave all corners where they were.

    """
    nominal, target = fit.nominal, fit.nominal.target
    motions = symmetries(target) if target else ()
    if not motions or target is None or noise_px(fit.residual) < _NO_ERROR:
        return [fit]
    pairs, poses, scale = nominal.pairs, fit.poses, nominal.scale
    namings = [pairs, *(one.named(pairs, target, scale) for one in motions)]
    turned = [poses, *(poses.of_moved(one.rotation, one.shift / scale) for one in motions)]
    way = _choose_likeliest(fit, namings, turned)
    # Photos with uncertain corners keep their names.
    way[pairs.image[~pairs.certain]] = 0
    if not way.any():
        return [fit]
    renamed = {pairs.images[photo]: motions[way[photo] - 1] for photo in np.flatnonzero(way)}
    nominal = replace(nominal, pairs=chosen(namings, way), renamed=renamed)
    return [fit, replace(fit, poses=Poses.chosen(turned, way), nominal=nominal)]


def _choose_likeliest(
    fit: CameraFit, namings: Sequence[Observations], turned: Sequence[Poses]
) -> IntArray:
    """Choose for each photo (M,) one of W namings; 0 where no other is surely better."""
    noise, count = noise_px(fit.residual), len(fit.residual)
    every = replace(fit.nominal, pairs=Observations.stacked(namings))
    free = every.free(noise=noise, offset_spread=_SPREAD).started(fit.world)
    pulls, squares = [], []
    metric = free.offset_weight**2 * np.eye(3 * len(free.offsets))
    for way, (pairs, poses) in enumerate(zip(namings, turned, strict=True)):
        world = free.select(np.arange(way * count, (way + 1) * count))
        pull, square, own = _measure_pulls(State(fit.lens, poses, world), pairs, fit)
        pulls.append(pull)
        squares.append(square)
        # The names of photos change the equations little: take those of all photos alike.
        metric += own / len(namings)
    each, square = np.stack(pulls, axis=1), np.stack(squares, axis=1)
    flat = each.reshape(-1, len(metric)).T
    unit = np.linalg.solve(np.linalg.cholesky(metric), flat).T.reshape(each.shape)
    choice = _choose_together(unit, square, 0)
    # A motion of all photos alike changes nothing: most photos keep the names that they have.
    kept = np.flatnonzero(choice == np.bincount(choice).argmax())[0]
    choice = _choose_together(unit, square, int(kept))
    photos = np.arange(len(choice))
    rest = unit[photos, choice].sum(axis=0) - unit[photos, choice]
    left = square - np.sum(np.square(rest[:, None] + unit), axis=2)
    # One photo's corners may be off by more than those of others.
    rows = 2 * np.bincount(namings[0].image, minlength=len(photos)) - 6
    variance = np.maximum(noise**2, square[:, 0] / np.maximum(rows, 1))
    surely = left[:, 0] - left[photos, choice] > 2 * _LIKELIER * variance
    return np.where(surely, choice, 0)


def _measure_pulls(
    state: State, pairs: Observations, fit: CameraFit
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measure how M photos pull at Q corners, with poses fitted anew.

    Returns:
        The pulls (M, 3Q); the squares (M,) of the residuals that no pose takes away; and the
        Hessian (3Q, 3Q) of all photos.

    """
    normal = NormalEquations.zeros(*state.size)
    pulls, square = (
        np.zeros((len(state.poses), *normal.corner.shape[:2])),
        np.zeros(len(state.poses)),
    )
    for run, terms in linearise(state, pairs, huber_px(fit.residual)):
        corner = state.world.corner[run]
        normal.add(terms, corner)
        # A photo sees each corner once, so no place comes twice.
        pulls[terms.pose, corner] = np.einsum("nji,nj->ni", terms.by_corner, terms.miss)
        square += np.bincount(terms.pose, np.sum(terms.miss**2, axis=1), len(square))
    across = normal.pose_corner.reshape(len(square), 6, -1)
    step = np.linalg.pinv(normal.pose, hermitian=True)
    moved = (step @ normal.pose_shared[:, :, -1:])[:, :, 0]
    square -= np.sum(moved * normal.pose_shared[:, :, -1], axis=1)
    flat = pulls.reshape(len(square), -1) - np.einsum("mij,mi->mj", across, moved)
    taken = across.reshape(-1, flat.shape[1]).T @ (step @ across).reshape(-1, flat.shape[1])
    own = np.arange(len(taken)).reshape(-1, 3)
    left = -taken
    left[own[:, :, None], own[:, None, :]] += normal.corner
    return flat, square, left


def _choose_together(pulls: FloatArray, square: FloatArray, kept: int) -> IntArray:
    """Choose for each photo (M,) one of its pulls (M, W, D) that leave the least squares (M, W).

    The squared length of the sum of pulls is subtracted from the squares. The search goes photo by
    photo, from many starts, as long as it improves; photo ``kept`` keeps its first name.
    """
    photos, ways, _ = pulls.shape
    every = np.arange(photos)
    choice = np.random.default_rng(0).integers(0, ways, (_STARTS, photos))
    choice[0] = 0
    choice[:, kept] = 0
    total = pulls[every, choice].sum(axis=1)
    for _ in range(_SWEEPS):
        before = choice.copy()
        for photo in np.delete(every, kept):
            own = pulls[photo]
            rest = total - own[choice[:, photo]]
            gain = 2 * rest @ own.T + np.sum(own * own, axis=1) - square[photo]
            choice[:, photo] = gain.argmax(axis=1)
            total = rest + own[choice[:, photo]]
        if (choice == before).all():
            break
    left = square[every, choice].sum(axis=1) - np.sum(total * total, axis=1)
    return np.asarray(choice[np.argmin(left)])
