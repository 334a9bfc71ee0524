"""Single photos that are unlike the others: through another lens, or while something moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.app.diagnosis.photo_lenses import (
    BY_CHANCE,
    FEWEST_TOLD_APART,
    ROUGH_DECREASE,
    WORTH,
    PhotoLenses,
    invertible,
    lenses_of,
    mean_of,
    noticed_px,
    photo_lenses,
    select_fit,
)
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.adjustment import adjust
from cubicfish_cli.core.fit.cubic_fit import fit_cubic
from cubicfish_cli.core.fit.lenses import FixedLens
from cubicfish_cli.core.fit.refinement import TargetFit
from cubicfish_cli.core.fit.subset import select_photos
from cubicfish_cli.core.types import FloatArray, IntArray

# A photo that is unlike the others is judged by a camera that never saw it, which is right about it
# only if it comes from so many times as many equations as unknowns, and from so many photos that
# what the target is off by does not look like a lens of its own in one of them.
_SUSPICIOUS = 1e-4
_TIMES_DETERMINED = 10
_FEWEST_OTHERS = 8
# Wide enough to feel every corner while a pose is off.
_WIDE_HUBER_PX = 10.0
_TYPICAL_ROUNDS = 20


@dataclass(frozen=True, kw_only=True)
class Unlike:
    """How one photo differs from the others.

    Attributes:
        photo: its index.
        chance: how often the most unlike of so many right photos would be as unlike.
        share: of the photo's squared error that it explains.
        gain_px: RMS of what it explains, pixels.

    """

    photo: int
    chance: float
    share: float
    gain_px: float


def odd_photos(fit: TargetFit) -> list[Finding]:
    """Photos that by themselves have another lens than the rest, or are sheared."""
    pairs, photos = fit.reference.pairs, lenses_of(fit)
    suspects = [
        one.photo for one in unlike(photos) if one.chance < _SUSPICIOUS and one.share > WORTH / 2
    ]
    if not suspects:
        return []
    if 2 * len(suspects) < len(pairs.images):
        # They have bent the lens and the other photos' poses: judge by a lens without them.
        left_out = np.array(suspects)
        if not _can_do_without(fit, left_out):
            return []
        photos = _refit_without(fit, left_out)
    certain = [
        one
        for one in unlike(photos)
        if one.photo in suspects
        and one.chance < BY_CHANCE
        and one.share > WORTH
        and one.gain_px > noticed_px(pairs)
    ]
    if not 0 < 2 * len(certain) < len(pairs.images):
        return []
    most = max(certain, key=lambda one: one.gain_px)
    return [
        Finding(
            code=Code.PHOTO_LENS,
            # A camera that eight others determine hardly hangs on one.
            severity=Severity.NOTE if len(certain) == 1 else Severity.CARE,
            images=tuple(pairs.images[one.photo] for one in certain),
            figures={
                "size_px": most.gain_px,
                "share": most.share,
                "worst": pairs.images[most.photo],
            },
        )
    ]


def _can_do_without(fit: TargetFit, left_out: IntArray) -> bool:
    """Whether the other photos make a camera that is right about photos it has not seen."""
    pairs = fit.reference.pairs
    others = np.count_nonzero(~np.isin(pairs.image, left_out))
    poses = len(pairs.images) - len(left_out)
    unknowns = len(fit.cubic.lens.parameters) + 6 * poses
    return bool(poses >= _FEWEST_OTHERS and 2 * others >= _TIMES_DETERMINED * unknowns)


def _refit_without(fit: TargetFit, suspects: IntArray) -> PhotoLenses:
    """What each photo has of its own beside a lens that was fitted without some."""
    pairs = fit.reference.pairs
    good = np.setdiff1d(np.arange(len(pairs.images)), suspects)
    few = select_fit(fit, good)
    cubic = fit_cubic(
        few.reference, few.cubic.prior, start=few.cubic, relative_decrease=ROUGH_DECREASE
    )
    poses = fit.cubic.poses.with_photos(good, cubic.poses)
    # Beside their poses under the other lens, photos would look grossly wrong all over.
    left_out = np.setdiff1d(np.arange(len(poses)), good)
    lens, others = FixedLens(camera=cubic.lens), select_photos(pairs, left_out)
    placed = adjust(lens, poses[left_out], others, huber_px=_WIDE_HUBER_PX)
    poses = poses.with_photos(left_out, placed.poses)
    photos = photo_lenses(cubic.lens, poses, pairs, pairs.world)
    if not np.isfinite(photos.own).all():
        raise FitError("photos have no place beside a lens that was fitted without them")
    return photos


def unlike(photos: PhotoLenses) -> list[Unlike]:
    """How much less like the others each photo is than those are like each other.

    One for each of ``photos.photos``; none where they are too few to tell.
    """
    count = len(photos.photos)
    if count < FEWEST_TOLD_APART:
        return []
    own, size = photos.own, photos.own.shape[1]
    noise = photos.squares / np.maximum(photos.numbers, 1)
    # A photo in dim light is noisier than the others, and nothing else.
    noise = np.maximum(noise, np.median(noise))
    weight = invertible(photos.information) / (size * noise[:, None, None])
    off = own - _find_typical(own, weight)
    distance = np.einsum("ki,kij,kj->k", off, weight, off)
    # What the photos' own terms are beyond noise, by the better half of them.
    spread = max(1.0, float(np.median(distance)))
    # The noise, 1, is known from all corners; what is beyond it is told by the better half of the
    # photos (Satterthwaite 1946).
    numbers = size * count / 2 * (spread / max(spread - 1, 1e-6)) ** 2
    chance = fdtrc(size, np.clip(photos.numbers, 1, numbers), distance / spread) * count
    worth = distance * size * noise
    return [
        Unlike(
            photo=int(photos.photos[index]),
            chance=float(chance[index]),
            gain_px=float(np.sqrt(2 * worth[index] / max(photos.numbers[index], 1))),
            share=float(worth[index] / (worth[index] + photos.squares[index] + 1e-300)),
        )
        for index in range(count)
    ]


def _find_typical(own: FloatArray, weight: FloatArray) -> FloatArray:
    """(M,) what most photos (K, M) have: their median by what each can tell, (K, M, M).

    A photo hardly tells some of its own terms from its pose; what it says of them is no evidence.
    Weighted least squares in which photos beyond noise count by one over their distance in noise.
    """
    counts = np.ones(len(own))
    for _ in range(_TYPICAL_ROUNDS):
        typical = mean_of(own, counts[:, None, None] * weight)
        off = own - typical
        distance = np.einsum("ki,kij,kj->k", off, weight, off)
        counts = 1 / np.sqrt(np.maximum(distance, 1.0))
    return typical
