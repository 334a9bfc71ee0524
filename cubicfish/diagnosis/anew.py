"""What is another in every photo: a sheet that bends, a hand that moves, a focus that breathes.

No photo is unlike the others then. What each photo has of its own is linear at the optimum of the
fit: of the causes that it may have, the one is told that explains most of the error beyond noise,
and by far the most for how free it is.
"""

import numpy as np

from cubicfish.diagnosis.photo_lenses import FEWEST_COMPARED, LENS, TERMS, noticed_px, own_triangles
from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.statistics import local_noise_px, rms_px
from cubicfish.types import FloatArray

# What a photo is off by before its cause is worth a word, pixels of a photo of 2000.
_MATTERS_PX = 0.25
# The cause is what is wrong: of the errors beyond the corners' own noise it leaves at most half of
# their size, so it explains this share of the square, and so many times as much as any other for
# each of its terms, by what it leaves (an F ratio).
_MOST, _TIMES = 1 - 0.5**2, 2.0
# Singular values below this share of the largest are of terms that the photo does not show.
_RCOND = 1e-6
# What boards bend by: two bends and a twist.
_BENDS = 3
_CAUSES = (
    (Code.ZOOM, slice(0, 1)),
    (Code.SHIFTED, slice(1, LENS.stop)),
    (Code.PHOTO_LENS, slice(LENS.stop, TERMS)),
    (Code.BENT, slice(TERMS, None)),
)


def changes_anew(evidence: FitEvidence) -> list[Finding]:
    """Find what is another in every photo, where photos are off by enough to matter."""
    fit = evidence.fit
    pairs = fit.reference.pairs
    limit = noticed_px(pairs, _MATTERS_PX)
    if rms_px(fit.errors) < limit:
        return []
    noise = local_noise_px(pairs, fit.residual) ** 2
    photos, triangles, numbers = own_triangles(fit.lens, fit.poses, pairs, _bend_points(fit))
    if len(photos) < FEWEST_COMPARED:
        return []
    explained = []
    for code, terms in _CAUSES:
        free, miss = triangles[:, :, :-1][:, :, terms], triangles[:, :, -1:]
        # What all photos share is the lens's, or the target's.
        shared = np.linalg.lstsq(np.concatenate(free), np.concatenate(miss), rcond=_RCOND)[0]
        own, size, _ = np.linalg.svd(free, full_matrices=False)
        shown = size > _RCOND * size.max(axis=1, keepdims=True)
        differ = miss - free @ shared
        part = np.square(own.transpose(0, 2, 1) @ differ)[:, :, 0] * shown
        square, ranks = float(np.square(differ).sum()), max(float(shown.sum()), 1.0)
        share, left = float(part.sum()) / square, numbers.sum() - ranks
        strength = share / ranks / ((1 - share) / left + 1e-300)
        # What of the variance beyond noise is left.
        beyond = max(square / numbers.sum() - noise, 1e-300)
        left_over = float(max((1 - share) * square / left - noise, 0.0) / beyond)
        explained.append((strength, 1 - left_over, code, part.sum(axis=1)))
    (second, *_), (first, share, code, best) = sorted(explained, key=lambda one: one[0])[-2:]
    # By all corners alike: those that are off weigh less in the fit.
    errors = [rms_px(fit.residual[pairs.image == photo]) for photo in photos]
    own_px = np.array(errors) * np.sqrt(best / np.sum(triangles[:, :, -1] ** 2, axis=1))
    size_px = float(np.sqrt(np.average(own_px**2, weights=numbers)))
    if share < _MOST or first < _TIMES * second or size_px < limit:
        return []
    worst = np.argsort(-own_px, kind="stable")
    return [
        Finding(
            code=code,
            case="anew",
            severity=Severity.CARE,
            images=tuple(np.array(pairs.images)[photos[worst[own_px[worst] > limit]]].tolist()),
            figures={"size_px": size_px, "worst_px": float(own_px.max()), "share": share},
        )
    ]


def _bend_points(fit: CameraFit) -> FloatArray:
    """(N, 3, B) how bends and twists of the boards, three of each, move the points of the pairs."""
    pairs, nominal = fit.reference.pairs, fit.nominal
    boards = nominal.target.boards if nominal.target else ()
    moved = np.zeros((len(pairs.pixel), 3, _BENDS * max(len(boards), 1)))
    for index, board in enumerate(boards):
        own = np.flatnonzero(pairs.board == index)
        if board.points is None:
            x, y = board.normalised(board.plane_points(pairs.column[own], pairs.row[own]))[0].T
            heights = np.stack([x * x, y * y, x * y], axis=1)
            terms = slice(_BENDS * index, _BENDS * (index + 1))
            moved[own, :, terms] = board.axes[2][:, None] * heights[:, None]
    return moved
