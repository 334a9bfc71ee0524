"""What kind of difference there is between the lens of some photos and the others'.

And photos that fit no lens together: whether they do without some of them, which have their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.radial_reference import RadialReference, fit_radial
from cubicfish_cli.core.fit.start import fit_poses
from cubicfish_cli.core.fit.statistics import noise_px, rms_px
from cubicfish_cli.core.fit.subset import flatness, select_photos
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# Of fewer photos of one flat board a lens of their own says nothing.
_FEWEST_OF_A_PLANE = 3
# By themselves, photos that do not fit have no more than this of their squared error.
_HALF = 0.5
# Photos that were left out say that the camera is wrong where they are so many.
_MANY_LEFT_OUT = 1 / 3
# What is smaller than this share of the larger of two differences is taken for none.
_NONE = 0.25
# Centres that agree to this share of the longer side are the same.
_SAME_CENTRE = 0.01
_SURE_FOCAL = 0.03
# Lenses whose scales differ by less are told apart by their centres only.
_SAME_FOCAL = 0.003
_TYPICAL_NOISE = 4.0
# Boards whose corners leave a plane by less than this share of their extent count as flat.
_FLAT = 1e-4
_FEWEST_PHOTOS = 3
# Photos agree with a lens when their noise is within this many times the best ones'.
_AGREES = 6.0
# Neighbouring photos are tried at so many places in their order, and so many lenses on all.
_MOST_RUNS = 12
_MOST_LENSES = 8


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


def lens_change(
    change: LensChange,
    names: list[str],
    rest: list[str],
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
        rest: the others.
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
            "rest": rest,
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
        [name for name in order if name not in names],
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
