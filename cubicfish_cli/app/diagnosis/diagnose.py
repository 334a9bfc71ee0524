"""What is likely wrong with a set-up: all hypotheses, and how they are tried.

A right set-up costs a pass over its corners. Whatever costs more is tried only where the fit is
worse than the corners' own noise explains, or where photos or boards do not fit it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, Generic, TypeVar

import numpy as np

from cubicfish_cli.app.diagnosis import (
    corner_count,
    left_out,
    markers,
    mirrored,
    object_faults,
    photo_lenses,
    repeats,
    two_lenses,
    wrong_drawing,
)
from cubicfish_cli.app.diagnosis.evidence import GridEvidence, MarkerEvidence, PhotoEvidence
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.calibration import CornerEvidence, Evidence, FailedFit, FitEvidence

E = TypeVar("E", bound=Evidence)


class Cost(IntEnum):
    """What it takes to try a hypothesis, with what it waits for: from the least on."""

    TABLES = 0
    """Counts, sizes and sides: nothing is fitted."""
    PASS = 1
    """A pass over the corners, and more where that finds something."""
    TRIALS = 2
    """Fits or names as they would be otherwise."""


@dataclass(frozen=True, eq=False)
class Hypothesis(Generic[E]):
    """One kind of thing that may be wrong.

    Attributes:
        of: the kind of evidence that it is judged by.
        codes: what it may find.
        cost: what comes first: of two alike, the one that stands first in the table.
        explain: what it finds.
        applies: whether what was found before leaves anything to be explained by it.

    """

    of: type[E]
    codes: tuple[Code, ...]
    cost: Cost
    explain: Callable[[E], Sequence[Finding]]
    applies: Callable[[E, Sequence[Finding]], bool] = lambda evidence, found: True


def _not_bad(_: CornerEvidence, found: Sequence[Finding]) -> bool:
    return all(finding.severity is not Severity.BAD for finding in found)


def _only_notes(_: PhotoEvidence, found: Sequence[Finding]) -> bool:
    return all(finding.severity is Severity.NOTE for finding in found)


def _named(evidence: CornerEvidence, _: Sequence[Finding]) -> bool:
    """Corners that are named by a wrong drawing say nothing of the lens or of the drawing."""
    return _not_bad(evidence, evidence.known)


def _unexplained(evidence: FailedFit, found: Sequence[Finding]) -> bool:
    return not evidence.fits and not found


def _lacks(codes: Sequence[Code], found: Sequence[Finding]) -> bool:
    return all(finding.code not in codes for finding in found)


def _no_corners(evidence: GridEvidence | MarkerEvidence, found: Sequence[Finding]) -> bool:
    return _only_notes(evidence, found) and not len(evidence.corners.pixel)


def _some_corners(evidence: GridEvidence | MarkerEvidence, found: Sequence[Finding]) -> bool:
    return _only_notes(evidence, found) and len(evidence.corners.pixel) > 0


def _counted_rightly(evidence: GridEvidence, found: Sequence[Finding]) -> bool:
    return _only_notes(evidence, found) and not evidence.counts


_DRAWING = (Code.MIRRORED, Code.BOARD_NAMES, Code.BOARD_ORDER, Code.BOARD_SQUARE, Code.BOARD_PLACE)
_LENSES = (Code.TURNED, Code.SCALED, Code.ZOOM, Code.SHIFTED, Code.TWO_LENSES)
_LENS = (*_LENSES, Code.PHOTO_LENS)
_NAMES = (*_LENSES, *_DRAWING, Code.CORNER_NAMES)
_NOTHING = (Code.NOTHING_NAMED, Code.ANOTHER_TARGET, Code.CORNER_COUNT)
_LOST = (
    Code.TOO_LARGE,
    Code.AMBIGUOUS,
    Code.SLIDES,
    Code.LOOKS_LIKE_ANOTHER,
    Code.FITS_NOWHERE,
    Code.OTHER_COLOURS,
    Code.NO_PLANE,
    Code.NO_MARKERS,
    Code.OTHER_SIZE,
)
_COUNT, _ANOTHER, _MIRRORED = (Code.CORNER_COUNT,), (Code.ANOTHER_TARGET,), (Code.MIRRORED,)
_TABLES, _PASS, _TRIALS = Cost

# In the order in which they are told.
HYPOTHESES: tuple[Hypothesis[Any], ...] = (
    # Of photos, and of the grids and markers in them.
    Hypothesis(GridEvidence, _COUNT, _TABLES, corner_count.squares_of_grids),
    Hypothesis(GridEvidence, _DRAWING, _TRIALS, object_faults.misdrawn, _counted_rightly),
    Hypothesis(GridEvidence, _ANOTHER, _TRIALS, corner_count.another_target, _some_corners),
    Hypothesis(GridEvidence, _COUNT, _TRIALS, corner_count.miscounted, _only_notes),
    Hypothesis(GridEvidence, _NOTHING, _TRIALS, corner_count.nothing_named, _no_corners),
    Hypothesis(GridEvidence, _MIRRORED, _TABLES, mirrored.other_colours),
    Hypothesis(MarkerEvidence, (*_MIRRORED, Code.INVERTED), _TRIALS, markers.otherwise_printed),
    Hypothesis(MarkerEvidence, _COUNT, _TRIALS, markers.otherwise_laid_out, _only_notes),
    Hypothesis(MarkerEvidence, (Code.BOARD_SQUARE,), _TRIALS, markers.other_spacing, _only_notes),
    Hypothesis(MarkerEvidence, (Code.NO_MARKERS,), _TRIALS, markers.no_markers, _no_corners),
    Hypothesis(PhotoEvidence, _LOST, _TRIALS, corner_count.many_lost, _some_corners),
    # Of a fit.
    Hypothesis(FitEvidence, _MIRRORED, _TABLES, lambda e: mirrored.handed(e.pairs)),
    Hypothesis(FitEvidence, _LENSES, _PASS, two_lenses.find_two_lenses, _named),
    Hypothesis(
        FitEvidence,
        (Code.PHOTO_LENS,),
        _PASS,
        lambda e: photo_lenses.odd_photos(e.fit),
        lambda e, found: _named(e, found) and _lacks(_LENSES, found),
    ),
    Hypothesis(FitEvidence, _DRAWING, _TRIALS, wrong_drawing.wrong_drawing, _not_bad),
    Hypothesis(FitEvidence, _NAMES, _TRIALS, left_out.left_out, _named),
    Hypothesis(
        FitEvidence,
        _COUNT,
        _TABLES,
        corner_count.squares_of_corners,
        lambda e, found: _named(e, found) and _lacks(_COUNT, found),
    ),
    Hypothesis(FitEvidence, (Code.ONE_PLACE, Code.REPEATS), _TABLES, repeats.repeats),
    # Of corners that do not fit: the first that explains it is the likeliest.
    Hypothesis(FailedFit, _MIRRORED, _TABLES, mirrored.mirrored_photos, lambda e, found: not found),
    Hypothesis(FailedFit, _DRAWING, _TRIALS, wrong_drawing.of_failure, _unexplained),
    Hypothesis(
        FailedFit, _MIRRORED, _TRIALS, lambda e: mirrored.mirrored_object(e.scaled[0]), _unexplained
    ),
    Hypothesis(
        FailedFit, _LENS, _TRIALS, lambda e: left_out.failed_lens(e.scaled[0]), _unexplained
    ),
)


def find_faults(
    evidence: Evidence,
    known: Sequence[Finding] = (),
    more: Sequence[Hypothesis[Any]] = (),
) -> list[Finding]:
    """What is likely wrong with a set-up.

    Args:
        evidence: what says so.
        more: what else may be wrong with such a set-up.
        known: what was found before, and comes first; where there is no fit only what is bad, and
            boards of other counts of corners, are accepted, and explain it.

    Returns:
        What was known, and what was found, in the order of the table.

    """
    if isinstance(evidence, FailedFit):
        known = [finding for finding in known if _explains_failure(finding)]
    evidence = replace(evidence, known=known)
    found: dict[int, list[Finding]] = {-1: list(known)}
    table = (*HYPOTHESES, *more)
    own = [place for place, one in enumerate(table) if isinstance(evidence, one.of)]
    for place in sorted(own, key=lambda place: table[place].cost):
        hypothesis = table[place]
        if not hypothesis.applies(evidence, _join(found)):
            continue
        try:
            found[place] = list(hypothesis.explain(evidence))
        except (FitError, np.linalg.LinAlgError):  # what cannot be tried explains nothing
            continue
    return _join(found)


def _explains_failure(finding: Finding) -> bool:
    counted = finding.code is Code.CORNER_COUNT and finding.severity is Severity.CARE
    return counted or finding.severity is Severity.BAD


def _join(found: dict[int, list[Finding]]) -> list[Finding]:
    return [finding for place in sorted(found) for finding in found[place]]
