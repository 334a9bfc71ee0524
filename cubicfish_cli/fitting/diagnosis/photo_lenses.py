"""Whether all photos were taken through one lens, as every calibration takes for granted.

Beside the fitted camera and its own pose, each photo is given a lens of its own as far as one
photo can have one: another scale, another centre, and a shear that grows from row to row. All of
it is linear where the fit stopped, so it costs one pass over the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import comb
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.adjustment import FitLens, huber_weight
from cubicfish_cli.fitting.poses import Poses, cross_matrix
from cubicfish_cli.fitting.robust import huber_px

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]

# What a photo may have of its own: scale, shift x, shift y; and a shift x, y that grows by rows.
TERMS = 5
_LENS = slice(0, 3)
_SHEAR = slice(3, 5)
# Twice as many equations as unknowns, that are 6 of the pose and these.
_FEWEST_CORNERS = 12
# Two groups, or one photo, may look unlike the others by chance this often among right set-ups.
BY_CHANCE = 1e-6
# What is blamed must have been this share of the squared error, or it is not worth a word.
WORTH = 0.05
# A change in the photos' order is the simpler thing: any other split must be as much better.
_CLEARLY = 1.2
_FEWEST_IN_GROUP = 2
_LEAST_FOR_GROUPS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoLenses:
    """What each photo would have of its own, in pixels at ``reach`` from the centre.

    Attributes:
        photos: (K,) the photos with enough corners to tell.
        own: (K, 5) scale, shift x, shift y, shear x, shear y.
        information: (K, 5, 5) what it costs to be elsewhere: a squared error in pixels.
        squares: (K,) sum of squared errors of the photo with its own lens.
        numbers: (K,) how many free numbers are left in each photo.
        reach: half the shorter side, pixels.

    """

    photos: IntArray
    own: FloatArray
    information: FloatArray
    squares: FloatArray
    numbers: FloatArray
    reach: float

    def cost(self, own: FloatArray) -> FloatArray:
        """(K,) sum of squared errors of each photo if it had these (K, 5) or (5,) instead."""
        off = own - self.own
        return np.asarray(self.squares + np.einsum("ki,kij,kj->k", off, self.information, off))


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoLenses:
    """Photos that fall into two groups, each with a lens of its own.

    Attributes:
        second: (K,) which of ``PhotoLenses.photos`` are in the smaller or later group.
        kind: ``order`` where the lens changed once in the order of the photos, else ``mixed``.
        chance: how often so clear a split would be found among photos through one lens.
        own: (2, 3) scale, shift x, shift y of both groups, pixels.

    """

    second: BoolArray
    kind: Literal["order", "mixed"]
    chance: float
    own: FloatArray


@dataclass(frozen=True, kw_only=True)
class Unlike:
    """How one photo differs from the others.

    Attributes:
        photo: its index.
        chance: how often the most unlike of so many right photos would be as unlike.
        size_px: how large the difference is at ``reach`` from the centre, pixels.
        share: of the photo's squared error that it explains.

    """

    photo: int
    chance: float
    size_px: float
    share: float


def photo_lenses(
    lens: FitLens, poses: Poses, pairs: Correspondences, world: FloatArray
) -> PhotoLenses:
    """What each photo would have of its own.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit.
        world: (N, 3) their world points, as fitted.

    """
    rotated = (poses.rotation[pairs.image] @ world[:, :, None])[:, :, 0]
    pixel, d_point, _ = lens.project_jacobian(rotated + poses.translation[pairs.image])
    miss = pairs.pixel - pixel
    middle = (np.array(pairs.image_size, float) - 1) / 2
    reach = min(pairs.image_size) / 2
    from_middle = (pixel - middle) / reach
    jacobian = np.zeros((len(pixel), 2, 6 + TERMS))
    jacobian[:, :, :3] = -d_point @ cross_matrix(rotated)
    jacobian[:, :, 3:6] = d_point
    jacobian[:, :, 6] = from_middle
    jacobian[:, 0, 7] = jacobian[:, 1, 8] = 1
    jacobian[:, 0, 9] = jacobian[:, 1, 10] = from_middle[:, 1]
    # The loss of the fit: grossly wrong corners must not speak for a photo.
    weight = pairs.weight * huber_weight(np.hypot(miss[:, 0], miss[:, 1]), huber_px(-miss))
    photos, found, information, squares, numbers = [], [], [], [], []
    starts = np.searchsorted(pairs.image, np.arange(len(pairs.images) + 1))
    for photo, (first, stop) in enumerate(pairwise(starts)):
        if stop - first < _FEWEST_CORNERS:
            continue
        root = np.sqrt(weight[first:stop])
        rows = (jacobian[first:stop] * root[:, None, None]).reshape(-1, 6 + TERMS)
        right = (miss[first:stop] * root[:, None]).reshape(-1)
        basis = np.linalg.qr(rows[:, :6])[0]
        free = rows[:, 6:] - basis @ (basis.T @ rows[:, 6:])
        right = right - basis @ (basis.T @ right)
        own, _, _, _ = np.linalg.lstsq(free, right, rcond=1e-9)
        photos.append(photo)
        found.append(own)
        information.append(free.T @ free)
        squares.append(float(np.sum((right - free @ own) ** 2)))
        numbers.append(2.0 * (stop - first) - 6 - TERMS)
    return PhotoLenses(
        photos=np.array(photos, np.intp),
        own=np.array(found).reshape(-1, TERMS),
        information=np.array(information).reshape(-1, TERMS, TERMS),
        squares=np.array(squares),
        numbers=np.array(numbers),
        reach=reach,
    )


def two_lenses(photos: PhotoLenses) -> TwoLenses | None:
    """The split of the photos into two groups that explains best how their lenses differ.

    What differs within the groups is the measure of what differs between them (an F test), so
    that whatever else is imperfect, an object that bends or a lens that the model cannot follow,
    counts against it. Splits are corrected for how many there are: along the photos' order, or
    by any plane through the space of scale and centre (Cover, 1965).

    Returns:
        None where there are too few photos to tell.

    """
    count = len(photos.photos)
    if count < _LEAST_FOR_GROUPS:
        return None
    own, weight = photos.own[:, _LENS], _without_shear(photos.information)
    in_order = _best([np.arange(count) >= cut for cut in range(1, count)], own, weight)
    mixed = _best(_sorted_splits(own, weight), own, weight)
    trials = {"order": count - 1, "mixed": sum(comb(count - 1, k) for k in range(4))}
    chosen: tuple[float, Literal["order", "mixed"], BoolArray] | None = None
    kinds: tuple[Literal["order", "mixed"], ...] = ("order", "mixed")
    for kind, found in zip(kinds, (in_order, mixed), strict=True):
        if found is not None and (chosen is None or found[0] > _CLEARLY * chosen[0]):
            chosen = (found[0], kind, found[1])
    if chosen is None:
        return None
    ratio, kind, second = chosen
    if kind == "mixed" and 2 * second.sum() > count:
        second = ~second
    return TwoLenses(
        second=second,
        kind=kind,
        chance=float(fdtrc(3, 3 * (count - 2), ratio)) * trials[kind],
        own=np.stack([_mean(own[part], weight[part]) for part in (~second, second)]),
    )


def sheared_photos(photos: PhotoLenses) -> list[Unlike]:
    """Photos that are sheared from the first row to the last, as no lens and no pose does."""
    return _unlike(photos, _SHEAR)


def zoomed_photos(photos: PhotoLenses) -> list[Unlike]:
    """Single photos with another scale or centre than the others."""
    return _unlike(photos, _LENS)


def _unlike(photos: PhotoLenses, terms: slice) -> list[Unlike]:
    """How much less like the others each photo is in some terms than those are like each other.

    One for each of ``photos.photos``; none where they are too few to tell.
    """
    count = len(photos.photos)
    if count < _LEAST_FOR_GROUPS:
        return []
    weight = _marginal(photos.information, terms)
    own = photos.own[:, terms]
    size = own.shape[1]
    noise = np.median(photos.squares / np.maximum(photos.numbers, 1))
    typical = np.median(own, axis=0)
    off = own - typical
    distance = np.einsum("ki,kij,kj->k", off, weight, off) / (size * noise)
    # What the photos' own terms are beyond noise, by the better half of them.
    spread = max(1.0, float(np.median(distance)))
    chance = fdtrc(size, np.maximum(photos.numbers, 1), distance / spread) * count
    worth = np.einsum("ki,kij,kj->k", off, weight, off)
    return [
        Unlike(
            photo=int(photos.photos[index]),
            chance=float(chance[index]),
            size_px=float(np.linalg.norm(off[index])),
            share=float(worth[index] / (worth[index] + photos.squares[index] + 1e-300)),
        )
        for index in range(count)
    ]


def _marginal(information: FloatArray, terms: slice) -> FloatArray:
    """Information on some terms with the others free: a Schur complement a photo."""
    rest = np.setdiff1d(np.arange(TERMS), np.arange(TERMS)[terms])
    kept = np.arange(TERMS)[terms]
    inner = information[:, rest[:, None], rest]
    cross = information[:, kept[:, None], rest]
    floor = 1e-9 * np.trace(inner, axis1=1, axis2=2)[:, None, None] * np.eye(len(rest))
    return np.asarray(
        information[:, kept[:, None], kept]
        - cross @ np.linalg.solve(inner + floor, cross.transpose(0, 2, 1))
    )


def _without_shear(information: FloatArray) -> FloatArray:
    weight = _marginal(information, _LENS)
    floor = 1e-9 * np.trace(weight, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.asarray(weight + floor)


def _mean(own: FloatArray, weight: FloatArray) -> FloatArray:
    right = np.einsum("kij,kj->i", weight, own)
    return np.asarray(np.linalg.solve(weight.sum(axis=0), right))


def _scatter(own: FloatArray, weight: FloatArray) -> float:
    off = own - _mean(own, weight)
    return float(np.einsum("ki,kij,kj->", off, weight, off))


def _best(
    splits: list[BoolArray], own: FloatArray, weight: FloatArray
) -> tuple[float, BoolArray] | None:
    """The split with the largest ratio of what is between to what is within its groups."""
    total, count = _scatter(own, weight), len(own)
    best: tuple[float, BoolArray] | None = None
    for second in splits:
        if min(second.sum(), count - second.sum()) < _FEWEST_IN_GROUP:
            continue
        within = _scatter(own[second], weight[second]) + _scatter(own[~second], weight[~second])
        within = max(within, 1e-12 * total, 1e-300)
        ratio = (total - within) / within * (count - 2)
        if best is None or ratio > best[0]:
            best = (ratio, second)
    return best


def _sorted_splits(own: FloatArray, weight: FloatArray) -> list[BoolArray]:
    """Splits by planes across each axis of the photos' scatter."""
    root = np.linalg.cholesky(np.median(weight, axis=0))
    white = own @ root
    white = white - np.median(white, axis=0)
    axes = np.linalg.svd(white, full_matrices=False)[2]
    splits = []
    for along in (*(white @ axes.T).T, *own.T):
        order = np.argsort(along, kind="stable")
        place = np.empty(len(order), np.intp)
        place[order] = np.arange(len(order))
        splits += [place >= cut for cut in range(1, len(order))]
    return splits
