"""Verdict on a rig, from the record in rig.yaml."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from cubicfish_cli.core.assess.records import read_record
from cubicfish_cli.core.assess.verdict import Verdict, ratio_above
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding, RigFinding, level_of

# A camera's error in the rig over that of its photos alone, and the error from which that matters.
_STRAINED = ((1.5, 0.25), (3.0, 0.5))
# Where the rays of a camera may go on the body, by this much, they are not known.
_TURN_DEG = (0.1, 1.0)
# Of how far cameras are from each other; where these turns of rays from the target are farther,
# cameras stand in one place, and no more than that has to be known.
_SHIFT_SHARE = (0.02, 0.2)
_ORDER = (Severity.BAD, Severity.CARE, Severity.NOTE)


@dataclass(frozen=True, kw_only=True)
class _Errors:
    rms_px: float = math.nan
    alone_rms_px: float = math.nan


@dataclass(frozen=True, kw_only=True)
class _Camera:
    name: str = ""
    position: tuple[float, ...] = ()
    covariance: Any = None
    turn_sigma_deg: float = math.nan
    shift_sigma: float = math.nan
    fit: _Errors = field(default_factory=_Errors)


@dataclass(frozen=True, kw_only=True)
class _Pose:
    translation: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Shot:
    rig_from_world: _Pose = field(default_factory=_Pose)


@dataclass(frozen=True, kw_only=True)
class _Fit:
    rms_px: float = math.nan
    held_out_rms_px: float = math.nan
    findings: tuple[Finding, ...] = ()
    per_shot: tuple[_Shot, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Rig:
    """What of rig.yaml is judged; the keys are its own."""

    cameras: tuple[_Camera, ...] = ()
    fit: _Fit = field(default_factory=_Fit)


def rig_verdict(record: Mapping[str, Any]) -> Verdict:
    """Judge a rig.

    Args:
        record: as rig.yaml has it; what is not what a rig's fit writes is passed over.

    """
    rig = read_record(_Rig, record) or _Rig()
    reasons = [one for one in rig.fit.findings if one.severity is not Severity.NOTE]
    reasons += [*_strained(rig), *_uncertain(rig)]
    reasons.sort(key=lambda one: _ORDER.index(one.severity))
    return Verdict(level=level_of(reasons), figures=_rig_figures(rig.fit), reasons=tuple(reasons))


def _strained(rig: _Rig) -> Iterator[Finding]:
    """Cameras whose photos fit well alone, and not on the body."""
    found = []
    for camera in rig.cameras:
        rms, alone = camera.fit.rms_px, camera.fit.alone_rms_px
        severity = ratio_above(rms, alone, _STRAINED, 1.0)
        if severity is not None:
            figures = {"rms_px": rms, "alone_px": alone}
            found.append((camera.name, severity, figures))
    yield from _together(Code.RIG_STRAINED, found, "rms_px")


def _uncertain(rig: _Rig) -> Iterator[Finding]:
    cameras = [one for one in rig.cameras if one.covariance is not None]
    places = [one.position for one in cameras if len(one.position) == 3]
    size = max(
        (float(np.linalg.norm(np.subtract(a, b))) for a, b in pairwise([*places, *places[:1]])),
        default=0.0,
    )
    near = np.tan(np.deg2rad(_TURN_DEG)) * _distance(rig.fit)
    limits = near if size < near[0] else np.multiply(_SHIFT_SHARE, size or np.inf)
    found = []
    for camera in cameras:
        turn, shift = camera.turn_sigma_deg, camera.shift_sigma
        passed = [
            turn > turn_limit or shift > shift_limit
            for turn_limit, shift_limit in zip(_TURN_DEG, limits, strict=True)
        ]
        if any(passed):
            severity = Severity.BAD if passed[1] else Severity.CARE
            figures = {
                "turn_deg": float(np.nan_to_num(turn)),
                "shift": float(np.nan_to_num(shift)),
            }
            found.append((camera.name, severity, figures))
    yield from _together(Code.PLACE_UNCERTAIN, found, "turn_deg")


def _distance(fit: _Fit) -> float:
    """How far the target's origin is from the rig's, in the usual shot; 0 where nothing says it."""
    away = [math.hypot(*shot.rig_from_world.translation) for shot in fit.per_shot]
    return float(np.median([one for one in away if one > 0] or [0.0]))


def _together(
    code: Code, found: Sequence[tuple[str, Severity, Mapping[str, float]]], worst: str
) -> Iterator[Finding]:
    """One finding of all cameras of one severity, with the figures of the worst, which is first."""
    for severity in dict.fromkeys(severity for _, severity, _ in found):
        own = sorted((one for one in found if one[1] is severity), key=lambda one: -one[2][worst])
        cameras = tuple(name for name, _, _ in own)
        yield RigFinding(code=code, severity=severity, cameras=cameras, figures=own[0][2])


def _rig_figures(of: _Fit) -> str:
    said = [f"error {of.rms_px:.3f} px RMS over all cameras"] * math.isfinite(of.rms_px)
    if math.isfinite(of.held_out_rms_px):
        said.append(f"{of.held_out_rms_px:.3f} px on shots left out")
    return ", ".join(said) or "no figures on record"
