"""Why photos, or boards in photos, do not fit the lens of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.diagnosis.board_faults import FEWEST_CORNERS, board_fault, board_findings
from cubicfish_cli.diagnosis.lens_faults import left_out_lens
from cubicfish_cli.diagnosis.mirrored import handed
from cubicfish_cli.fitting.evidence import FitEvidence
from cubicfish_cli.fitting.refinement import ObjectFit
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.subset import select_photos
from cubicfish_cli.observations import Observations
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

_FEWEST_PHOTOS = 3
_MOST_LEFT_OUT = 30
# A fault in so many of a board's photos is the drawing's.
_NEARLY_ALL_PHOTOS = 0.8


def left_out(evidence: FitEvidence) -> list[Finding]:
    """Why photos, or boards in photos, do not fit the lens of the others."""
    pairs, fit, drawing = evidence.pairs, evidence.fit, evidence.drawing
    mirrored = {name for one in handed(pairs) for name in one.images}
    names = _left_out(pairs, fit, evidence.dropped) - mirrored
    photos = np.array([i for i, name in enumerate(pairs.images) if name in names], np.intp)
    if not photos.size:
        return []
    camera, noise = fit.reference.camera, noise_px(fit.reference.residual)
    scaled = pairs.with_world(pairs.world / drawing.scale)
    findings: list[Finding] = []
    unfit = [photo for photo in photos if pairs.images[photo] in fit.reference.unfit]
    if unfit:
        own = left_out_lens(
            camera, select_photos(scaled, np.array(unfit)), noise, order=pairs.images
        )
        if own is not None:
            findings.append(own)
            photos = np.setdiff1d(
                photos, [i for i, name in enumerate(pairs.images) if name in own.images]
            )
    if drawing.target is not None:
        target, tried = drawing.target, photos[:_MOST_LEFT_OUT]
        singly = (select_photos(scaled, np.array([photo])) for photo in tried)
        faults = [board_fault(camera, one, target, drawing.scale, noise) for one in singly]

        def is_usual(name: str, times: int) -> bool:
            """Whether so many of the photos that were tried show it of nearly all there are."""
            own = pairs.image[pairs.board == pairs.boards.index(name)]
            shown = np.flatnonzero(np.bincount(own) >= FEWEST_CORNERS)
            among, lost = (np.isin(shown, some).sum() for some in (tried, photos))
            return bool(
                times >= _FEWEST_PHOTOS and times * lost >= _NEARLY_ALL_PHOTOS * among * len(shown)
            )

        findings += board_findings([fault for fault in faults if fault is not None], is_usual)
    return findings


def _left_out(
    pairs: Observations, fit: ObjectFit, dropped: Sequence[tuple[str, str | None]]
) -> set[str]:
    """Photos that were left out, and those of which a board lost half of its corners."""
    unfit = fit.reference.unfit.items()
    names = {name for name, why in unfit if why.code is not Code.TOO_FEW_CORNERS}
    counts: dict[tuple[str, str], int] = {}
    for image, board in dropped:
        if board is not None:
            counts[image, board] = counts.get((image, board), 0) + 1
    for (image, board), lost in counts.items():
        own = (pairs.image == pairs.images.index(image)) & (
            pairs.board == pairs.boards.index(board)
        )
        if 2 * lost >= own.sum() > _FEWEST_PHOTOS:
            names.add(image)
    return names
