"""Photos each by itself: single ones that are unlike the others, and all that differ somehow.

A loose sheet bends anew in every photo, autofocus moves the lens along its axis and optical
stabilisation across it. Each is fitted to every photo beside the camera, to first order, and the
one that explains most is named. None makes a camera wrong: it is a mean of all photos.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from cubicfish_cli.diagnosis.photo_lenses import (
    BY_CHANCE,
    FEWEST_TOLD_APART,
    LENS,
    ROUGH_DECREASE,
    SHEAR,
    WORTH,
    PhotoLenses,
    enough_photos,
    fit_of_few,
    lenses_of,
    mean_of,
    noticed_px,
    own_triangles,
    photo_lenses,
    spread_out,
)
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import adjust
from cubicfish_cli.fitting.cubic_fit import fit_cubic
from cubicfish_cli.fitting.lenses import FixedLens
from cubicfish_cli.fitting.refinement import TargetFit
from cubicfish_cli.fitting.subset import select_photos
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# A photo that is unlike the others is judged by a camera that never saw it, which is right about it
# only if it comes from so many times as many equations as unknowns, and from so many photos that
# what the target is off by does not look like a lens of its own in one of them.
_SUSPICIOUS = 1e-4
_TIMES_DETERMINED = 10
_FEWEST_OTHERS = 8
# Wide enough to feel every corner while a pose is off.
_WIDE_HUBER_PX = 10.0
_FEWEST_PHOTOS = 5
# What changes takes this share of the mean squared error away, free numbers counted.
_CLEAR_MARGIN = 0.4
# In so many photos it must do so in each; in some, what changes is as in the mean by chance.
_MANY = 0.4
# Pixels of a photo of 2000 from which on a change of all is worth a word.
_UNSTEADY_PX = 0.1
_TYPICAL_ROUNDS = 20
_FLAT = 0.05  # a refined sheet is bent


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


def odd_photos(fit: TargetFit) -> list[Finding]:
    """Photos that by themselves are sheared, or have another lens than the rest."""
    pairs, photos = fit.reference.pairs, lenses_of(fit)
    suspects = {
        one.photo
        for one in (*unlike(photos, SHEAR), *unlike(photos, LENS))
        if one.chance < _SUSPICIOUS and one.share > WORTH / 2
    }
    if not suspects:
        return []
    if 2 * len(suspects) < len(pairs.images):
        # They have bent the lens and the other photos' poses: judge by a lens without them.
        left_out = np.array(sorted(suspects))
        if not _determined_without(fit, left_out):
            return []
        photos = _without(fit, left_out)
    findings = []
    kinds = ((unlike(photos, SHEAR), Code.SHEARED), (unlike(photos, LENS), Code.PHOTO_LENS))
    for found, code in kinds:
        certain = [
            one
            for one in found
            if one.photo in suspects
            and one.chance < BY_CHANCE
            and one.share > WORTH
            and one.gain_px > noticed_px(pairs)
        ]
        suspects -= {one.photo for one in certain}
        if certain and 2 * len(certain) < len(pairs.images):
            findings.append(_single_finding(certain, pairs, code))
    return findings


def _determined_without(fit: TargetFit, left_out: IntArray) -> bool:
    """Whether the other photos make a camera that is right about photos it has not seen."""
    pairs = fit.reference.pairs
    others = np.count_nonzero(~np.isin(pairs.image, left_out))
    poses = len(pairs.images) - len(left_out)
    unknowns = len(fit.cubic.lens.parameters) + 6 * poses
    return bool(poses >= _FEWEST_OTHERS and 2 * others >= _TIMES_DETERMINED * unknowns)


def _without(fit: TargetFit, suspects: IntArray) -> PhotoLenses:
    """What each photo has of its own beside a lens that was fitted without some."""
    pairs = fit.reference.pairs
    good = np.setdiff1d(np.arange(len(pairs.images)), suspects)
    good = spread_out(good, 2 * enough_photos(len(good)))
    few = fit_of_few(fit, good)
    cubic = fit_cubic(
        few.reference, few.cubic.hold, start=few.cubic, relative_decrease=ROUGH_DECREASE
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


def _single_finding(certain: list[Unlike], pairs: Observations, code: Code) -> Finding:
    most = max(certain, key=lambda one: one.size_px)
    return Finding(
        code=code,
        # A camera that eight others determine hardly hangs on one.
        severity=Severity.NOTE if len(certain) == 1 else Severity.CARE,
        images=tuple(pairs.images[one.photo] for one in certain),
        figures={"size_px": most.size_px, "share": most.share, "worst": pairs.images[most.photo]},
    )


def unlike(photos: PhotoLenses, terms: slice) -> list[Unlike]:
    """How much less like the others each photo is in some terms than those are like each other.

    One for each of ``photos.photos``; none where they are too few to tell.
    """
    count = len(photos.photos)
    if count < FEWEST_TOLD_APART:
        return []
    weight = photos.told_of(terms)
    own = photos.own[:, terms]
    size = own.shape[1]
    noise = photos.squares / np.maximum(photos.numbers, 1)
    # A photo in dim light is noisier than the others, and nothing else.
    noise = np.maximum(noise, np.median(noise))
    weight /= size * noise[:, None, None]
    off = own - _typical(own, weight)
    distance = np.einsum("ki,kij,kj->k", off, weight, off)
    # What the photos' own terms are beyond noise, by the better half of them.
    spread = max(1.0, float(np.median(distance)))
    # The noise, 1, is known from all corners; what is beyond it is told by the better half of the
    # photos (Satterthwaite 1946).
    told = size * count / 2 * (spread / max(spread - 1, 1e-6)) ** 2
    chance = fdtrc(size, np.clip(photos.numbers, 1, told), distance / spread) * count
    worth = distance * size * noise
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


def _typical(own: FloatArray, weight: FloatArray) -> FloatArray:
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


def unsteady(fit: TargetFit) -> list[Finding]:
    """What seems to change from photo to photo, as a note; empty where nothing clearly does."""
    pairs, poses = fit.reference.pairs, fit.cubic.poses
    world = fit.cubic.fit.world.points
    bend = _bends(pairs, world)

    def bent(run: slice, d_point: FloatArray, _: FloatArray) -> FloatArray:
        return np.asarray(d_point @ poses.rotation[pairs.image[run]] @ bend[run])

    photos, triangles = own_triangles(fit.cubic.lens, poses, pairs, world, bent)
    if len(photos) < _FEWEST_PHOTOS:
        return []
    terms = {Code.AUTOFOCUS: slice(0, 1), Code.STABILISATION: slice(1, 3)}
    if bend.shape[2]:
        terms[Code.SHEET_BENDS] = slice(3, 3 + bend.shape[2])
    equations = 2.0 * np.bincount(pairs.image, minlength=len(pairs.images))[photos] - 6
    changes = {cause: _change(triangles, columns) for cause, columns in terms.items()}
    each = {
        cause: float(one.own.sum() / (equations - one.numbers).sum())
        for cause, one in changes.items()
    }
    cause = min(each, key=lambda one: each[one])
    change = changes[cause]
    # What all photos have in common, as a board that is always bent, does not change.
    variance = float(change.common.sum() / equations.sum())
    change_px = float(np.sqrt(2 * max(variance - each[cause], 0.0)))
    # In many photos, not in a few that are odd.
    left_free = equations - change.numbers
    own_share = change.own / left_free * equations / np.maximum(change.common, 1e-300)
    if max(each[cause] / variance, float(np.quantile(own_share, _MANY))) > 1 - _CLEAR_MARGIN:
        return []
    if change_px < noticed_px(pairs, _UNSTEADY_PX):
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Change:
    """What photos are off by with a change of something.

    Attributes:
        common, own: (K,) the sum of squared errors of each photo with one change for all, and with
            a change of its own.
        numbers: (K,) how many free numbers the own one has.

    """

    common: FloatArray
    own: FloatArray
    numbers: FloatArray


def _change(triangles: FloatArray, columns: slice) -> _Change:
    """Fit a change to photos (see :func:`own_triangles`), whose terms are some of the columns."""
    terms, miss = triangles[:, :, columns], triangles[:, :, -1:]
    shared = terms.reshape(-1, terms.shape[2])
    step = np.linalg.lstsq(shared, miss.reshape(-1, 1), rcond=1e-9)[0]
    common, own, numbers = (np.zeros(len(triangles)) for _ in range(3))
    for place, (term, off) in enumerate(zip(terms, miss, strict=True)):
        mine, _, numbers[place], _ = np.linalg.lstsq(term, off, rcond=1e-9)
        own[place] = np.sum((off - term @ mine) ** 2)
        common[place] = np.sum((off - term @ step) ** 2)
    return _Change(common=common, own=own, numbers=numbers)


def _bends(pairs: Observations, world: FloatArray) -> FloatArray:
    """(N, 3, 3 B) how points move when one of B flat boards bends in three ways: x², xy and y²."""
    parts = []
    for board in np.unique(pairs.board):
        here = pairs.board == board
        off = world[here] - world[here].mean(axis=0)
        _, extent, axes = np.linalg.svd(off, full_matrices=False)
        # No sheet, or corners of one row.
        if len(extent) < 3 or not extent[2] < _FLAT * extent[0] < extent[1]:
            continue
        plane = off @ axes[:2].T
        x, y = (plane / np.abs(plane).max(axis=0)).T
        bend = np.zeros((len(world), 3, 3))
        bend[here] = axes[2][None, :, None] * np.stack([x * x, x * y, y * y], axis=-1)[:, None]
        parts.append(bend)
    return np.concatenate([np.zeros((len(world), 3, 0)), *parts], axis=2)
