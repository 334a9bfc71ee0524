"""Photos through two lenses, all of one zoomed, cropped, scaled or turned, or of another camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import comb
from typing import Literal

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.app.diagnosis.other_lens import LensChange, lens_change
from cubicfish_cli.app.diagnosis.photo_lenses import (
    BY_CHANCE,
    FEWEST_TOLD_APART,
    LENS,
    ROUGH_DECREASE,
    WORTH,
    PhotoLenses,
    best_cut,
    lenses_of,
    mean_of,
    noticed_px,
)
from cubicfish_cli.core.assess.uncertainty import CERTAIN_PX, UncertaintyGrid
from cubicfish_cli.core.codes import Severity
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.calibration import FitEvidence
from cubicfish_cli.core.fit.cubic_fit import fit_cubic
from cubicfish_cli.core.fit.radial_reference import refit_radial
from cubicfish_cli.core.fit.refinement import TargetFit
from cubicfish_cli.core.fit.statistics import rms_px
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray

# Two lenses make a wrong camera where it is off for most photos by so many times what is stated of
# it, and by more than a camera may be that counts as certain. Then less is enough to be sure of
# them: that they would be found by chance so often, and that they explain more along the way from
# one to the other than the best two groups do of photos that differ in one thing, as focus. Of n
# such photos that is 2/π, and 2/π + 1/√n in one of a thousand sets.
_BEYOND_STATED = 2.0
_SURE = 1e-3
# A first look at a fit that one lens has bent to both sees less than there is: it is followed up.
_WORTH_FOLLOWING = 1e-2
# Two lenses are worth an accusation where they take this share of the squared error away from
# photos that had no say in them, where they explain so much of how photos differ, and where a
# person would notice.
_CLEAR_MARGIN = 0.1
_MOST = 0.8
# Half-way from there to what groups explain by chance, where each photo has a lens of its own: two
# lenses that foretell photos are noted.
_MUCH = 0.65
# Photos of one lens foretell another one's squared errors to this share of what is left, or of
# what two lenses take away. Where the focus is another in every photo, groups of photos do not.
_FORETOLD, _FORETOLD_OF_GAIN = 0.15, 0.05
_ROUNDS = 12
# Two lenses far apart have bent the fit so much that a step to each is far too long, or leads to a
# scale below zero: a scale's logarithm is changed by no more than this at once.
_LONGEST_STEP, _LEAST_SCALE = 0.3, 0.1
# Shares of the gain that makes two lenses worth it: what the first of these rounds gains at least
# where they are, and by how much less than that another round gains where they have settled.
_AT_ONCE, _SETTLED = 0.5, 0.01
# A change in the photos' order is the simpler thing: any other split must be as much better.
_CLEARLY = 1.2
_FEWEST_IN_GROUP = 2
# A photo is another group's where that one's lens is nearer by so many variances within groups.
_CLEARLY_NEARER = 9.0


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
        along: the same of how they differ along the way from one lens to the other, less what
            groups of photos that differ in one thing explain.

    """

    second: BoolArray
    kind: Literal["order", "mixed"]
    chance: float
    own: FloatArray
    share: float
    explained: float
    along: float


def find_two_lenses(evidence: FitEvidence) -> list[Finding]:
    """Two groups of photos with a lens each, in place of one lens for all."""
    together, stated = rms_px(evidence.fit.cubic.residual), _read_stated_px(evidence.uncertainty)
    # A target that is free may bend to two lenses: as drawn it does not.
    fits = (
        (evidence.fit,)
        if evidence.fit is evidence.nominal_fit
        else (evidence.fit, evidence.nominal_fit)
    )
    for fit in fits:
        split = best_split(lenses_of(fit))
        if split is None or split.chance > _WORTH_FOLLOWING or split.share < WORTH / 2:
            continue
        found = _follow_up(fit, together, stated)
        if found is not None:
            return [found]
    return []


def _read_stated_px(uncertainty: UncertaintyGrid) -> float:
    """One standard deviation of the camera: of its pixels, or of its centre if that is more."""
    known = (uncertainty.median_px, *uncertainty.principal_point_px)
    return max((one for one in known if np.isfinite(one)), default=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Apart:
    """A fit of which one group of photos has another scale and centre.

    Attributes:
        scale: the group's scale over that of the others.
        shift: (2,) by how much its centre is off beside, pixels.
        second: (K,) which of ``photos`` are in it.
        fit: the fit, of pixels as one lens would have taken them.
        photos: what each photo has of its own, what it was given included.
        split: the groups that these fall into; its second one is most of ``second``.

    """

    scale: float
    shift: FloatArray
    second: BoolArray
    fit: TargetFit
    photos: PhotoLenses
    split: TwoLenses | None

    @property
    def given(self) -> FloatArray:
        """(3,) scale and shift as ``photos`` has them, pixels."""
        return np.array([(self.scale - 1) * self.photos.reach, *self.shift])

    @property
    def px(self) -> float:
        """RMS, pixels."""
        return rms_px(self.fit.cubic.errors)

    def towards(self, split: TwoLenses, longest: float) -> tuple[_Apart, bool]:
        """With scale and shift as a split has them, as far as is safe; whether all the way."""
        off = split.own[1] - split.own[0] - self.given
        wanted = float(np.log1p(max(off[0] / self.photos.reach, _LEAST_SCALE - 1)))
        step = float(np.clip(wanted, -longest, longest))
        part = step / wanted if wanted else 1.0
        moved = replace(
            self,
            scale=self.scale * float(np.exp(step)),
            shift=self.shift + part * self.scale * off[1:],
            second=split.second,
        )
        return moved, part == 1.0


def _follow_up(fit: TargetFit, together: float, stated: float) -> Finding | None:
    """Fit with a scale and centre for one of two groups, until they settle; then judge.

    Args:
        fit: the fit to start from.
        together: RMS with one lens for all, to be beaten.
        stated: one standard deviation that is stated of that lens, pixels.

    """
    pairs = fit.reference.pairs
    apart = _fit_until_settled(fit, together)
    if apart is None or apart.split is None:
        return None
    in_order = apart.split.kind == "order"
    if in_order:
        apart = _try_beside_boundary(fit, apart)
    photos, split = apart.photos, apart.split
    assert split is not None
    # The camera is off by that for the larger group.
    few = float(min(np.mean(apart.second), np.mean(~apart.second)))
    off = few * float(np.linalg.norm(apart.given))
    severity = worth(
        split,
        together,
        apart.px,
        unforeseen=left_out_share(photos, apart.second),
        noticed=noticed_px(pairs),
        beyond=off > max(_BEYOND_STATED * stated, noticed_px(pairs, CERTAIN_PX)),
    )
    if severity is None:
        return None
    second = _put_to_nearer_lens(photos, apart.second)
    # A lens that was bumped stays so: photos that take turns are two cameras'.
    in_order = in_order and int(np.count_nonzero(np.diff(second))) == 1
    middle = (np.array(pairs.image_size, float) - 1) / 2
    camera = apart.fit.reference.camera
    common = np.array([camera.cx, camera.cy]) - middle
    ratio, centre, other = apart.scale, middle + common, middle + apart.scale * common + apart.shift
    # Told of are the later ones, or the fewer.
    if not second[-1] if in_order else 2 * second.sum() > len(second):
        second, ratio, centre, other = ~second, 1 / ratio, other, centre
    names = np.array(pairs.images)[photos.photos]
    found = lens_change(
        LensChange(ratio=ratio, shift=other - centre, centre=centre),
        names[second].tolist(),
        names[~second].tolist(),
        pairs,
        in_order=in_order,
        because="apart",
        figures={"together_px": together, "apart_px": apart.px},
    )
    return replace(found, severity=severity)


def _put_to_nearer_lens(photos: PhotoLenses, second: BoolArray) -> BoolArray:
    """The same groups (K,), but for photos that are clearly nearer to the other one's lens."""
    own, weight = photos.own[:, LENS], photos.lens_information()
    offs = [own - mean_of(own[group], weight[group]) for group in (~second, second)]
    far = np.stack([np.einsum("ki,kij,kj->k", off, weight, off) for off in offs])
    within, across = np.where(second, far[::-1], far)
    variance = within.sum() / (3 * max(len(second) - 2, 1))
    moved = second ^ (within - across > _CLEARLY_NEARER * variance)
    return moved if 0 < moved.sum() < len(moved) else second


def _fit_until_settled(fit: TargetFit, together: float) -> _Apart | None:
    """The fit apart; None where what it gains at once is not worth it, or photos do not split."""
    photos = lenses_of(fit)
    split = best_split(photos)
    if split is None:
        return None
    best = _Apart(
        scale=1.0, shift=np.zeros(2), second=split.second, fit=fit, photos=photos, split=split
    )
    gained, longest, worthy = -np.inf, _LONGEST_STEP, _CLEAR_MARGIN * together**2
    for number in range(_ROUNDS):
        if best.split is None:
            return None
        wanted, whole = best.towards(best.split, longest)
        try:
            apart = _fit_apart(fit, best, wanted)
        except FitError:  # too far at once
            longest /= 2
            continue
        before, gained = gained, together**2 - apart.px**2
        if number == 0 and whole and gained < _AT_ONCE * worthy:
            return None
        # Two lenses differ in more than scale and centre: a step may lead too far.
        if gained < before:
            break
        best = apart
        if whole and gained - before < _SETTLED * worthy:
            break
    return best


def worth(
    split: TwoLenses,
    together: float,
    apart: float,
    *,
    unforeseen: float,
    noticed: float,
    beyond: bool,
) -> Severity | None:
    """What two lenses are worth; None where they do not clearly explain more than one.

    Bad is a camera of photos whose two lenses foretell photos that had no say in them, or differ
    by more than is stated of it. Otherwise they are a note, as where a few photos do not foretell
    others, or photos differ in other ways, too.

    Args:
        split: the two groups of photos.
        together: RMS with one lens for all, pixels.
        apart: with two.
        unforeseen: how many times larger the squared error is of photos that had no say.
        noticed: pixels that a person would notice.
        beyond: whether the camera of both is off by more than is stated.

    """
    left, gain = apart**2, together**2 - apart**2
    not_foretold = left * (unforeseen - 1)
    least = max(_CLEAR_MARGIN * together**2, 0.0 if beyond else noticed**2)
    if beyond and split.chance <= _SURE and split.along > 0 and gain >= least:
        return Severity.BAD
    foretold = not_foretold <= max(_FORETOLD * left, _FORETOLD_OF_GAIN * gain)
    foretold = foretold and gain - not_foretold >= least
    if split.explained < (_MUCH if foretold else _MOST) or gain < least:
        return None
    if split.chance > BY_CHANCE:
        return None
    return Severity.BAD if beyond or (foretold and split.explained >= _MOST) else Severity.NOTE


def _fit_apart(fit: TargetFit, start: _Apart, wanted: _Apart) -> _Apart:
    """Fit with a scale and a shift for some photos, and what each photo has of its own in all.

    Args:
        fit: the fit with one lens for all.
        start: a fit apart from which to start.
        wanted: scale, shift and photos; its fit does not count.

    Raises:
        FitError: there is no camera.

    """
    pairs, photos = fit.reference.pairs, start.photos.photos
    (old, _), (scale, shift) = (_spread_out(one, len(pairs.images)) for one in (start, wanted))
    middle = (np.array(pairs.image_size, float) - 1) / 2
    # Pixels as one lens would have taken them: smaller ones are of a target that is farther away.
    pixel = middle + (pairs.pixel - middle - shift[pairs.image]) / scale[pairs.image, None]
    poses = start.fit.cubic.poses
    poses = replace(poses, translation=poses.translation * (scale / old)[:, None])
    reference = refit_radial(start.fit.reference, replace(pairs, pixel=pixel), poses)
    near = replace(start.fit.cubic.fit, poses=reference.poses)
    cubic = fit_cubic(
        reference,
        fit.cubic.prior,
        start=replace(start.fit.cubic, fit=near),
        relative_decrease=ROUGH_DECREASE,
    )
    apart = replace(wanted, fit=replace(start.fit, reference=reference, cubic=cubic))
    found = lenses_of(apart.fit)
    total = found.own.copy()
    total[:, :3] += np.where(np.isin(found.photos, photos[wanted.second])[:, None], wanted.given, 0)
    found = replace(found, own=total)
    return replace(apart, photos=found, split=_match_groups(best_split(found), wanted.second))


def _spread_out(apart: _Apart, count: int) -> tuple[FloatArray, FloatArray]:
    """Scale (M,) and shift (M, 2) of each of so many photos."""
    scale, shift = np.ones(count), np.zeros((count, 2))
    second = apart.photos.photos[apart.second]
    scale[second], shift[second] = apart.scale, apart.shift
    return scale, shift


def _match_groups(split: TwoLenses | None, second: BoolArray) -> TwoLenses | None:
    """The same split with that group as the second one which has most of these photos (K,)."""
    if split is None or 2 * np.sum(split.second != second) <= len(second):
        return split
    return replace(split, second=~split.second, own=split.own[::-1])


def _try_beside_boundary(fit: TargetFit, apart: _Apart) -> _Apart:
    """The change one photo earlier or later, where that fits better.

    A photo beside the change that was counted to the wrong side has bent the camera to itself.
    """
    first = int(np.argmax(apart.second != apart.second[0]))
    for place in (first, first - 1):
        second = apart.second.copy()
        second[place] = not second[place]
        if not 0 < second.sum() < len(second):
            continue
        moved = _fit_apart(fit, apart, replace(apart, second=second))
        if moved.px**2 < (1 - WORTH) * apart.px**2:
            return replace(moved, split=apart.split)
    return apart


def best_split(photos: PhotoLenses) -> TwoLenses | None:
    """The split of the photos into two groups that explains best how their lenses differ.

    What differs within the groups is the measure of what differs between them (an F test), so
    that whatever else is imperfect, a target that bends or a lens that the model cannot follow,
    counts against it. Splits are corrected for how many there are: along the photos' order, or
    by any plane through the space of scale and centre (Cover, 1965).

    Returns:
        None where there are too few photos to tell.

    """
    count = len(photos.photos)
    if count < FEWEST_TOLD_APART:
        return None
    own, weight = photos.own[:, LENS], photos.lens_information()
    off = own - mean_of(own, weight)
    pull = (weight @ off[:, :, None])[:, :, 0]
    in_order = best_cut(np.arange(count)[None], weight, pull, _FEWEST_IN_GROUP)
    mixed = best_cut(_sort_along_axes(own, weight), weight, pull, _FEWEST_IN_GROUP)
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
        own=np.stack([mean_of(own[part], weight[part]) for part in (~second, second)]),
        share=between / (_sum_scatter(own, weight) + float(photos.squares.sum()) + 1e-300),
        explained=ratio / (ratio + count - 2),
        along=_explain_along(own, weight, second),
    )


def _explain_along(own: FloatArray, weight: FloatArray, second: BoolArray) -> float:
    """How much more groups explain on the way between their lenses than of one thing: a share."""
    means = [mean_of(own[group], weight[group]) for group in (~second, second)]
    way = means[1] - means[0]
    # How far along each photo is, by what it tells of that.
    known = weight @ way
    known_of_way = known @ way
    place = np.sum(known * (own - means[0]), axis=1) / known_of_way
    group_means = [np.average(place[one], weights=known_of_way[one]) for one in (~second, second)]
    within = known_of_way @ np.square(place - np.where(second, group_means[1], group_means[0]))
    in_all = known_of_way @ np.square(place - np.average(place, weights=known_of_way))
    return float(1 - within / in_all - 2 / np.pi - 1 / np.sqrt(len(own)))


def left_out_share(photos: PhotoLenses, second: BoolArray) -> float:
    """How much larger the squared error is of photos that had no say in their group's lens.

    Each photo in turn is given the scale and centre of the others of its group.

    Args:
        photos: what each photo has of its own.
        second: (K,) which are in the second group.

    Returns:
        The squared error over that with lenses that follow from all photos; 1 or more.

    """
    own, weight = photos.own[:, LENS], photos.lens_information()
    pull = (weight @ own[:, :, None])[:, :, 0]
    known = unknown = float(photos.squares.sum()) + 1e-300
    for group in (np.flatnonzero(~second), np.flatnonzero(second)):
        known += _sum_scatter(own[group], weight[group])
        if len(group) < _FEWEST_IN_GROUP:
            continue
        others = weight[group].sum(axis=0) - weight[group]
        means = np.linalg.solve(others, (pull[group].sum(axis=0) - pull[group])[:, :, None])
        off = own[group] - means[:, :, 0]
        unknown += float(np.einsum("ki,kij,kj->", off, weight[group], off))
    return unknown / known


def _sum_scatter(own: FloatArray, weight: FloatArray) -> float:
    off = own - mean_of(own, weight)
    return float(np.einsum("ki,kij,kj->", off, weight, off))


def _sort_along_axes(own: FloatArray, weight: FloatArray) -> IntArray:
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
