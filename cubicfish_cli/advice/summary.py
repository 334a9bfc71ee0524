"""The advice in a line, from the record of a fit alone: no pose is tried."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cubicfish_cli.advice.advise import default_goal, why_not_enough
from cubicfish_cli.advice.gaps import find_gaps
from cubicfish_cli.assess.field_uncertainty import recorded
from cubicfish_cli.assess.verdict import verdict
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.observations import Observations

HEED_FIRST = "heed the verdict first"
NOISE_ALONE = "heed the verdict first; by the uncertainty alone"
_PARTS = 2


def summary(camera: CubicCamera, fit: Mapping[str, Any], pairs: Observations) -> str:
    """Whether more photos are needed, and of which parts of the picture, in one line.

    Args:
        camera: a calibrated camera.
        fit: its record, as ``as_record`` of a calibration gives and camera.yaml keeps.
        pairs: the pairs that it was fitted to.

    """
    gaps = find_gaps(camera, pairs, None, None)
    now = recorded(fit)
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
        return f"{begin}: corners cover {100 * gaps.coverage:.0f} % of the field{known}{wanted}"
    where = "; ".join(part.words for part in gaps.parts[:_PARTS])
    next_ones = f"show the target next at: {where}" if where else f"more photos: {reasons[0]}"
    return f"{next_ones} ('cubicfish advise' says from where)"
