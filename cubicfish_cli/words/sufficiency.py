"""Whether photos are enough, and which parts of the picture they leave empty, in words."""

from cubicfish import CubicCamera, Observations
from cubicfish.judge import CameraFacts, Code
from cubicfish.sufficiency import CoverageGaps, Goal
from cubicfish_cli.words.sentences import render

_PARTS = 2


def gap_words(gaps: CoverageGaps) -> list[str]:
    """Return ``upper left, 60–80° from the axis`` for each part of the field without corners."""
    words = []
    for part in gaps.parts:
        where = "all around"
        if 0 < len(part.sides) < 8:
            *others, last = part.sides
            where = " and ".join(filter(None, [", ".join(others), last]))
        words.append(
            f"{where}, {part.from_deg:.0f}–{part.to_deg:.0f}° from the axis"
            if part.sides
            else f"the middle, up to {part.to_deg:.0f}° from the axis"
        )
    return words


def summary(known: CameraFacts, pairs: Observations) -> str | None:
    """Return whether more photos are needed, and of which parts of the picture, in one line.

    Args:
        known: a calibrated camera, and the record of its fit.
        pairs: the pairs that it was fitted to.

    Returns:
        The line; None for a camera without rays.

    """
    if not isinstance(known.camera, CubicCamera):
        return None
    gaps, now = CoverageGaps.of(known.camera, pairs), known.fit.uncertainty.field
    goal = Goal.of(known.fit, known.camera.image_size)
    reasons = goal.explain_unmet(known.verdict)
    if not reasons:
        certain = f", and 95 % of it is certain to {now.p95_px:.3f} px" if now else ""
        covered = f"corners cover {100 * gaps.cells.coverage:.0f} % of the field"
        return f"enough photos: {covered}{certain}"
    if reasons[0].code == Code.NOT_TRUSTED:
        return f"fix this first: {render(reasons[0].figures['reason']).do}"
    where = "; ".join(gap_words(gaps)[:_PARTS])
    if known.fit.marked is not None:
        return f"mark points at: {where}" if where else "mark more points"
    next_ones = f"show the target next at: {where}" if where else "take more photos"
    return f"{next_ones} ('cubicfish advise' says from where)"
