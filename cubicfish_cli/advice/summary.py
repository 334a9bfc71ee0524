"""The advice in a line, from the record of a fit alone: no pose is tried."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cubicfish_cli.advice.advise import Sigma, default_goal, summed, why_not_enough
from cubicfish_cli.advice.gaps import find_gaps
from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.model.cubic import CubicCamera

_PARTS = 2


def summary(camera: CubicCamera, fit: Mapping[str, Any], pairs: Correspondences) -> str:
    """Whether more photos are needed, and of which parts of the picture, in one line.

    Args:
        camera: a calibrated camera.
        fit: its record, as ``as_record`` of a calibration gives and camera.yaml keeps.
        pairs: the pairs that it was fitted to.

    """
    gaps = find_gaps(camera, pairs, None, None)
    now = _recorded(fit)
    goal = default_goal(camera.image_size)
    reasons = why_not_enough(now, goal, gaps, len(pairs.images), camera)
    if not reasons:
        known = f", its pixels are certain to {now.worst_px:.2f} px" if now else ""
        return f"enough photos: corners cover {100 * gaps.coverage:.0f} % of the field{known}"
    where = "; ".join(part.words for part in gaps.parts[:_PARTS])
    next_ones = f"next, put the object there: {where}" if where else f"more photos: {reasons[0]}"
    return f"{next_ones} ('cubicfish advise' says from where)"


def _recorded(fit: Mapping[str, Any]) -> Sigma | None:
    record = fit.get("uncertainty")
    rows = record.get("sigma_px") if isinstance(record, Mapping) else None
    values = [
        value
        for row in (rows if isinstance(rows, list) else [])
        for value in (row if isinstance(row, list) else [])
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    return summed(np.array(values, float)) if values else None
