"""Photos through two lenses: some zoomed, cropped, scaled, turned, or of another camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import comb

import numpy as np

from cubicfish.diagnosis.photo_lenses import (
    BY_CHANCE,
    FEWEST_COMPARED,
    LEAST_SHARE,
    LENS,
    ROUGH_DECREASE,
    PhotoLenses,
    best_cut,
    lenses_of,
    mean_of,
    noticed_px,
)
from cubicfish.errors import FitError
from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.fit.radial_reference import refit_radial
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.uncertainty import CERTAIN_PX, UncertaintyGrid
from cubicfish.solve.chances import beyond_f, normal_quantile
from cubicfish.solve.deformable_target import DeformableTarget
from cubicfish.solve.statistics import rms_px
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray

# Two lenses make a wrong camera where they differ by so many times its stated uncertainty, and by
# more than a certain camera may be off. They are sure if three things hold. So clear a split is
# seldom found by chance, the seldomer the less the camera of most photos is off. It explains more
# of the way from one lens to the other than groups of n photos that differ in one thing, such as
# focus (2/π of it for groups of one size, and 2/π + 1/√n in one of a thousand sets). And it takes
# this share of the squared error away.
_BEYOND_STATED = 2.0
_SURE = 1e-3
_CLEAR_MARGIN = 0.1
# A fit that one lens has bent to both shows less than there is: a first suspicion is followed up.
_SUSPECTED = 1e-2
_ROUNDS = 12
# Two lenses far apart have bent the fit so much that a step to each is far too long, or leads to a
# scale below zero: the logarithm of a scale is changed by no more than this at once.
_LONGEST_STEP, _LEAST_SCALE = 0.3, 0.1
# Shares of the gain that makes two lenses worth it: the least gain of the first of these rounds,
# and the gain over it below which rounds have converged.
_AT_ONCE, _STEADY = 0.5, 0.01
# A change in the photos' order is the simpler thing: any other split must be as much better.
_CLEARLY = 1.2
_FEWEST_IN_GROUP = 2
# A photo belongs to the other group if that one's lens is nearer by so many variances within
# groups.
_CLEARLY_NEARER = 9.0
# A difference below this share of the larger of two counts as none.
_NONE = 0.25
# Centres that agree to this share of the longer side are the same.
_SAME_CENTRE = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoLenses:
    """Photos that fall into two groups, each with a lens of its own.

    Attributes:
        second: (K,) which of ``PhotoLenses.photos`` are in the smaller or later group.
        chance: how often so clear a split would be found among photos through one lens.
        own: (2, 3) scale, shift x and shift y of both groups, pixels.
        share: the share of all photos' squared error that two lenses explain, beyond one for all.
        along: the share of the difference along the way from one lens to the other that the groups
            explain, less that of groups of photos that differ in one thing.

    """

    second: BoolArray
    chance: float
    own: FloatArray
    share: float
    along: float


def find_two_lenses(evidence: FitEvidence) -> list[Finding]:
    """Find two groups of photos with a lens each, in place of one lens for all."""
    fit, together = evidence.fit, rms_px(evidence.fit.residual)
    limit = max(
        _BEYOND_STATED * _read_stated_px(evidence.uncertainty),
        noticed_px(fit.reference.pairs, CERTAIN_PX),
    )
    # A deformable target may bend to two lenses: the nominal one does not.
    for one in (fit,) if fit is evidence.nominal_fit else (fit, evidence.nominal_fit):
        photos = lenses_of(one)
        split = best_split(photos)
        if split is None or split.chance > _SUSPECTED or split.share < LEAST_SHARE / 2:
            continue
        start = _Apart(
            scale=1.0, shift=np.zeros(2), second=split.second, fit=one, photos=photos, split=split
        )
        apart = _fit_until_converged(start, together)
        if apart is not None and _are_two_lenses(apart, together, limit):
            return [_describe(apart, together)]
    return []


def _read_stated_px(uncertainty: UncertaintyGrid) -> float:
    """One standard deviation of the camera: of its pixels, or of its centre if that is larger."""
    known = (uncertainty.median_px, *uncertainty.principal_point_px)
    return max((one for one in known if np.isfinite(one)), default=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Apart:
    """A fit of which one group of photos has another scale and centre.

    Attributes:
        scale: the group's scale over that of the others.
        shift: (2,) the offset of its centre from that of the others, pixels.
        second: (K,) which of ``photos`` are in the group.
        fit: the fit of the pixels that one lens would have seen.
        photos: the terms of each photo's own lens, those that it was given included.
        split: the groups into which these fall; its second one is most of ``second``.

    """

    scale: float
    shift: FloatArray
    second: BoolArray
    fit: CameraFit
    photos: PhotoLenses
    split: TwoLenses

    @property
    def given(self) -> FloatArray:
        """(3,) scale and shift as ``photos`` has them, pixels."""
        return np.array([(self.scale - 1) * self.photos.half_side, *self.shift])

    @property
    def px(self) -> float:
        """RMS of the fit, pixels."""
        return rms_px(self.fit.errors)

    def towards(self, longest: float) -> tuple[_Apart, bool]:
        """Move to the scale and shift of the split, as far as is safe; and whether all the way."""
        split = self.split
        off = split.own[1] - split.own[0] - self.given
        wanted = float(np.log1p(max(off[0] / self.photos.half_side, _LEAST_SCALE - 1)))
        step = float(np.clip(wanted, -longest, longest))
        part = step / wanted if wanted else 1.0
        moved = replace(
            self,
            scale=self.scale * float(np.exp(step)),
            shift=self.shift + part * self.scale * off[1:],
            second=split.second,
        )
        return moved, part == 1.0


def _are_two_lenses(apart: _Apart, together: float, limit: float) -> bool:
    """Whether groups of photos differ by more than a limit (pixels), and surely."""
    differ = float(np.linalg.norm(apart.given))
    # The camera is off by that much for the larger group.
    few = float(min(np.mean(apart.second), np.mean(~apart.second)))
    seldom = _SURE if few * differ > limit else BY_CHANCE
    gained = together**2 - apart.px**2
    clear = apart.split.chance <= seldom and gained >= _CLEAR_MARGIN * together**2
    return differ > limit and clear and apart.split.along > 0


def _describe(apart: _Apart, together: float) -> Finding:
    """Report the two lenses, with the photos of each."""
    pairs, photos = apart.fit.reference.pairs, apart.photos
    second = _put_to_nearer_lens(photos, apart.second)
    # A lens that was bumped stays so: photos that take turns are two cameras'.
    in_order = int(np.count_nonzero(np.diff(second))) == 1
    middle = (np.array(pairs.image_size, float) - 1) / 2
    camera = apart.fit.reference.camera
    common = np.array([camera.cx, camera.cy]) - middle
    ratio, centre, other = apart.scale, middle + common, middle + apart.scale * common + apart.shift
    # The report is about the later ones, or the fewer.
    if not second[-1] if in_order else 2 * second.sum() > len(second):
        second, ratio, centre, other = ~second, 1 / ratio, other, centre
    names = np.array(pairs.images)[photos.photos]
    return lens_change(
        ratio,
        other - centre,
        centre,
        names[second].tolist(),
        names[~second].tolist(),
        pairs,
        in_order=in_order,
        because="apart",
        figures={"together_px": together, "apart_px": apart.px},
    )


def _put_to_nearer_lens(photos: PhotoLenses, second: BoolArray) -> BoolArray:
    """The same groups (K,), with photos that are clearly nearer to the other lens moved."""
    own, weight = photos.own[:, LENS], photos.lens_information()
    offs = [own - mean_of(own[group], weight[group]) for group in (~second, second)]
    far = np.stack([np.einsum("ki,kij,kj->k", off, weight, off) for off in offs])
    within, across = np.where(second, far[::-1], far)
    variance = within.sum() / (3 * max(len(second) - 2, 1))
    moved = second ^ (within - across > _CLEARLY_NEARER * variance)
    return moved if 0 < moved.sum() < len(moved) else second


def _fit_until_converged(start: _Apart, together: float) -> _Apart | None:
    """Fit with a scale and a centre for one of two groups, until they converge.

    Args:
        start: one lens for all, and the groups.
        together: RMS of one lens for all, which has to be beaten.

    Returns:
        The last fit; None where the first gains too little, or photos no longer split.

    """
    best = start
    gained, longest, worthy = -np.inf, _LONGEST_STEP, _CLEAR_MARGIN * together**2
    for number in range(_ROUNDS):
        wanted, whole = best.towards(longest)
        try:
            apart = _fit_apart(start.fit, best, wanted)
        except FitError:  # the step was too far
            longest /= 2
            continue
        if apart is None:
            return None
        before, gained = gained, together**2 - apart.px**2
        if number == 0 and whole and gained < _AT_ONCE * worthy:
            return None
        # Two lenses differ in more than scale and centre: a step may lead too far.
        if gained < before:
            break
        best = apart
        if whole and gained - before < _STEADY * worthy:
            break
    return best


def _fit_apart(fit: CameraFit, start: _Apart, wanted: _Apart) -> _Apart | None:
    """Fit with a scale and a shift for some photos, and measure each photo's own lens in it.

    Args:
        fit: the fit with one lens for all.
        start: a fit apart to start from.
        wanted: the scale, the shift and the photos; its fit does not count.

    Returns:
        The fit; None where photos no longer fall into groups.

    Raises:
        FitError: there is no camera.

    """
    pairs, photos = fit.reference.pairs, start.photos.photos
    (old, _), (scale, shift) = (_spread_out(one, len(pairs.images)) for one in (start, wanted))
    middle = (np.array(pairs.image_size, float) - 1) / 2
    # Pixels that one lens would have seen: smaller ones are of a target that is farther away.
    pixel = middle + (pairs.pixel - middle - shift[pairs.image]) / scale[pairs.image, None]
    poses = start.fit.poses
    poses = replace(poses, translation=poses.translation * (scale / old)[:, None])
    reference = refit_radial(start.fit.reference, replace(pairs, pixel=pixel), poses)
    fixed_target = DeformableTarget(nominal=pairs.world)
    near = replace(start.fit, poses=reference.poses, world=fixed_target)
    joint = fit_cubic(reference, fit.prior, start=near, relative_decrease=ROUGH_DECREASE)
    apart = replace(wanted, fit=joint)
    found = lenses_of(apart.fit)
    total = found.own.copy()
    total[:, :3] += np.where(np.isin(found.photos, photos[wanted.second])[:, None], wanted.given, 0)
    found = replace(found, own=total)
    split, second = best_split(found), wanted.second
    if split is None:
        return None
    if 2 * np.sum(split.second != second) > len(second):  # the other one is most of these photos
        split = replace(split, second=~split.second, own=split.own[::-1])
    return replace(apart, photos=found, split=split)


def _spread_out(apart: _Apart, count: int) -> tuple[FloatArray, FloatArray]:
    """The scale (M,) and the shift (M, 2) of each of so many photos."""
    scale, shift = np.ones(count), np.zeros((count, 2))
    second = apart.photos.photos[apart.second]
    scale[second], shift[second] = apart.scale, apart.shift
    return scale, shift


def best_split(photos: PhotoLenses) -> TwoLenses | None:
    """Find the split of the photos into two groups that explains best how their lenses differ.

    The difference between the groups is measured by that within them (an F test), so that whatever
    else is imperfect, a target that bends or a lens that the model cannot follow, counts against
    it. Splits are corrected for how many there are: along the photos' order, or by any plane
    through the space of scale and centre (Cover, 1965).

    Returns:
        The split; None where there are too few photos.

    """
    count = len(photos.photos)
    if count < FEWEST_COMPARED:
        return None
    own, weight = photos.own[:, LENS], photos.lens_information()
    off = own - mean_of(own, weight)
    pull = (weight @ off[:, :, None])[:, :, 0]
    in_order = best_cut(np.arange(count)[None], weight, pull, _FEWEST_IN_GROUP)
    mixed = best_cut(_sort_along_axes(own, weight), weight, pull, _FEWEST_IN_GROUP)
    if in_order is None or mixed is None:
        return None
    (ratio, between, second), trials = in_order, count - 1
    if mixed[0] > _CLEARLY * in_order[0]:
        (ratio, between, second), trials = mixed, sum(comb(count - 1, k) for k in range(4))
        second = ~second if 2 * second.sum() > count else second
    return TwoLenses(
        second=second,
        chance=float(beyond_f(3, 3 * (count - 2), ratio)) * trials,
        own=np.stack([mean_of(own[part], weight[part]) for part in (~second, second)]),
        share=between / (_sum_scatter(own, weight) + float(photos.squares.sum()) + 1e-300),
        along=_explain_along(own, weight, second),
    )


def _explain_along(own: FloatArray, weight: FloatArray, second: BoolArray) -> float:
    """The share that groups explain on the way between their lenses, less that of one thing."""
    means = [mean_of(own[group], weight[group]) for group in (~second, second)]
    way = means[1] - means[0]
    # How far along each photo is, by its information on that.
    known = weight @ way
    known_of_way = known @ way
    place = np.sum(known * (own - means[0]), axis=1) / known_of_way
    group_means = [np.average(place[one], weights=known_of_way[one]) for one in (~second, second)]
    within = known_of_way @ np.square(place - np.where(second, group_means[1], group_means[0]))
    in_all = known_of_way @ np.square(place - np.average(place, weights=known_of_way))
    # The share that a cut explains of a normal distribution, with this share beyond it.
    share = float(np.mean(second))
    of_one_thing = np.exp(-(normal_quantile(share) ** 2)) / (2 * np.pi * share * (1 - share))
    return float(1 - within / in_all - of_one_thing - 1 / np.sqrt(len(own)))


def _sum_scatter(own: FloatArray, weight: FloatArray) -> float:
    off = own - mean_of(own, weight)
    return float(np.einsum("ki,kij,kj->", off, weight, off))


def _sort_along_axes(own: FloatArray, weight: FloatArray) -> IntArray:
    """Sort the photos along the axes of their scatter (6, K): cuts are planes across these axes."""
    # A mean to which each photo contributes alike; medians of single entries need not be a positive
    # definite matrix.
    root = np.linalg.cholesky(
        np.mean(weight / np.trace(weight, axis1=1, axis2=2)[:, None, None], 0)
    )
    white = own @ root
    white = white - np.median(white, axis=0)
    axes = np.linalg.svd(white, full_matrices=False)[2]
    along = np.concatenate([white @ axes.T, own], axis=1)
    return np.argsort(along, axis=0, kind="stable").T


def lens_change(
    ratio: float,
    shift: FloatArray,
    centre: FloatArray,
    names: list[str],
    rest: list[str],
    pairs: Observations,
    *,
    in_order: bool,
    because: str,
    figures: Mapping[str, float],
) -> Finding:
    """Report the kind of difference between the lens of some photos and the others'.

    Args:
        ratio: its scale over that of the others.
        shift: (2,) the offset of its centre from that of the others, pixels.
        centre: (2,) the centre of the others, pixels.
        names: the photos.
        rest: the others.
        pairs: any pairs of the same size of photo.
        in_order: whether they are all photos from one on.
        because: the kind of evidence.
        figures: the figures of the evidence.

    """
    size = np.array(pairs.image_size, float)
    half_side, near = size.min() / 2, _SAME_CENTRE * size.max()
    by_scale = abs(ratio - 1) * half_side
    by_shift = float(np.hypot(*shift))
    scaled_centre = (ratio - 1) * (centre + 0.5)
    turned = size - 1 - 2 * centre
    if by_scale < _NONE * by_shift and np.hypot(*(shift - turned)) < min(near, 0.2 * by_shift + 1):
        code = Code.TURNED
    elif by_scale > _NONE * by_shift and np.hypot(*(shift - scaled_centre)) < max(
        0.1 * by_shift, near / 4
    ):
        code = Code.SCALED
    elif by_shift < _NONE * by_scale or by_shift < near / 4 < by_scale:
        code = Code.ZOOM
    elif by_scale < _NONE * by_shift:
        code = Code.SHIFTED
    else:
        code = Code.TWO_LENSES
    return Finding(
        code=code,
        severity=Severity.BAD,
        images=tuple(names),
        because=because,
        figures={
            **figures,
            "where": "from" if in_order else "in",
            "in_order": in_order,
            "rest": rest,
            "scale": _write_ratio(ratio),
            "focal_off": ratio - 1,
            "x_px": float(shift[0]),
            "y_px": float(shift[1]),
        },
    )


def _write_ratio(ratio: float) -> str:
    """A ratio with two digits of its difference from 1, and three at least."""
    digits = 1 - int(np.floor(np.log10(max(abs(ratio - 1), 1e-9))))
    return f"{ratio:.{max(digits, 2)}f}"
