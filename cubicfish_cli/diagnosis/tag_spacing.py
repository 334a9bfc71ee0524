"""Grids of tags whose gaps are wider or narrower than the target says."""

from __future__ import annotations

from itertools import islice

import numpy as np

from cubicfish_cli.detection.markers import tags_apart
from cubicfish_cli.diagnosis.evidence import MarkerEvidence
from cubicfish_cli.diagnosis.mirrored import richest
from cubicfish_cli.fitting.local_noise import neighbours
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# So many gaps tell, and so many of them must be off to the same side.
_LEAST_GAPS, _MOST = 12, 80
# By how much, as a share: corners are good to a hundredth of a gap, outlines of tags are not.
_OFF, _OFF_OUTLINES = 0.05, 0.2
# Photos in which tags are read again.
_PHOTOS = 3


def other_spacing(evidence: MarkerEvidence) -> list[Finding]:
    """Boards of tags with another spacing, by gaps between corners or between tags themselves."""
    target, findings = evidence.target, []
    for index, board in enumerate(target.boards):
        if board.per_cell != 2 or board.markers is None:
            continue
        gaps, off = _between_corners(evidence.corners, index), _OFF
        if len(gaps) < _LEAST_GAPS and not target.mirrored:
            photos = islice(richest(evidence), _PHOTOS)
            apart = [tags_apart(picture, target, index, grids) for picture, grids in photos]
            gaps, off = np.concatenate([np.zeros(0), *apart]) - 1, _OFF_OUTLINES
        if len(gaps) < _LEAST_GAPS:
            continue
        low, middle, high = np.percentile(gaps, [100 - _MOST, 50, _MOST]) / board.spacing
        if low > 1 + off or high < 1 - off:
            told = Finding(
                code=Code.BOARD_SQUARE,
                case="spacing",
                severity=Severity.BAD,
                boards=(board.name,),
                figures={
                    "gaps": len(gaps),
                    "spacing": float(middle * board.spacing),
                    "drawn_spacing": board.spacing,
                },
            )
            findings.append(told)
    return findings


def _between_corners(corners: Observations, board: int) -> FloatArray:
    """Gaps between tags of a board, in sides of the tags on both sides of each, as photos show it.

    That of four corners in a line hardly depends on how the lens or the view stretches it.
    """
    own = corners.select(corners.board == board)
    if not len(own.pixel):
        return np.zeros(0)
    parts = []
    for following, place in zip(neighbours(own), (own.column, own.row), strict=True):
        line = np.flatnonzero(place % 2 == 0)[None]
        for _ in range(3):
            line = line[:, following[line[-1]] >= 0]
            line = np.concatenate([line, following[line[-1]][None]])
        first, gap, last = np.linalg.norm(np.diff(own.pixel[line], axis=0), axis=-1)
        parts.append(gap / (0.5 * (first + last)))
    return np.concatenate(parts)
