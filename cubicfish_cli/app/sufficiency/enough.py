"""Whether photos so far are enough, and one line of advice from the record alone."""

from __future__ import annotations

from functools import partial

import numpy as np

from cubicfish_cli.app.sufficiency.gaps import Gaps, find_gaps
from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.assess.uncertainty import FieldUncertainty
from cubicfish_cli.core.assess.verdict import verdict
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations

GOAL_PX = 0.2
"""Wanted over the field, for photos of up to :data:`GOAL_SIDE` pixels per side; larger ones in
proportion."""
GOAL_SIDE = 2000.0
FEWEST_PHOTOS = 3
ENOUGH_COVERAGE = 0.85
# The picture beyond the trusted field counts as not seen yet below this share of its inner circle.
_SEEN_SHARE = 0.5
HEED_FIRST = "heed the verdict first"
NOISE_ALONE = "heed the verdict first; by the uncertainty alone"
_PARTS = 2


def default_goal(image_size: tuple[int, int]) -> float:
    """The uncertainty that is wanted where nobody says, pixels."""
    return GOAL_PX * max(1.0, max(image_size) / GOAL_SIDE)


def why_not_enough(
    now: FieldUncertainty | None, goal: float, gaps: Gaps, photos: int, camera: CubicCamera
) -> list[Finding]:
    """Why photos so far are not enough; nothing where they are."""
    reasons = []
    care = partial(Finding, severity=Severity.CARE)
    if photos < FEWEST_PHOTOS:
        reasons.append(care(code=Code.FEW_PHOTOS))
    if now is not None and now.p95_px > goal:
        figures = {"p95_px": now.p95_px, "goal_px": goal}
        reasons.append(care(code=Code.NOT_CERTAIN, figures=figures))
    if gaps.cells.coverage < ENOUGH_COVERAGE:
        figures = {"share": gaps.cells.coverage}
        reasons.append(care(code=Code.LOW_COVERAGE, case="advice", figures=figures))
    if seen_share(camera) < _SEEN_SHARE:
        figures = {"known_deg": camera.max_angle_deg}
        reasons.append(care(code=Code.SMALL_FIELD, case="advice", figures=figures))
    return reasons


def seen_share(camera: CubicCamera) -> float:
    """Area of the trusted field over that of the largest circle in the picture."""
    x, y = camera.outline().T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    return float(area / (np.pi * (min(camera.image_size) / 2) ** 2))


def summary(camera: CubicCamera, fit: FitRecord, pairs: Observations) -> str:
    """Whether more photos are needed, and of which parts of the picture, in one line.

    Args:
        camera: a calibrated camera.
        fit: its record.
        pairs: the pairs that it was fitted to.

    """
    gaps = find_gaps(camera, pairs)
    now = fit.uncertainty.field
    goal = default_goal(camera.image_size)
    reasons = why_not_enough(now, goal, gaps, len(pairs.images), camera)
    judged = verdict(fit, camera.image_size, camera.outline())
    if judged.level == "bad" and not (judged.asks_for_photos and gaps.parts):
        return f"{HEED_FIRST}: {judged.reasons[0].do}"
    if not reasons:
        known = f", and 95 % of it is certain to {now.p95_px:.3f} px" if now else ""
        wanted = f" (goal: {goal:g} px)" if now else ""
        # The corners' noise may ask for no more photos, and held-out errors for some all the same.
        begin = f"{NOISE_ALONE} photos are enough" if judged.asks_for_photos else "enough photos"
        return (
            f"{begin}: corners cover {100 * gaps.cells.coverage:.0f} % of the field{known}{wanted}"
        )
    where = "; ".join(part.words for part in gaps.parts[:_PARTS])
    next_ones = f"show the target next at: {where}" if where else f"more photos: {reasons[0]}"
    return f"{next_ones} ('cubicfish advise' says from where)"
