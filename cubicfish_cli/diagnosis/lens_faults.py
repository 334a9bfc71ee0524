"""Photos through more than one lens: zoomed, cropped, scaled or turned ones, other cameras.

Photos that fit no lens together, and do without some of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.diagnosis.photo_lenses import (
    BY_CHANCE,
    WORTH,
    PhotoLenses,
    TwoLenses,
    Unlike,
    enough_photos,
    fit_of_few,
    left_out_share,
    photo_lenses,
    sheared_photos,
    spread_out,
    two_lenses,
    zoomed_photos,
)
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import adjust
from cubicfish_cli.fitting.cubic_fit import fit_cubic
from cubicfish_cli.fitting.evidence import FitEvidence
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.lenses import FixedLens
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial, refit_radial
from cubicfish_cli.fitting.refinement import TargetFit
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.fitting.subset import flatness, select_photos
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# A first look at a fit that one lens has bent to both sees less than there is: it is followed up.
_WORTH_A_LOOK = 1e-2
# So is a photo that is unlike the others. It is judged by a camera that never saw it, which is
# right about it only if it comes from so many times as many equations as unknowns, and from so
# many photos that what the target is off by does not look like a lens of its own in one of them.
_SUSPICIOUS = 1e-4
_TIMES_DETERMINED = 10
_FEWEST_OTHERS = 8
# Two lenses are worth an accusation where they take this share of the squared error away from
# photos that had no say in them, where they explain so much of how photos differ, and where a
# person would notice: pixels of a photo of 2000.
_CLEAR_MARGIN = 0.1
_MOST = 0.8
_NOTICED_PX, _SIDE = 0.05, 2000.0
# Photos of one lens foretell another one's squared errors to this share of what is left, or of
# what two lenses take away. Where the focus is another in every photo, groups of photos do not.
_FORETOLD, _FORETOLD_OF_GAIN = 0.15, 0.05
# Of fewer photos of one flat board a lens of their own says nothing.
_FEWEST_OF_A_PLANE = 3
# By themselves, photos that do not fit have no more than this of their squared error.
_HALF = 0.5
# Photos that were left out say that the camera is wrong where they are so many.
_MANY_LEFT_OUT = 1 / 3
_ROUNDS = 12
# Shares of the gain that makes two lenses worth it: what the first of these rounds gains at least
# where they are, and by how much less than that another round gains where they have settled.
_AT_ONCE, _SETTLED = 0.5, 0.01
_ROUGH_DECREASE = 1e-4
# What is smaller than this share of the larger of two differences is taken for none.
_NONE = 0.25
# Centres that agree to this share of the longer side are the same.
_SAME_CENTRE = 0.01
_SURE_FOCAL = 0.03
# Lenses whose scales differ by less are told apart by their centres only.
_SAME_FOCAL = 0.003
_TYPICAL_NOISE = 4.0
# Wide enough to feel every corner while a pose is off.
_WIDE_HUBER_PX = 10.0
# Boards whose corners leave a plane by less than this share of their extent count as flat.
_FLAT = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class LensChange:
    """How the lens of some photos differs from that of the others.

    Attributes:
        ratio: of its scale to the others'.
        shift: (2,) of its centre from the others', pixels.
        centre: (2,) of the others, pixels.

    """

    ratio: float
    shift: FloatArray
    centre: FloatArray


def lens_findings(evidence: FitEvidence) -> list[Finding]:
    """Two groups of photos with a lens each, in place of one lens for all."""
    # A target that is free may bend to two lenses: as drawn it does not.
    fits = (evidence.fit,) if evidence.fit is evidence.drawn else (evidence.fit, evidence.drawn)
    for fit in fits:
        own = _own(fit)
        split = two_lenses(own)
        if split is None or split.chance > _WORTH_A_LOOK or split.share < WORTH / 2:
            continue
        few = _of_each(own, split)
        # A few of each group tell whether there are two lenses, all of them which photos are whose.
        if len(few) < len(own.photos):
            part = fit_of_few(fit, own.photos[few])
            if _followed(part, rms_px(part.cubic.residual)) is None:
                continue
        found = _followed(fit, rms_px(evidence.fit.cubic.residual))
        if found is not None:
            return [found]
    return []


def _own(fit: TargetFit) -> PhotoLenses:
    pairs = fit.reference.pairs
    return photo_lenses(fit.cubic.lens, fit.cubic.poses, pairs, pairs.world)


def _of_each(photos: PhotoLenses, split: TwoLenses) -> IntArray:
    """Places in ``photos`` of enough photos, half of them of each group where it has as many."""
    enough = enough_photos(len(photos.photos))
    groups = [np.flatnonzero(split.second == second) for second in (False, True)]
    least = min(enough // 2, *map(len, groups))
    return np.sort(np.concatenate([spread_out(group, enough - least) for group in groups]))


def _followed(fit: TargetFit, together: float) -> Finding | None:
    """Fit with a scale and centre for each of two groups, until they settle; then judge.

    Args:
        fit: the fit to start from.
        together: RMS with one lens for all, to be beaten.

    """
    pairs, photos = fit.reference.pairs, _own(fit)
    apart, split, reach = fit, two_lenses(photos), photos.reach
    noticed = _noticed_px(pairs)
    given, gains = np.zeros((len(pairs.images), 3)), [0.0]
    worthy = _worthy_gain(together, noticed)
    for _ in range(_ROUNDS):
        if split is None:
            return None
        given = _given(split, photos, given)
        apart, photos = _fitted_apart(fit, apart, given, reach)
        split = two_lenses(photos)
        gains.append(together**2 - rms_px(apart.cubic.residual) ** 2)
        if len(gains) == 2 and gains[1] < _AT_ONCE * worthy:
            return None
        if gains[-1] - gains[-2] < _SETTLED * worthy:
            break
    if split is None or split.chance > BY_CHANCE:
        return None
    if split.kind == "order":
        split, apart, photos = _at_the_boundary(fit, split, apart, photos)
    apart_px = rms_px(apart.cubic.residual)
    unforeseen = left_out_share(photos, split.second)
    severity = worth(together, apart_px, unforeseen, noticed)
    if split.explained < _MOST or severity is None:
        return None
    scale = 1 + split.own[:, 0] / reach
    middle = (np.array(pairs.image_size, float) - 1) / 2
    camera = apart.reference.camera
    common = np.array([camera.cx, camera.cy]) - middle
    centres = middle + scale[:, None] * common + split.own[:, 1:]
    change = LensChange(
        ratio=float(scale[1] / scale[0]), shift=centres[1] - centres[0], centre=centres[0]
    )
    names = [pairs.images[photo] for photo in photos.photos[split.second]]
    found = lens_change(
        change,
        names,
        pairs,
        in_order=split.kind == "order",
        because="apart",
        figures={"together_px": together, "apart_px": apart_px},
    )
    return replace(found, severity=severity)


def _noticed_px(pairs: Observations) -> float:
    """Pixels that a person would notice."""
    return _NOTICED_PX * max(1.0, max(pairs.image_size) / _SIDE)


def worth(together: float, apart: float, unforeseen: float, noticed: float) -> Severity | None:
    """What two lenses are worth that explain clearly more than one; None where they do not.

    Bad is a camera of photos whose two lenses foretell photos that had no say in them. Those of a
    few photos do not: then it is a note.

    Args:
        together: RMS with one lens for all, pixels.
        apart: with two.
        unforeseen: how many times larger the squared error is of photos that had no say.
        noticed: pixels that a person would notice.

    """
    left, gain = apart**2, together**2 - apart**2
    not_foretold = left * (unforeseen - 1)
    least = _worthy_gain(together, noticed)
    foretold = not_foretold <= max(_FORETOLD * left, _FORETOLD_OF_GAIN * gain)
    if foretold and gain - not_foretold >= least:
        return Severity.BAD
    return Severity.NOTE if gain >= least else None


def _worthy_gain(together: float, noticed: float) -> float:
    """By how much two lenses have to lower the mean squared error, pixels²."""
    return max(_CLEAR_MARGIN * together**2, noticed**2)


def _given(split: TwoLenses, photos: PhotoLenses, like: FloatArray) -> FloatArray:
    """(photos, 3) scale and shift of each photo's group; none for photos that do not tell."""
    given = np.zeros_like(like)
    given[photos.photos] = split.own[split.second.astype(int)]
    return given


def _fitted_apart(
    fit: TargetFit, start: TargetFit, given: FloatArray, reach: float
) -> tuple[TargetFit, PhotoLenses]:
    """Fit with these scales and shifts (photos, 3); and what each photo has of its own in all.

    Raises:
        FitError: there is no camera.

    """
    pairs = fit.reference.pairs
    own, middle = given[pairs.image], (np.array(pairs.image_size, float) - 1) / 2
    # Pixels as one lens would have taken them.
    pixel = middle + (pairs.pixel - middle - own[:, 1:]) / (1 + own[:, :1] / reach)
    reference = refit_radial(start.reference, replace(pairs, pixel=pixel), start.reference.poses)
    cubic = fit_cubic(
        reference,
        fit.cubic.hold,
        start=start.cubic,
        relative_decrease=_ROUGH_DECREASE,
    )
    apart = replace(start, reference=reference, cubic=cubic)
    photos = _own(apart)
    total = photos.own.copy()
    total[:, :3] += given[photos.photos]
    return apart, replace(photos, own=total)


def _at_the_boundary(
    fit: TargetFit, split: TwoLenses, apart: TargetFit, photos: PhotoLenses
) -> tuple[TwoLenses, TargetFit, PhotoLenses]:
    """The change one photo earlier or later, where that fits better.

    A photo beside the change that was counted to the wrong side has bent the camera to itself.
    """
    first = int(np.argmax(split.second))
    for place in (first, first - 1):
        second = split.second.copy()
        second[place] = not second[place]
        moved = replace(split, second=second)
        wanted = _given(moved, photos, np.zeros((len(fit.reference.pairs.images), 3)))
        other, own = _fitted_apart(fit, apart, wanted, photos.reach)
        if rms_px(other.cubic.residual) ** 2 < (1 - WORTH) * rms_px(apart.cubic.residual) ** 2:
            return moved, other, own
    return split, apart, photos


def left_out_lens(
    camera: RadialCamera, pairs: Observations, noise: float, *, order: Sequence[str]
) -> Finding | None:
    """Whether photos that do not fit do fit a lens of their own.

    Args:
        camera: the lens of the photos that fit.
        pairs: pairs of the photos that do not.
        noise: standard deviation of a corner's coordinate in those that fit, pixels.
        order: the names of all photos, in order.

    """
    if flatness(pairs.world) < _FLAT and len(pairs.images) < _FEWEST_OF_A_PLANE:
        return None
    try:
        own = fit_radial(pairs)
    except (FitError, np.linalg.LinAlgError):
        return None
    if own.focal_uncertainty > _SURE_FOCAL or noise_px(own.residual) > _TYPICAL_NOISE * noise:
        return None
    angle = np.linspace(0.1, own.covered, 30)
    radii = [lens.fx * lens.profile(angle) for lens in (camera, own.camera)]
    centres = [np.array([lens.cx, lens.cy]) for lens in (camera, own.camera)]
    ratio, shift = float(np.median(radii[1] / radii[0])), centres[1] - centres[0]
    if abs(ratio - 1) < _SAME_FOCAL and np.hypot(*shift) < 1:
        return None
    names = list(own.pairs.images)
    if not _clearly_other(camera, own):
        return None
    because = "own_lens"
    change = LensChange(ratio=ratio, shift=shift, centre=centres[0])
    first = list(order[: len(names)]) == names
    if first and len(names) < len(order):  # what came before the others, seen from these
        names = list(order[len(names) :])
        change = LensChange(ratio=1 / ratio, shift=-shift, centre=centres[1])
        because = "own_lens_before"
    in_order = first or list(order[-len(names) :]) == names
    found = lens_change(
        change,
        names,
        pairs,
        in_order=in_order,
        because=because,
        figures={"own_px": rms_px(own.residual)},
    )
    # The camera is that of the others, and right, unless it may be the others that are odd.
    many = len(own.pairs.images) >= _MANY_LEFT_OUT * len(order)
    return found if many else replace(found, severity=Severity.CARE)


def _clearly_other(camera: RadialCamera, own: RadialReference) -> bool:
    """Whether photos fit their own lens clearly better than another one, poses being free."""
    fit, placed, _ = fit_poses(camera, own.pairs)
    if fit is None or len(placed.pixel) < len(own.pairs.pixel):
        return True
    return noise_px(own.residual) ** 2 < _HALF * noise_px(fit.residual) ** 2


def lens_change(
    change: LensChange,
    names: list[str],
    pairs: Observations,
    *,
    in_order: bool,
    because: str,
    figures: Mapping[str, float],
) -> Finding:
    """What kind of difference there is between the lens of some photos and the others'.

    Args:
        change: the difference.
        names: the photos.
        pairs: any pairs of the same size of photo.
        in_order: whether they are all photos from one on.
        because: what says so.
        figures: the figures of that.

    """
    size = np.array(pairs.image_size, float)
    reach, near = size.min() / 2, _SAME_CENTRE * size.max()
    by_scale = abs(change.ratio - 1) * reach
    by_shift = float(np.hypot(*change.shift))
    scaled_centre = (change.ratio - 1) * (change.centre + 0.5)
    turned = size - 1 - 2 * change.centre
    if by_scale < _NONE * by_shift and np.hypot(*(change.shift - turned)) < min(
        near, 0.2 * by_shift + 1
    ):
        code = Code.TURNED
    elif by_scale > _NONE * by_shift and np.hypot(*(change.shift - scaled_centre)) < max(
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
            "scale": _ratio_words(change.ratio),
            "focal_off": change.ratio - 1,
            "x_px": float(change.shift[0]),
            "y_px": float(change.shift[1]),
        },
    )


def _ratio_words(ratio: float) -> str:
    """A ratio with two digits of what it differs from 1 by, and three at least."""
    digits = 1 - int(np.floor(np.log10(max(abs(ratio - 1), 1e-9))))
    return f"{ratio:.{max(digits, 2)}f}"


def odd_photos(fit: TargetFit) -> list[Finding]:
    """Photos that by themselves are sheared, or have another lens than the rest."""
    pairs, photos = fit.reference.pairs, _own(fit)
    suspects = {
        one.photo
        for one in (*sheared_photos(photos), *zoomed_photos(photos))
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
    kinds = ((sheared_photos(photos), Code.SHEARED), (zoomed_photos(photos), Code.PHOTO_LENS))
    for unlike, code in kinds:
        certain = [
            one
            for one in unlike
            if one.photo in suspects
            and one.chance < BY_CHANCE
            and one.share > WORTH
            and one.gain_px > _noticed_px(pairs)
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
        few.reference, few.cubic.hold, start=few.cubic, relative_decrease=_ROUGH_DECREASE
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


_FEWEST_PHOTOS = 3
# Photos agree with a lens when their noise is within this many times the best ones'.
_AGREES = 6.0
# Neighbouring photos are tried at so many places in their order, and so many lenses on all.
_MOST_RUNS = 12
_MOST_LENSES = 8


def failed_lens(pairs: Observations) -> list[Finding]:
    """Some photos that agree on a lens, and others that do not, where such are found.

    Args:
        pairs: all pairs, in units in which the target is of order 1.

    """
    count = len(pairs.images)
    if count <= _FEWEST_PHOTOS:
        return []
    lenses = []
    for few in _subsets(count):
        try:
            lens = fit_radial(select_photos(pairs, few), thorough=False)
        except (FitError, np.linalg.LinAlgError):
            continue
        if lens.focal_uncertainty < _SURE_FOCAL:
            lenses.append(lens)
    if not lenses:
        return []
    noise = min(noise_px(lens.residual) for lens in lenses)
    alike = [lens for lens in lenses if noise_px(lens.residual) <= 2 * noise]
    surest = sorted(alike, key=lambda lens: lens.focal_uncertainty)[:_MOST_LENSES]
    agreeing = max((_agreeing(lens, pairs, noise) for lens in surest), key=len)
    if not _FEWEST_PHOTOS <= len(agreeing) < count:
        return []
    lens = fit_radial(select_photos(pairs, agreeing))
    others = np.setdiff1d(np.arange(count), agreeing)
    found = left_out_lens(
        lens.camera, select_photos(pairs, others), noise_px(lens.residual), order=pairs.images
    )
    if found is not None:
        return [found]
    return [
        Finding(
            code=Code.PHOTO_LENS,
            case="left_out",
            severity=Severity.BAD,
            images=tuple(pairs.images[photo] for photo in others),
            figures={"others": len(agreeing), "noise_px": noise_px(lens.residual)},
        )
    ]


def _subsets(count: int) -> Iterable[IntArray]:
    """A few photos at a time: neighbours, every second or third one, and at random."""
    size = max(_FEWEST_PHOTOS, min(6, count // 3))
    starts = np.arange(0, max(count - size, 0) + 1, max(1, size // 2))
    for first in starts[np.unique(np.linspace(0, len(starts) - 1, _MOST_RUNS).astype(int))]:
        yield np.arange(first, min(first + size, count))
    for step in (2, 3):
        for first in range(step):
            yield np.arange(first, count, step)[:size]
    rng = np.random.default_rng(0)
    for _ in range(12):
        yield np.sort(rng.choice(count, min(_FEWEST_PHOTOS, count), replace=False))


def _agreeing(lens: RadialReference, pairs: Observations, noise: float) -> IntArray:
    fit, own, placed = fit_poses(lens.camera, pairs)
    if fit is None:
        return np.zeros(0, np.intp)
    limit = _AGREES * max(noise, 1e-3)
    good = [
        photo
        for number, photo in enumerate(placed)
        if noise_px(fit.residual[own.image == number]) <= limit
    ]
    return np.array(good, np.intp)
