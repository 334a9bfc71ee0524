"""Outliers: corners that are grossly off or depart from their neighbours, and noisy photos."""

from dataclasses import replace

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.fit.prior import EXPECTED
from cubicfish.fit.radial_reference import RadialReference, refit_radial
from cubicfish.judge.codes import Code
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import DroppedCorner
from cubicfish.solve.statistics import around, gross_px, noise_by_photo, stray_px, tail_px
from cubicfish.solve.subset import select, select_photos
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray

_DROP_ROUNDS = 12
# Enough to recognise a corner that is pixels off.
_DROP_DECREASE = 1e-4
# From so many on, the median of neighbours is none of those that are wrong themselves.
_FEWEST_NEIGHBOURS = 3
# A corner stands alone if it is so many times farther off than most neighbours (percent) are.
_BEYOND_NEIGHBOURS = 3.0
_MOST = 75
_FEW_PHOTOS = 3
# A photo this many times noisier than the median photo does more harm than good.
_NOISY = 4.0
_NOISY_PX = 0.5


def dropped_corners(pairs: Observations, error_px: FloatArray) -> tuple[DroppedCorner, ...]:
    """List the pairs (N) that were left out, with their errors (N,), pixels."""
    return tuple(
        DroppedCorner(
            image=pairs.images[pairs.image[index]],
            board=pairs.boards[pairs.board[index]] if pairs.boards else None,
            column=int(pairs.column[index]),
            row=int(pairs.row[index]),
            error_px=float(error),
        )
        for index, error in enumerate(error_px)
    )


def without_gross(reference: RadialReference) -> tuple[CameraFit, Observations, FloatArray]:
    """Fit to the nominal target without outliers; the outliers, and how far they are off.

    P has the prior that is expected of any lens. Every round judges all corners anew: a corner that
    only looked wrong because others had pulled its photo's pose away comes back.
    """
    everything, poses = reference.pairs, reference.poses
    length = np.hypot(reference.residual[:, 0], reference.residual[:, 1])
    good, kept = length <= gross_px(reference.residual), np.ones(len(length), bool)
    for round_ in range(_DROP_ROUNDS):
        if not (good == kept).all():
            remaining, photos = select(everything, good)
            reference = refit_radial(reference, remaining, poses[photos])
        elif round_:
            break
        else:
            photos = np.arange(len(poses))
        kept = good
        cubic = fit_cubic(reference, EXPECTED, relative_decrease=_DROP_DECREASE)
        poses = poses.with_photos(photos, cubic.poses)
        miss = cubic.lens.project(poses.apply(everything.image, everything.world))
        miss -= everything.pixel
        length = np.minimum(np.hypot(miss[:, 0], miss[:, 1]), max(everything.image_size))
        good = length <= gross_px(cubic.residual)
    return cubic, everything.select(~kept), length[~kept]


def without_noisy(fit: CameraFit) -> CameraFit:
    """Leave out photos whose corners are much noisier than the others', and report them.

    They are blurred, moving or badly lit; where they would be a third or more, none is left out.
    """
    pairs = fit.reference.pairs
    photos = len(pairs.images)
    noise = noise_by_photo(pairs.image, fit.residual, photos)
    typical = float(np.median(noise))
    noisy = noise > max(_NOISY * typical, _NOISY_PX)
    if not noisy.any() or photos < _FEW_PHOTOS + 1 or 3 * noisy.sum() >= photos:
        return fit
    named = {
        pairs.images[photo]: Finding(
            code=Code.NOISY,
            images=(pairs.images[photo],),
            figures={"times": float(noise[photo] / typical)},
        )
        for photo in np.flatnonzero(noisy)
    }
    good = np.flatnonzero(~noisy)
    reference = refit_radial(fit.reference, select_photos(pairs, good), fit.poses[good])
    reference = replace(reference, unfit=reference.unfit | named)
    return fit_cubic(reference, EXPECTED, relative_decrease=_DROP_DECREASE)


def strays(pairs: Observations, residual: FloatArray) -> BoolArray:
    """(N,) corners that depart from their neighbours by far more than noise: slips of detection.

    Neighbours share what a lens, a pose or a sheet leaves. The noise is that of all corners, their
    long tails included, or the photo's where it is larger. A corner without neighbours is no slip.

    Args:
        pairs: the pairs, sorted by photo.
        residual: (N, 2) projection less pixel, pixels.

    """
    near = around(pairs)
    own = np.flatnonzero(((near >= 0).sum(axis=1) >= _FEWEST_NEIGHBOURS) & pairs.error_known)
    found = np.zeros(len(residual), bool)
    if not own.size:
        return found
    theirs = np.where((near[own] >= 0)[..., None], residual[near[own]], np.nan)
    middle = np.nanmedian(theirs, axis=1)
    departs = residual[own] - middle
    noise = noise_by_photo(pairs.image[own], departs, len(pairs.images))
    limit = stray_px(np.maximum(noise, tail_px(departs)))[pairs.image[own]]
    length = np.minimum(np.hypot(*departs.T), np.hypot(*residual[own].T))
    far = np.flatnonzero(length > limit)
    # On a slope, the corner at its end departs from neighbours that depart from each other.
    apart = np.linalg.norm(theirs[far] - middle[far, None], axis=2)
    alone = length[far] > _BEYOND_NEIGHBOURS * np.nanpercentile(apart, _MOST, axis=1)
    found[own[far[alone]]] = True
    return found


def without(fit: CameraFit, wrong: BoolArray) -> CameraFit:
    """The same fit without some corners (N,), to be continued; every photo keeps some corners."""
    rows = np.flatnonzero(~wrong)
    pairs, world = fit.reference.pairs.select(~wrong), fit.world.select(rows)
    reference = refit_radial(fit.reference, pairs, fit.reference.poses)
    return replace(
        fit,
        reference=reference,
        residual=fit.residual[rows],
        world=world,
        pairs=pairs,
        nominal=replace(fit.nominal, pairs=fit.nominal.pairs.select(rows)),
        held_out=fit.held_out and fit.held_out.of(rows),
        other_levels=tuple(
            replace(one, held_out=one.held_out and one.held_out.of(rows))
            for one in fit.other_levels
        ),
    )
