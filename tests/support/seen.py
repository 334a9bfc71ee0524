"""What photos show, as a diagnosis is handed it."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from cubicfish import Finding, Target
from cubicfish.diagnosis.corner_count import Count
from cubicfish.diagnosis.evidence import GridEvidence
from cubicfish.find.identification.identified import Identified


def no_photo(_: int) -> None:
    pytest.fail("no photo is needed")


def grid_evidence(
    identified: Identified,
    target: Target,
    counts: Sequence[Count] | None = None,
    photos: int = 0,
    lost: Sequence[Finding] = (),
) -> GridEvidence:
    """Of grids that were named; the counts in place of those that the grids show."""
    photos = photos or len(identified.grids)
    evidence = GridEvidence(
        photos=photos,
        names=[str(number) for number in range(photos)],
        picture=no_photo,
        target=target,
        with_boards=photos,
        lost=lost,
        identified=identified,
    )
    if counts is not None:
        vars(evidence)["counts"] = counts
    return evidence
