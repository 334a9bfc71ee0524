"""What is likely wrong with a set-up: all hypotheses, and how they are tried.

A right set-up costs a pass over its corners. Whatever costs more is tried only where the fit is
worse than the corners' own noise explains, or where photos or boards do not fit it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish.diagnosis import (
    anew,
    corner_count,
    markers,
    mirrored,
    object_faults,
    photo_lenses,
    rejected_photos,
    repeats,
    saved_otherwise,
    two_lenses,
    wrong_nominal,
)
from cubicfish.diagnosis.evidence import GridEvidence, MarkerEvidence, PhotoEvidence
from cubicfish.errors import FitError
from cubicfish.fit.calibration import CornerEvidence, Evidence, FailedFit, FitEvidence
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One kind of thing that may be wrong.

    Attributes:
        of: the kind of evidence that it is judged by.
        explain: finds what is wrong.
        applies: whether the earlier findings leave anything for it to explain.

    """

    of: type[Evidence]
    explain: Callable[[Any], Sequence[Finding]]
    applies: Callable[[Any, Sequence[Finding]], bool] = lambda evidence, found: True


def _is_not_bad(_: CornerEvidence, found: Sequence[Finding]) -> bool:
    return all(finding.severity is not Severity.BAD for finding in found)


def _has_only_notes(_: CornerEvidence | PhotoEvidence, found: Sequence[Finding]) -> bool:
    return all(finding.severity is Severity.NOTE for finding in found)


def _is_named(evidence: CornerEvidence, _: Sequence[Finding]) -> bool:
    """Whether corners have their true names: others say nothing about the lens or the target."""
    return _is_not_bad(evidence, evidence.known)


def _is_unexplained(evidence: FailedFit, found: Sequence[Finding]) -> bool:
    return not evidence.fits and not found


def _has_no_corners(evidence: GridEvidence | MarkerEvidence, found: Sequence[Finding]) -> bool:
    return _has_only_notes(evidence, found) and not len(evidence.corners.pixel)


def _has_corners(evidence: GridEvidence | MarkerEvidence, found: Sequence[Finding]) -> bool:
    return _has_only_notes(evidence, found) and len(evidence.corners.pixel) > 0


_BY_LENS = ("by_lens", "or_turned")
_LENSES = (Code.TURNED, Code.SCALED, Code.ZOOM, Code.SHIFTED, Code.TWO_LENSES)


def _is_not_mirrored(_: FitEvidence, found: Sequence[Finding]) -> bool:
    return all(one.case not in _BY_LENS for one in found)


def _has_one_lens(evidence: FitEvidence, found: Sequence[Finding]) -> bool:
    of_lenses = [one for one in found if one.code in _LENSES]
    return _is_named(evidence, found) and _is_not_mirrored(evidence, found) and not of_lenses


def _has_odd_photos(evidence: FitEvidence, found: Sequence[Finding]) -> bool:
    return _has_one_lens(evidence, found) and all(one.case != "anew" for one in found)


def _is_counted(evidence: FitEvidence, found: Sequence[Finding]) -> bool:
    return _is_named(evidence, found) and all(one.code != Code.CORNER_COUNT for one in found)


def _may_doubt_boards(evidence: FitEvidence, found: Sequence[Finding]) -> bool:
    """What was blamed on one board, the lens or wrong names is no reason to doubt every board."""
    faults = (*_LENSES, Code.BOARD_PLACE, Code.BOARD_SQUARE)
    return _is_not_bad(evidence, found) and all(one.code not in faults for one in found)


def _is_counted_rightly(evidence: GridEvidence, found: Sequence[Finding]) -> bool:
    return _has_only_notes(evidence, found) and not evidence.counts


# Hypotheses in the order in which they are tried and reported.
HYPOTHESES: tuple[Hypothesis, ...] = (
    # About photos, and the grids and markers in them.
    Hypothesis(GridEvidence, corner_count.squares_of_grids),
    Hypothesis(GridEvidence, object_faults.find_wrong_layout, _is_counted_rightly),
    Hypothesis(GridEvidence, corner_count.another_target, _has_corners),
    Hypothesis(GridEvidence, corner_count.miscounted, _has_only_notes),
    Hypothesis(GridEvidence, corner_count.nothing_named, _has_no_corners),
    Hypothesis(GridEvidence, mirrored.other_colours),
    Hypothesis(MarkerEvidence, markers.otherwise_printed),
    Hypothesis(MarkerEvidence, markers.otherwise_laid_out, _has_only_notes),
    Hypothesis(MarkerEvidence, markers.other_spacing, _has_only_notes),
    Hypothesis(MarkerEvidence, markers.no_markers, _has_no_corners),
    Hypothesis(PhotoEvidence, corner_count.many_lost, _has_corners),
    Hypothesis(GridEvidence, corner_count.many_grids_left_out, _has_corners),
    # About a fit.
    Hypothesis(FitEvidence, saved_otherwise.saved_otherwise, _is_named),
    Hypothesis(FitEvidence, mirrored.handed, _is_not_mirrored),
    Hypothesis(FitEvidence, two_lenses.find_two_lenses, _has_one_lens),
    Hypothesis(FitEvidence, anew.changes_anew, _has_one_lens),
    Hypothesis(FitEvidence, photo_lenses.odd_photos, _has_odd_photos),
    Hypothesis(FitEvidence, wrong_nominal.find_wrong_nominal, _is_not_bad),
    Hypothesis(FitEvidence, rejected_photos.left_out, _is_named),
    Hypothesis(FitEvidence, corner_count.squares_of_corners, _is_counted),
    Hypothesis(FitEvidence, repeats.repeats),
    Hypothesis(FitEvidence, saved_otherwise.reduced, _has_one_lens),
    Hypothesis(FitEvidence, wrong_nominal.doubted_boards, _may_doubt_boards),
    Hypothesis(FitEvidence, wrong_nominal.odd_distance, _has_only_notes),
    # About corners that do not fit: the first hypothesis that explains it is the likeliest.
    Hypothesis(FailedFit, mirrored.mirrored_photos, lambda evidence, found: not found),
    Hypothesis(FailedFit, wrong_nominal.explain_failure, _is_unexplained),
    Hypothesis(FailedFit, mirrored.mirrored_object, _is_unexplained),
    Hypothesis(FailedFit, rejected_photos.failed_lens, _is_unexplained),
)


def find_faults(evidence: Evidence, known: Sequence[Finding] = ()) -> list[Finding]:
    """Find what is likely wrong with a set-up.

    Args:
        evidence: the evidence, which selects the hypotheses.
        known: earlier findings, which come first; where there is no fit, only those that are bad,
            and boards with other counts of corners, are accepted, and explain it.

    Returns:
        The known findings, then the new ones, in the order of the table.

    """
    if isinstance(evidence, FailedFit):
        known = [finding for finding in known if _does_explain_failure(finding)]
    evidence, found = replace(evidence, known=known), list(known)
    for hypothesis in HYPOTHESES:
        if not isinstance(evidence, hypothesis.of) or not hypothesis.applies(evidence, found):
            continue
        try:
            found += hypothesis.explain(evidence)
        except (FitError, np.linalg.LinAlgError):  # what cannot be tried explains nothing
            continue
    return found


def _does_explain_failure(finding: Finding) -> bool:
    counted = finding.code == Code.CORNER_COUNT and finding.severity is Severity.CARE
    return counted or finding.severity is Severity.BAD
