"""Whether all photos were taken through one lens, as every calibration takes for granted.

Beside the fitted camera and its own pose, each photo is given a lens of its own as far as one
photo can have one: another scale, another centre, and a shear that grows from row to row. All of
it is linear where the fit stopped, so it costs one pass over the corners.

Photos that differ from each other without falling into groups: what changed between all of them.

A loose sheet bends anew in every photo, autofocus moves the lens along its axis and optical
stabilisation across it. Each is fitted to every photo beside the camera, to first order, and the
one that explains most is named. None makes a camera wrong: it is a mean of all photos.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import comb
from typing import Literal

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.linearise import huber_weight
from cubicfish_cli.fitting.normal_equations import runs_of_photos
from cubicfish_cli.fitting.poses import Poses, cross_matrix
from cubicfish_cli.fitting.refinement import TargetFit
from cubicfish_cli.fitting.robust import wide_px
from cubicfish_cli.fitting.subset import flatness, select_photos
from cubicfish_cli.fitting.two_groups import best_cut
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

_FEWEST = 30
_SHARE = 0.05
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


def enough_photos(count: int) -> int:
    """So many of ``count`` photos are looked at first: all of few, a small share of many."""
    return min(count, max(_FEWEST, round(_SHARE * count)))


def spread_out(photos: IntArray, most: int) -> IntArray:
    """At most so many of some photos, from all parts of their order."""
    if len(photos) <= most:
        return photos
    return photos[np.linspace(0, len(photos) - 1, most).round().astype(np.intp)]


def fit_of_few(fit: TargetFit, photos: IntArray) -> TargetFit:
    """The same fit with the poses, pairs and residuals of some photos only.

    Args:
        fit: of all photos, of any level; the target keeps the points that it has.
        photos: increasing indices of photos.

    """
    own = np.isin(fit.reference.pairs.image, photos)
    reference = replace(
        fit.reference,
        pairs=select_photos(fit.reference.pairs, photos),
        poses=fit.reference.poses[photos],
        residual=fit.reference.residual[own],
    )
    adjusted = fit.cubic.fit
    adjusted = replace(
        adjusted, poses=adjusted.poses[photos], residual=adjusted.residual[own], sums=None
    )
    cubic = replace(fit.cubic, fit=adjusted)
    return replace(fit, reference=reference, cubic=cubic)


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


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoLenses:
    """Photos that fall into two groups, each with a lens of its own.

    Attributes:
        second: (K,) which of ``PhotoLenses.photos`` are in the smaller or later group.
        kind: ``order`` where the lens changed once in the order of the photos, else ``mixed``.
        chance: how often so clear a split would be found among photos through one lens.
        own: (2, 3) scale, shift x, shift y of both groups, pixels.
        share: of all photos' squared error that the two lenses explain, beside one for all.
        explained: share of how the photos' own lenses differ that two lenses explain, however many
            corners say so: all of it where there are two, and about half where every photo has one
            of its own, since photos can always be sorted into two groups.

    """

    second: BoolArray
    kind: Literal["order", "mixed"]
    chance: float
    own: FloatArray
    share: float
    explained: float


@dataclass(frozen=True, kw_only=True)
class Unlike:
    """How one photo differs from the others.

    Attributes:
        photo: its index.
        chance: how often the most unlike of so many right photos would be as unlike.
        size_px: how large the difference is at ``reach`` from the centre, pixels.
        share: of the photo's squared error that it explains.
        gain_px: RMS of what it explains, pixels.

    """

    photo: int
    chance: float
    size_px: float
    share: float
    gain_px: float


def photo_lenses(
    lens: FitLens, poses: Poses, pairs: Observations, world: FloatArray
) -> PhotoLenses:
    """What each photo would have of its own.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit.
        world: (N, 3) their world points, as fitted.

    """
    photos, triangles = own_triangles(lens, poses, pairs, world, _shear)
    free = triangles[:, :-1, :-1]
    own = np.linalg.pinv(free, rcond=1e-9) @ triangles[:, :-1, -1:]
    off = triangles[:, :, -1:] - np.pad(free, ((0, 0), (0, 1), (0, 0))) @ own
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    return PhotoLenses(
        photos=photos,
        own=own[:, :, 0],
        information=free.transpose(0, 2, 1) @ free,
        squares=np.sum(off[:, :, 0] ** 2, axis=1),
        numbers=np.asarray(2.0 * counts[photos] - 6 - TERMS, float),
        reach=min(pairs.image_size) / 2,
    )


def own_triangles(
    lens: FitLens,
    poses: Poses,
    pairs: Observations,
    world: FloatArray,
    more: Callable[[slice, FloatArray, FloatArray], FloatArray],
) -> tuple[IntArray, FloatArray]:
    """All that there is to know of what each photo has of its own, beyond its pose.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit.
        world: (N, 3) their world points, as fitted.
        more: terms (n, 2, M) beside scale and shift, for a run of corners, the derivatives
            (n, 2, 3) of their pixels by their points, and their pixels (n, 2) from the middle in
            halves of the shorter side.

    Returns:
        (K,) the photos with enough corners to tell, and (K, 4 + M, 4 + M) triangles (QR) of scale,
        shift x, shift y, more, and the miss: what the pose explains is taken out.

    """
    rows = []
    # In runs: the derivatives by the lens, that come with those by the point, are many.
    for _, run in runs_of_photos(pairs.image, len(pairs.images)):
        rows.append(_linearised(lens, poses, pairs, world, run, more))
    rows_of_all = np.concatenate(rows)
    # The loss of the fit: grossly wrong corners must not speak for a photo.
    miss = rows_of_all[:, :, -1]
    weight = pairs.weight * huber_weight(np.hypot(miss[:, 0], miss[:, 1]), wide_px(miss))
    rows_of_all *= np.sqrt(weight)[:, None, None]
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    stops, size = np.cumsum(counts), rows_of_all.shape[2]
    photos = np.flatnonzero(counts >= _FEWEST_CORNERS)
    triangles = np.empty((len(photos), size - 6, size - 6))
    for place, photo in enumerate(photos):
        own = rows_of_all[stops[photo] - counts[photo] : stops[photo]].reshape(-1, size)
        triangles[place] = np.asarray(np.linalg.qr(own, mode="r"))[6:, 6:]
    return photos.astype(np.intp), triangles


def _linearised(
    lens: FitLens,
    poses: Poses,
    pairs: Observations,
    world: FloatArray,
    run: slice,
    more: Callable[[slice, FloatArray, FloatArray], FloatArray],
) -> FloatArray:
    """(n, 2, 10 + M) derivatives by pose, scale, shift and more, and the miss, all in pixels."""
    image = pairs.image[run]
    rotated = (poses.rotation[image] @ world[run, :, None])[:, :, 0]
    pixel, d_point, _ = lens.project_jacobian(rotated + poses.translation[image])
    middle = (np.array(pairs.image_size, float) - 1) / 2
    from_middle = (pixel - middle) / (min(pairs.image_size) / 2)
    return np.concatenate(
        [
            -d_point @ cross_matrix(rotated),
            d_point,
            from_middle[:, :, None],
            np.broadcast_to(np.eye(2), (len(pixel), 2, 2)),
            more(run, d_point, from_middle),
            (pairs.pixel[run] - pixel)[:, :, None],
        ],
        axis=2,
    )


def _shear(run: slice, d_point: FloatArray, from_middle: FloatArray) -> FloatArray:
    """A shift that grows from row to row."""
    return from_middle[:, 1, None, None] * np.eye(2)


def two_lenses(photos: PhotoLenses) -> TwoLenses | None:
    """The split of the photos into two groups that explains best how their lenses differ.

    What differs within the groups is the measure of what differs between them (an F test), so
    that whatever else is imperfect, a target that bends or a lens that the model cannot follow,
    counts against it. Splits are corrected for how many there are: along the photos' order, or
    by any plane through the space of scale and centre (Cover, 1965).

    Returns:
        None where there are too few photos to tell.

    """
    count = len(photos.photos)
    if count < _LEAST_FOR_GROUPS:
        return None
    own, weight = photos.own[:, _LENS], _without_shear(photos.information)
    off = own - _mean(own, weight)
    pull = (weight @ off[:, :, None])[:, :, 0]
    in_order = best_cut(np.arange(count)[None], weight, pull, _FEWEST_IN_GROUP)
    mixed = best_cut(_sorted_along(own, weight), weight, pull, _FEWEST_IN_GROUP)
    trials = {"order": count - 1, "mixed": sum(comb(count - 1, k) for k in range(4))}
    if in_order is None or mixed is None:
        return None
    kind: Literal["order", "mixed"] = "mixed" if mixed[0] > _CLEARLY * in_order[0] else "order"
    ratio, between, second = mixed if kind == "mixed" else in_order
    if kind == "mixed" and 2 * second.sum() > count:
        second = ~second
    return TwoLenses(
        second=second,
        kind=kind,
        chance=float(fdtrc(3, 3 * (count - 2), ratio)) * trials[kind],
        own=np.stack([_mean(own[part], weight[part]) for part in (~second, second)]),
        share=between / (_scatter(own, weight) + float(photos.squares.sum()) + 1e-300),
        explained=ratio / (ratio + count - 2),
    )


def left_out_share(photos: PhotoLenses, second: BoolArray) -> float:
    """How much larger the squared error is of photos that had no say in their group's lens.

    Each photo in turn is given the scale and centre of the others of its group.

    Args:
        photos: what each photo has of its own.
        second: (K,) which are in the second group.

    Returns:
        The squared error over that with lenses that follow from all photos; 1 or more.

    """
    own, weight = photos.own[:, _LENS], _without_shear(photos.information)
    pull = (weight @ own[:, :, None])[:, :, 0]
    known = unknown = float(photos.squares.sum()) + 1e-300
    for group in (np.flatnonzero(~second), np.flatnonzero(second)):
        known += _scatter(own[group], weight[group])
        if len(group) < _FEWEST_IN_GROUP:
            continue
        others = weight[group].sum(axis=0) - weight[group]
        means = np.linalg.solve(others, (pull[group].sum(axis=0) - pull[group])[:, :, None])
        off = own[group] - means[:, :, 0]
        unknown += float(np.einsum("ki,kij,kj->", off, weight[group], off))
    return unknown / known


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
    noise = photos.squares / np.maximum(photos.numbers, 1)
    # A photo in dim light is noisier than the others, and nothing else.
    noise = np.maximum(noise, np.median(noise))
    typical = np.median(own, axis=0)
    off = own - typical
    distance = np.einsum("ki,kij,kj->k", off, weight, off) / (size * noise)
    # What the photos' own terms are beyond noise, by the better half of them.
    spread = max(1.0, float(np.median(distance)))
    # The noise, 1, is known from all corners; what is beyond it is told by the better half of the
    # photos (Satterthwaite 1946).
    told = size * count / 2 * (spread / max(spread - 1, 1e-6)) ** 2
    chance = fdtrc(size, np.clip(photos.numbers, 1, told), distance / spread) * count
    worth = np.einsum("ki,kij,kj->k", off, weight, off)
    return [
        Unlike(
            photo=int(photos.photos[index]),
            chance=float(chance[index]),
            size_px=float(np.linalg.norm(off[index])),
            gain_px=float(np.sqrt(2 * worth[index] / max(photos.numbers[index], 1))),
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


def _sorted_along(own: FloatArray, weight: FloatArray) -> IntArray:
    """(6, K) the photos sorted along the axes of their scatter: cuts are planes across them."""
    # A mean to which each photo adds alike; medians of single entries need not be a matrix of this
    # kind.
    root = np.linalg.cholesky(
        np.mean(weight / np.trace(weight, axis1=1, axis2=2)[:, None, None], 0)
    )
    white = own @ root
    white = white - np.median(white, axis=0)
    axes = np.linalg.svd(white, full_matrices=False)[2]
    along = np.concatenate([white @ axes.T, own], axis=1)
    return np.argsort(along, axis=0, kind="stable").T


_FEWEST_PHOTOS = 5
# What changes takes this share of the mean squared error away, free numbers counted.
_CLEAR_MARGIN = 0.4
# In so many photos it must do so in each; in some, what changes is as in the mean by chance.
_MANY = 0.4
# Pixels of a photo of 2000 from which on it is worth a word.
_NOTICED_PX, _SIDE = 0.1, 2000.0
_FLAT = 1e-3  # a refined sheet is bent a little


def unsteady(fit: TargetFit) -> list[Finding]:
    """What seems to change from photo to photo, as a note; empty where nothing clearly does."""
    pairs, poses = fit.reference.pairs, fit.cubic.poses
    world = fit.cubic.fit.world.points
    flat = flatness(world) < _FLAT
    bend = _bends(world) if flat else np.zeros((len(world), 3, 0))

    def bent(run: slice, d_point: FloatArray, _: FloatArray) -> FloatArray:
        return np.asarray(d_point @ poses.rotation[pairs.image[run]] @ bend[run])

    photos, triangles = own_triangles(fit.cubic.lens, poses, pairs, world, bent)
    if len(photos) < _FEWEST_PHOTOS:
        return []
    terms = {Code.AUTOFOCUS: slice(0, 1), Code.STABILISATION: slice(1, 3)}
    if flat:
        terms[Code.SHEET_BENDS] = slice(3, 6)
    equations = 2 * np.bincount(pairs.image, minlength=len(pairs.images))[photos] - 6
    before = np.sum(triangles[:, :, -1] ** 2, axis=1)
    squares = {cause: np.zeros(len(photos)) for cause in terms}
    for place, left in enumerate(triangles):
        for cause, columns in terms.items():
            step = np.linalg.lstsq(left[:, columns], left[:, -1], rcond=1e-9)[0]
            squares[cause][place] = np.sum((left[:, -1] - left[:, columns] @ step) ** 2)
    variance = float(before.sum() / equations.sum())
    left_free = {cause: equations - (one.stop - one.start) for cause, one in terms.items()}
    each = {cause: float(squares[cause].sum() / left_free[cause].sum()) for cause in terms}
    cause = min(each, key=lambda one: each[one])
    change_px = float(np.sqrt(2 * max(variance - each[cause], 0.0)))
    # In many photos, not in a few that are odd.
    own_share = squares[cause] / left_free[cause] * equations / np.maximum(before, 1e-300)
    if max(each[cause] / variance, float(np.quantile(own_share, _MANY))) > 1 - _CLEAR_MARGIN:
        return []
    if change_px < _NOTICED_PX * max(1.0, max(pairs.image_size) / _SIDE):
        return []
    told = Finding(
        code=cause,
        figures={
            "size_px": change_px,
            "before_px": float(np.sqrt(2 * variance)),
            "after_px": float(np.sqrt(2 * each[cause])),
        },
    )
    return [told]


def _bends(world: FloatArray) -> FloatArray:
    """(N, 3, 3) how the points of a flat board move when it bends in three ways: x², xy and y²."""
    off = world - world.mean(axis=0)
    axes = np.linalg.svd(off, full_matrices=False)[2]
    plane = off @ axes[:2].T
    x, y = (plane / np.abs(plane).max(axis=0)).T
    return np.asarray(axes[2][None, :, None] * np.stack([x * x, x * y, y * y], axis=-1)[:, None])
