"""The lens that each photo would have of its own, if every photo were taken through another lens.

Beside the fitted camera and its own pose, each photo gets a lens of its own, as far as one photo
determines one: another scale, another centre, and a shear that grows from row to row. All of it is
linear at the optimum of the fit, so it costs one pass over the corners. Single photos that are
unlike the others were taken through another lens, or while something moved.
"""

from dataclasses import dataclass, replace

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.uncertainty import of_size
from cubicfish.solve.adjustment import adjust, huber_weight
from cubicfish.solve.chances import beyond_f
from cubicfish.solve.deformable_target import DeformableTarget
from cubicfish.solve.fit_lens import FitLens, FixedLens
from cubicfish.solve.poses import Poses, cross_matrix
from cubicfish.solve.statistics import wide_px
from cubicfish.solve.subset import select_photos
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray

# Terms that a photo may have of its own: scale, shift x, shift y, and a shift x, y growing by rows.
TERMS = 5
LENS = slice(0, 3)
# Twice as many equations as unknowns, which are 6 of the pose and these.
_FEWEST_CORNERS = 12
_AT_A_TIME = 5000
# Two groups, or one photo, look unlike the others by chance this often in right set-ups.
BY_CHANCE = 1e-6
# A blamed thing must explain this share of the squared error, or it is not worth a word.
LEAST_SHARE = 0.05
# Fewer photos do not show how much photos differ.
FEWEST_COMPARED = 5
# Pixels of a photo of 2000 pixels that a person would notice.
_NOTICED_PX = 0.05
ROUGH_DECREASE = 1e-4
"""For fits that photos are only compared with."""
# A photo that is unlike the others is judged by a camera that never saw it. That camera is right
# about the photo only if it comes from so many times as many equations as unknowns, and from so
# many photos that deviations of the target do not look like a lens of its own in one of them.
_SUSPICIOUS = 1e-4
_TIMES_DETERMINED = 10
_FEWEST_OTHERS = 8
# Wide enough that every corner counts while a pose is off.
_WIDE_HUBER_PX = 10.0
_TYPICAL_ROUNDS = 20


def noticed_px(pairs: Observations, of_2000: float = _NOTICED_PX) -> float:
    """The pixels that a person would notice, from those in a photo of 2000 pixels."""
    return of_2000 * of_size(pairs.image_size)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoLenses:
    """The lens that each photo would have of its own, in pixels at ``half_side`` from the centre.

    Attributes:
        photos: (K,) the photos with enough corners.
        own: (K, 5) scale, shift x, shift y, shear x, shear y.
        information: (K, 5, 5) what other values cost: a squared error in pixels.
        squares: (K,) sum of squared errors of the photo with its own lens.
        numbers: (K,) how many degrees of freedom are left in each photo.
        half_side: half the shorter side, pixels.

    """

    photos: IntArray
    own: FloatArray
    information: FloatArray
    squares: FloatArray
    numbers: FloatArray
    half_side: float

    def lens_information(self) -> FloatArray:
        """(K, 3, 3) information on scale and shift, with the shear free: a Schur complement."""
        kept, rest = np.split(np.arange(TERMS), [LENS.stop])
        cross = self.information[:, kept[:, None], rest]
        inner = invertible(self.information[:, rest[:, None], rest])
        left = cross @ np.linalg.solve(inner, cross.transpose(0, 2, 1))
        return invertible(self.information[:, kept[:, None], kept] - left)


def mean_of(own: FloatArray, weight: FloatArray) -> FloatArray:
    """(M,) the mean of photos' terms (K, M), weighted by their information (K, M, M)."""
    return np.asarray(np.linalg.solve(weight.sum(axis=0), np.einsum("kij,kj->i", weight, own)))


def invertible(information: FloatArray) -> FloatArray:
    """The same information (K, M, M), and next to none on terms that photos do not show."""
    floor = 1e-9 * np.trace(information, axis1=1, axis2=2)[:, None, None]
    return np.asarray(information + floor * np.eye(information.shape[1]))


def lenses_of(fit: CameraFit) -> PhotoLenses:
    """The lens that each photo of a fit would have of its own, with the target of the fit."""
    return photo_lenses(fit.lens, fit.poses, fit.reference.pairs)


def photo_lenses(lens: FitLens, poses: Poses, pairs: Observations) -> PhotoLenses:
    """The lens that each photo would have of its own, beyond its pose.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit, their world points as fitted.

    """
    photos, triangles, left = own_triangles(lens, poses, pairs)
    free = triangles[:, :-1, :-1]
    own = np.linalg.pinv(free, rcond=1e-9) @ triangles[:, :-1, -1:]
    off = triangles[:, :, -1:] - np.pad(free, ((0, 0), (0, 1), (0, 0))) @ own
    return PhotoLenses(
        photos=photos,
        own=own[:, :, 0],
        information=free.transpose(0, 2, 1) @ free,
        squares=np.sum(off[:, :, 0] ** 2, axis=1),
        numbers=left - TERMS,
        half_side=min(pairs.image_size) / 2,
    )


def own_triangles(
    lens: FitLens, poses: Poses, pairs: Observations, more: FloatArray | None = None
) -> tuple[IntArray, FloatArray, FloatArray]:
    """What each photo says of terms of its own, beyond its pose.

    Args:
        lens: the fitted lens.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs of the fit, their world points as fitted.
        more: (N, 3, M) how other terms move the world points.

    Returns:
        The photos (K,) with enough corners; their triangles (K, 6 + M, 6 + M) (QR) of scale, shift,
        shear, the other terms and the miss, pixels; and (K,) how many equations are left in each.

    """
    more = np.zeros((len(pairs.image), 3, 0)) if more is None else more
    # In runs: the derivatives by the lens, which come with those by the point, are many.
    starts = range(0, len(pairs.image), _AT_A_TIME)
    rows = [_linearise(lens, poses, pairs, more, slice(one, one + _AT_A_TIME)) for one in starts]
    rows_of_all = np.concatenate(rows)
    # The loss of the fit: grossly wrong corners must not speak for a photo.
    miss = rows_of_all[:, :, -1]
    weight = pairs.weight * huber_weight(np.hypot(miss[:, 0], miss[:, 1]), wide_px(miss))
    rows_of_all *= np.sqrt(weight)[:, None, None]
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    stops, size = np.cumsum(counts), rows_of_all.shape[2]
    photos = np.flatnonzero(counts >= _FEWEST_CORNERS)
    triangles = np.zeros((len(photos), size - 6, size - 6))
    for place, photo in enumerate(photos):
        own = rows_of_all[stops[photo] - counts[photo] : stops[photo]].reshape(-1, size)
        triangle = np.asarray(np.linalg.qr(own, mode="r"))[6:, 6:]
        triangles[place, : len(triangle)] = triangle
    return photos.astype(np.intp), triangles, np.asarray(2.0 * counts[photos] - 6, float)


def _linearise(
    lens: FitLens, poses: Poses, pairs: Observations, more: FloatArray, run: slice
) -> FloatArray:
    """(n, 2, 12 + M) derivatives by pose, scale, shift, shear and more, and the miss, pixels."""
    image = pairs.image[run]
    rotated = (poses.rotation[image] @ pairs.world[run, :, None])[:, :, 0]
    pixel, d_point, _ = lens.pixel_and_slopes(rotated + poses.translation[image])
    middle = (np.array(pairs.image_size, float) - 1) / 2
    from_middle = (pixel - middle) / (min(pairs.image_size) / 2)
    return np.concatenate(
        [
            -d_point @ cross_matrix(rotated),
            d_point,
            from_middle[:, :, None],
            np.broadcast_to(np.eye(2), (len(pixel), 2, 2)),
            # A shift that grows from row to row.
            from_middle[:, 1, None, None] * np.eye(2),
            d_point @ poses.rotation[image] @ more[run],
            (pairs.pixel[run] - pixel)[:, :, None],
        ],
        axis=2,
    )


def best_cut(
    orders: IntArray, weight: FloatArray, pull: FloatArray, fewest: int
) -> tuple[float, float, BoolArray] | None:
    """Find the split with the largest ratio of the scatter between to that within its groups.

    Args:
        orders: (S, K) indices of what is split, in orders that may be cut in two anywhere.
        weight: (K, n, n) information of each on its own terms; ``pull`` (K, n) is that times the
            terms.
        pull: see ``weight``.
        fewest: how many a group has at least.

    Returns:
        The ratio, the scatter between, and which are behind the cut; None where there are too few.

    """
    count = len(pull)
    square = np.einsum("ki,ki->k", pull, np.linalg.solve(weight, pull[:, :, None])[:, :, 0])
    mean = np.linalg.solve(weight.sum(axis=0), pull.sum(axis=0))
    total = float(square.sum() - mean @ pull.sum(axis=0))
    # Sums over those up to each cut, and over those behind it, suffice for their scatter.
    cuts = np.arange(fewest, count - fewest + 1)
    best: tuple[float, float, BoolArray] | None = None
    for order in orders if cuts.size else []:
        before = [np.cumsum(terms[order], axis=0) for terms in (weight, pull, square)]
        within = np.zeros(len(cuts))
        for w, p, s in (
            [terms[cuts - 1] for terms in before],
            [terms[-1] - terms[cuts - 1] for terms in before],
        ):
            means = np.linalg.solve(w, p[:, :, None])[:, :, 0]
            within += np.maximum(s - np.sum(means * p, axis=1), 0)
        within = np.maximum(within, max(1e-12 * total, 1e-300))
        cut = int(np.argmin(within))
        between = float(total - within[cut])
        ratio = between / float(within[cut]) * (count - 2)
        if best is None or ratio > best[0]:
            second = np.zeros(count, bool)
            second[order[cuts[cut] :]] = True
            best = (ratio, between, second)
    return best


@dataclass(frozen=True, kw_only=True)
class Unlike:
    """How one photo differs from the others.

    Attributes:
        photo: its index.
        chance: how often the most unlike of so many right photos would be as unlike.
        share: the share of the photo's squared error that its own lens explains.
        gain_px: RMS of the explained error, pixels.

    """

    photo: int
    chance: float
    share: float
    gain_px: float


def odd_photos(evidence: FitEvidence) -> list[Finding]:
    """Find photos that by themselves have another lens than the rest, or are sheared."""
    fit = evidence.fit
    pairs, photos = fit.reference.pairs, lenses_of(fit)
    suspects = [
        one.photo
        for one in unlike(photos)
        if one.chance < _SUSPICIOUS and one.share > LEAST_SHARE / 2
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
        and one.share > LEAST_SHARE
        and one.gain_px > noticed_px(pairs)
    ]
    if not 0 < 2 * len(certain) < len(pairs.images):
        return []
    most = max(certain, key=lambda one: one.gain_px)
    return [
        Finding(
            code=Code.PHOTO_LENS,
            # A camera that eight other photos determine hardly depends on one.
            severity=Severity.NOTE if len(certain) == 1 else Severity.CARE,
            images=tuple(pairs.images[one.photo] for one in certain),
            figures={
                "size_px": most.gain_px,
                "share": most.share,
                "worst": pairs.images[most.photo],
            },
        )
    ]


def _can_do_without(fit: CameraFit, left_out: IntArray) -> bool:
    """Whether the other photos make a camera that is right about photos it has not seen."""
    pairs = fit.reference.pairs
    others = np.count_nonzero(~np.isin(pairs.image, left_out))
    poses = len(pairs.images) - len(left_out)
    unknowns = len(fit.lens.parameters) + 6 * poses
    return bool(poses >= _FEWEST_OTHERS and 2 * others >= _TIMES_DETERMINED * unknowns)


def _refit_without(fit: CameraFit, suspects: IntArray) -> PhotoLenses:
    """The lens that each photo has of its own, beside one that was fitted without some."""
    pairs = fit.reference.pairs
    good = np.setdiff1d(np.arange(len(pairs.images)), suspects)
    kept, own = select_photos(pairs, good), np.isin(pairs.image, good)
    reference = replace(
        fit.reference,
        pairs=kept,
        poses=fit.reference.poses[good],
        residual=fit.reference.residual[own],
    )
    start = replace(
        fit,
        poses=fit.poses[good],
        residual=fit.residual[own],
        pairs=kept,
        world=DeformableTarget(nominal=kept.world),
    )
    cubic = fit_cubic(reference, start.prior, start=start, relative_decrease=ROUGH_DECREASE)
    # With their poses under the other lens, photos would look grossly wrong all over.
    lens, others = FixedLens(camera=cubic.lens), select_photos(pairs, suspects)
    placed = adjust(lens, fit.poses[suspects], others, huber_px=_WIDE_HUBER_PX)
    poses = fit.poses.with_photos(good, cubic.poses).with_photos(suspects, placed.poses)
    photos = photo_lenses(cubic.lens, poses, pairs)
    if not np.isfinite(photos.own).all():
        raise FitError("photos have no place beside a lens that was fitted without them")
    return photos


def unlike(photos: PhotoLenses) -> list[Unlike]:
    """Measure how much less like the others each photo is than those are like each other.

    There is one result for each of ``photos.photos``; none where they are too few.
    """
    count = len(photos.photos)
    if count < FEWEST_COMPARED:
        return []
    own, size = photos.own, photos.own.shape[1]
    noise = photos.squares / np.maximum(photos.numbers, 1)
    # A photo in dim light is noisier than the others, and nothing else.
    noise = np.maximum(noise, np.median(noise))
    weight = invertible(photos.information) / (size * noise[:, None, None])
    off = own - _find_typical(own, weight)
    distance = np.einsum("ki,kij,kj->k", off, weight, off)
    # The excess of the photos' own terms over noise, by the better half of them.
    spread = max(1.0, float(np.median(distance)))
    # The noise, 1, is known from all corners; the excess over it comes from the better half of the
    # photos (Satterthwaite 1946).
    numbers = size * count / 2 * (spread / max(spread - 1, 1e-6)) ** 2
    chance = beyond_f(size, np.clip(photos.numbers, 1, numbers), distance / spread) * count
    gained = distance * size * noise
    return [
        Unlike(
            photo=int(photos.photos[index]),
            chance=float(chance[index]),
            gain_px=float(np.sqrt(2 * gained[index] / max(photos.numbers[index], 1))),
            share=float(gained[index] / (gained[index] + photos.squares[index] + 1e-300)),
        )
        for index in range(count)
    ]


def _find_typical(own: FloatArray, weight: FloatArray) -> FloatArray:
    """(M,) the terms of most photos (K, M): their median, weighted by information (K, M, M).

    A photo can hardly distinguish some of its own terms from its pose; what it says of them is no
    evidence. In the weighted least squares, photos beyond noise count by one over their distance in
    noise.
    """
    counts = np.ones(len(own))
    for _ in range(_TYPICAL_ROUNDS):
        typical = mean_of(own, counts[:, None, None] * weight)
        off = own - typical
        distance = np.einsum("ki,kij,kj->k", off, weight, off)
        counts = 1 / np.sqrt(np.maximum(distance, 1.0))
    return typical
