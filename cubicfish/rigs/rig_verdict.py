"""Verdict on a rig, from what its fit said."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding, level_of
from cubicfish.judge.verdict import Verdict, ratio_above
from cubicfish.rigs.rig import Rig, RigFit

# A camera's error in the rig over that of its photos alone, and the error from which that matters.
_STRAINED = ((1.5, 0.25), (3.0, 0.5))
# Where the rays of a camera may go on the body, by this much, they are not known.
_TURN_DEG = (0.1, 1.0)
# Of how far cameras are from each other; where these turns of rays from the target are farther,
# cameras stand in one place, and no more than that has to be known.
_SHIFT_SHARE = (0.02, 0.2)
_ORDER = (Severity.BAD, Severity.CARE, Severity.NOTE)


def rig_verdict(rig: Rig) -> Verdict:
    """Judge a rig, fitted just now or read from its file."""
    reasons = [one for one in rig.fit.findings if one.severity is not Severity.NOTE]
    reasons += [*_find_strained(rig), *_find_uncertain(rig)]
    reasons.sort(key=lambda one: _ORDER.index(one.severity))
    fit = rig.fit
    parts = [f"error {fit.rms_px:.3f} px RMS over all cameras"] * math.isfinite(fit.rms_px)
    if math.isfinite(fit.held_out_rms_px):
        parts.append(f"{fit.held_out_rms_px:.3f} px on shots left out")
    figures = ", ".join(parts) or "no figures on record"
    return Verdict(level=level_of(reasons), figures=figures, reasons=tuple(reasons))


def _find_strained(rig: Rig) -> Iterator[Finding]:
    """Cameras whose photos fit well alone, and not on the body."""
    found = []
    for camera in rig.cameras:
        rms, alone = camera.in_rig.rms_px, camera.in_rig.alone_rms_px
        severity = ratio_above(rms, alone, _STRAINED, 1.0)
        if severity is not None:
            found.append((camera.name, severity, {"rms_px": rms, "alone_px": alone}))
    yield from _join(Code.RIG_STRAINED, found, "rms_px")


def _find_uncertain(rig: Rig) -> Iterator[Finding]:
    """Cameras whose pose is uncertain."""
    cameras = [one for one in rig.cameras if one.covariance is not None]
    places = [one.position for one in cameras]
    apart = [float(np.linalg.norm(a - b)) for a, b in pairwise([*places, *places[:1]])]
    size = max(apart, default=0.0)
    near = np.tan(np.deg2rad(_TURN_DEG)) * _measure_distance(rig.fit)
    limits = near if size < near[0] else np.multiply(_SHIFT_SHARE, size or np.inf)
    found, units = [], rig.units or "of the target's units"
    for camera in cameras:
        turn, shift = camera.turn_sigma_deg, camera.shift_sigma
        care, bad = (
            turn > turn_limit or shift > shift_limit
            for turn_limit, shift_limit in zip(_TURN_DEG, limits, strict=True)
        )
        if care:
            severity = Severity.BAD if bad else Severity.CARE
            found.append(
                (camera.name, severity, {"turn_deg": turn, "shift": shift, "units": units})
            )
    yield from _join(Code.PLACE_UNCERTAIN, found, "turn_deg")


def _measure_distance(fit: RigFit) -> float:
    """How far the target's origin is from the rig's, in the usual shot; 0 where nothing says it."""
    places = [one.rig_from_world for one in fit.per_shot]
    away = [math.hypot(*place.translation) for place in places if place is not None]
    return float(np.median([one for one in away if one > 0] or [0.0]))


def _join(
    code: Code, found: Sequence[tuple[str, Severity, Mapping[str, Any]]], worst: str
) -> Iterator[Finding]:
    """One finding of all cameras of one severity, with the figures of the worst, which is first."""
    for severity in dict.fromkeys(severity for _, severity, _ in found):
        own = sorted((one for one in found if one[1] is severity), key=lambda one: -one[2][worst])
        cameras = tuple(name for name, _, _ in own)
        yield Finding(code=code, severity=severity, cameras=cameras, figures=own[0][2])
