"""Which way round photos show a target that looks the same after a turn.

No photo says which end of such a board is which, so the names of its corners are a guess in each.
The print says it: corners are a little off their drawn places, and that repeats in all photos, one
way round. Named at random, what corners are off by is averaged away and stays in the residuals.

To first order, every photo pulls at the corners' places by its residuals, its pose fitted anew, in
one direction by the one name and in another by the other. What is named rightly pulls together: the
likelihood of a choice, with lens, shapes and places left open, grows with the squared length of the
sum of all pulls, in the metric of their covariance.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular

from cubicfish_cli.core.fit.adjustment import State, linearise
from cubicfish_cli.core.fit.cubic_fit import CameraFit
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.normal_equations import summed_by
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.refinement import NominalTarget, free_target
from cubicfish_cli.core.fit.statistics import huber_px, noise_px
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.placement import Symmetry, chosen, symmetries
from cubicfish_cli.core.types import FloatArray, IntArray

# What corners may be off by, as a share of the target's typical extent, and in that: the likeliest
# is taken.
_SPREAD = 1e-4
_SPREADS = (1.0, 3.0, 10.0, 30.0)
# A photo is named otherwise where that is more likely by this factor, its errors as large as its
# residuals are now.
_LIKELIER = np.log(10.0)
_ROUNDING = 1e-10
_LEAST_PULL, _LEAST_NOISE = 1e-9, 1e-9
_STARTS = 30
_SWEEPS = 50


def oriented(fit: CameraFit, nominal: NominalTarget) -> list[tuple[CameraFit, NominalTarget]]:
    """A fit and its drawing, and again with each photo named as goes with the other photos.

    Args:
        fit: below the level ``points``.
        nominal: the target as drawn, with the pairs of ``fit``.

    Returns:
        The two that were given; then, where other names are likelier, those with other names and
        the poses that leave all corners where they were.

    """
    given, target = (fit, nominal), nominal.target
    motions = symmetries(target) if target else ()
    if not motions or target is None:
        return [given]
    pairs, poses, scale = nominal.pairs, fit.poses, nominal.scale
    namings = [pairs, *(one.named(pairs, target, scale) for one in motions)]
    turned = [poses, *(poses.of_moved(one.rotation, one.shift / scale) for one in motions)]
    try:
        way = _choose_likeliest(fit, nominal, namings, turned, _multiply_motions(motions))
    except np.linalg.LinAlgError:  # corners without any error: nothing pulls
        return [given]
    # What may be another corner altogether is left as it is.
    way[pairs.image[~pairs.certain]] = 0
    if not way.any():
        return [given]
    for number, views in enumerate(turned):
        photos = np.flatnonzero(way == number)
        poses = poses.with_photos(photos, views[photos])
    renamed = {pairs.images[photo]: motions[way[photo] - 1] for photo in np.flatnonzero(way)}
    other = replace(fit, poses=poses)
    return [given, (other, replace(nominal, pairs=chosen(namings, way), renamed=renamed))]


def _multiply_motions(motions: Sequence[Symmetry]) -> IntArray:
    """(W, W) which way one way after another is; the first is to stay."""
    forms = np.tile(np.eye(4), (len(motions) + 1, 1, 1))
    for form, motion in zip(forms[1:], motions, strict=True):
        form[:3, :3], form[:3, 3] = motion.rotation, motion.shift
    both = forms[:, None] @ forms
    apart = np.abs(both[:, :, None] - forms).max(axis=(-2, -1))
    return np.asarray(apart.argmin(axis=-1))


def _choose_likeliest(
    fit: CameraFit,
    nominal: NominalTarget,
    namings: Sequence[Observations],
    turned: Sequence[Poses],
    products: IntArray,
) -> IntArray:
    """(M,) which of W ways each photo is named in, 0 where no other is surely better."""
    noise, count = noise_px(fit.residual), len(nominal.pairs.image)
    every = replace(nominal, pairs=Observations.stacked(namings))
    free = free_target(every, noise=noise, offset_spread=_SPREAD).started(fit.world)
    pulls = [
        _measure_pulls(fit, pairs, poses, free.select(np.arange(way * count, (way + 1) * count)))
        for way, (pairs, poses) in enumerate(zip(namings, turned, strict=True))
    ]
    each = np.stack([gradient for gradient, _, _ in pulls], axis=1)
    square = np.stack([own for _, _, own in pulls], axis=1)
    # By what names photos are seen changes the equations little: they are those of all alike.
    hessian = np.mean([own for _, own, _ in pulls], axis=0)
    lens = len(fit.lens.parameters)
    shared, held = lens + len(free.parameters), np.zeros(len(hessian))
    of_lens, of_boards = fit.lens.prior(), free.prior()
    for own, prior in ((slice(0, lens), of_lens), (slice(lens, shared), of_boards)):
        hessian[own, own] += prior[:-1, :-1]
        held[own] += prior[:-1, -1]
    flat = np.vstack([held, each.reshape(-1, len(held))]).T
    tried = []
    for spread in _SPREADS:
        pull = np.full(len(held) - shared, max(free.offset_weight / spread, _LEAST_PULL))
        pulled = hessian + np.diag(np.append(np.zeros(shared), pull**2))
        unit = np.sqrt(np.diagonal(pulled))
        root = np.linalg.cholesky(pulled / np.outer(unit, unit) + _ROUNDING * np.eye(len(held)))
        length = solve_triangular(root, flat / unit[:, None], lower=True).T
        found = _choose_together(length[0], length[1:].reshape(*each.shape), square, products)
        likely = -found[2] / (2 * max(free.noise, _LEAST_NOISE) ** 2) + np.log(pull).sum()
        tried.append((likely - np.log(np.diagonal(root) * unit).sum(), found))
    choice, gain, _ = max(tried, key=lambda one: one[0])[1]
    # One photo's corners may be off by more than those of others.
    rows = 2 * np.bincount(nominal.pairs.image, minlength=len(fit.poses)) - 6
    variance = np.maximum(noise**2, square[:, 0] / np.maximum(rows, 1))
    return np.where(gain > 2 * _LIKELIER * variance, choice, 0)


def _measure_pulls(
    fit: CameraFit, pairs: Observations, poses: Poses, world: DeformableTarget
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What M photos put into the normal equations, their poses eliminated.

    D unknowns: the lens's parameters, the boards', three coordinates of each free corner.

    Returns:
        The gradients (M, D); the Hessian (D, D) of all photos; and the squares (M,) of the
        residuals that no pose takes away.

    """
    moved = State(fit.lens, poses, world)
    seen = [terms for _, terms in linearise(moved, pairs, huber_px(fit.residual))]
    left = np.concatenate([np.dstack([one.by_shared, one.miss]) for one in seen])
    by_pose, by_corner = (
        np.concatenate([getattr(one, name) for one in seen]) for name in ("by_pose", "by_corner")
    )
    shared, photos, corners = moved.size
    basis = np.zeros_like(by_pose)
    of_shared, square = np.zeros((photos, shared)), np.zeros(photos)
    bounds = np.searchsorted(pairs.image, np.arange(photos + 1))
    for photo, (first, stop) in enumerate(pairwise(bounds)):
        unit, _ = np.linalg.qr(by_pose[first:stop].reshape(-1, 6))
        basis[first:stop, :, : unit.shape[1]] = unit.reshape(stop - first, 2, -1)
        flat = left[first:stop].reshape(-1, shared + 1)
        flat -= unit @ (unit.T @ flat)
        of_shared[photo] = flat[:, :-1].T @ flat[:, -1]
        square[photo] = flat[:, -1] @ flat[:, -1]
    # A photo sees each corner once, so no place comes twice.
    of_corner, of_pose = np.zeros((photos, corners, 3)), np.zeros((photos, 6, corners, 3))
    of_corner[pairs.image, world.corner] = np.einsum("nji,nj->ni", by_corner, left[:, :, -1])
    of_pose[pairs.image, :, world.corner] = np.einsum("njk,nji->nki", basis, by_corner)
    turned = of_pose.reshape(6 * photos, 3 * corners)
    flat = left.reshape(-1, shared + 1)[:, :-1]
    hessian = np.zeros((shared + 3 * corners,) * 2)
    hessian[:shared, :shared] = flat.T @ flat
    cross = summed_by(world.corner, corners, by_corner, left[:, :, :-1])
    hessian[shared:, :shared] = cross.reshape(-1, shared)
    hessian[:shared, shared:] = hessian[shared:, :shared].T
    hessian[shared:, shared:] = -turned.T @ turned
    own = summed_by(world.corner, corners, by_corner, by_corner)
    places = shared + np.arange(3 * corners).reshape(corners, 3)
    hessian[places[:, :, None], places[:, None, :]] += own
    gradient = np.concatenate([of_shared, of_corner.reshape(photos, -1)], axis=1)
    return gradient, hessian, square


def _choose_together(
    held: FloatArray, pulls: FloatArray, square: FloatArray, products: IntArray
) -> tuple[IntArray, FloatArray, float]:
    """Those of pulls (M, W, D) that leave the least of squares (M, W), with another pull (D,).

    They take the square of their sum away. Photo by photo from many starts, as far as it goes.

    Returns:
        Which of each photo's (M,); by how much more is left with the first of a photo's (M,); and
        what is left of all squares.

    """
    photos, ways, _ = pulls.shape
    every = np.arange(photos)
    choice = np.random.default_rng(0).integers(0, ways, (_STARTS, photos))
    choice[0] = 0
    total = held + pulls[every, choice].sum(axis=1)
    for _ in range(_SWEEPS):
        before = choice.copy()
        for photo, own in enumerate(pulls):
            rest = total - own[choice[:, photo]]
            gain = 2 * rest @ own.T + np.sum(own * own, axis=1) - square[photo]
            choice[:, photo] = gain.argmax(axis=1)
            total = rest + own[choice[:, photo]]
        if (choice == before).all():
            break
    left = square[every, choice].sum(axis=1) - np.sum(total * total, axis=1)
    # A motion of all photos alike is none: of these, the nearest to the names that are given.
    alike = products[:, choice[np.argmin(left)]]
    best = alike[np.argmin(np.count_nonzero(alike, axis=1))]
    rest = held + pulls[every, best].sum(axis=0) - pulls[every, best]
    each = square - np.sum(np.square(rest[:, None] + pulls), axis=2)
    return best, each[:, 0] - each[every, best], float(left.min())
