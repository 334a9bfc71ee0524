"""What photos show, as a diagnosis is handed it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from cubicfish_cli.diagnosis.evidence import GridEvidence
from cubicfish_cli.diagnosis.more_corners import Count
from cubicfish_cli.identification.identified import Identified
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target
from cubicfish_cli.words.finding import Finding


def no_photo(_: int) -> None:
    pytest.fail("no photo is needed")


def grid_evidence(
    identified: Identified,
    target: Target,
    picture: Callable[[int], Picture | None] = no_photo,
    counts: Sequence[Count] | None = None,
    photos: int = 0,
    lost: Sequence[Finding] = (),
) -> GridEvidence:
    """Of grids that were named; the counts in place of those that the grids show."""
    photos = photos or len(identified.grids)
    evidence = GridEvidence(
        photos=photos,
        names=[str(number) for number in range(photos)],
        digests=[""] * photos,
        picture=picture,
        target=target,
        with_boards=photos,
        lost=lost,
        identified=identified,
    )
    if counts is not None:
        vars(evidence)["counts"] = counts
    return evidence
