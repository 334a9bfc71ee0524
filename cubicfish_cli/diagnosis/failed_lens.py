"""Photos that fit no lens together, and do without some of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cubicfish_cli.diagnosis.lens_faults import left_out_lens
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.subset import select_photos
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

_FEWEST_PHOTOS = 3
# Photos agree with a lens when their noise is within this many times the best ones'.
_AGREES = 6.0
_SURE_FOCAL = 0.03
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
