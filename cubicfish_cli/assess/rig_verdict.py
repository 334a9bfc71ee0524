"""What a rig is worth by its figures, read from the plain record that rig.yaml keeps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cubicfish_cli.assess.records import recorded_mappings, recorded_number
from cubicfish_cli.assess.verdict import Verdict
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding, RigFinding, level_of, of_record

# A camera's error in the rig over that of its photos alone, and the error from which that matters.
_STRAINED, _STRAINED_PX = (1.5, 3.0), (0.25, 0.5)
# Where the rays of a camera may go on the body, by this much, they are not known.
_TURN_DEG = (0.1, 1.0)
# Of how far cameras are from each other.
_SHIFT_SHARE = (0.02, 0.2)
_ORDER = (Severity.BAD, Severity.CARE, Severity.NOTE)


def rig_verdict(record: Mapping[str, Any]) -> Verdict:
    """Judge a rig.

    Args:
        record: as rig.yaml has it; what is not what a rig's fit writes is passed over.

    """
    fit = record.get("fit")
    fit = fit if isinstance(fit, Mapping) else {}
    found = [of_record(one) for one in recorded_mappings(fit.get("findings"))]
    reasons = [one for one in found if one is not None and one.severity is not Severity.NOTE]
    reasons += [*_strained(record), *_uncertain(record)]
    reasons.sort(key=lambda one: _ORDER.index(one.severity))
    return Verdict(level=level_of(reasons), figures=_figures(fit), reasons=tuple(reasons))


def _strained(record: Mapping[str, Any]) -> Iterator[Finding]:
    """Cameras whose photos fit well alone, and not on the body."""
    found = []
    for camera in recorded_mappings(record.get("cameras")):
        errors = camera.get("fit")
        if not isinstance(errors, Mapping):
            continue
        rms = recorded_number(errors.get("rms_px"))
        alone = recorded_number(errors.get("alone_rms_px"))
        if rms is None or alone is None:
            continue
        passed = [
            rms > limit * alone and rms > px
            for limit, px in zip(_STRAINED, _STRAINED_PX, strict=True)
        ]
        if any(passed):
            figures = {"rms_px": rms, "alone_px": alone}
            found.append((str(camera.get("name")), passed[1], figures))
    yield from _together(Code.RIG_STRAINED, found, "rms_px")


def _uncertain(record: Mapping[str, Any]) -> Iterator[Finding]:
    cameras = [
        one for one in recorded_mappings(record.get("cameras")) if one.get("covariance") is not None
    ]
    places = [one["position"] for one in cameras if isinstance(one.get("position"), list)]
    size = max(
        (float(np.linalg.norm(np.subtract(a, b))) for a, b in pairwise([*places, *places[:1]])),
        default=0.0,
    )
    found = []
    for camera in cameras:
        turn = recorded_number(camera.get("turn_sigma_deg")) or 0.0
        shift = recorded_number(camera.get("shift_sigma")) or 0.0
        passed = [
            turn > turn_limit or (size > 0 and shift > share * size)
            for turn_limit, share in zip(_TURN_DEG, _SHIFT_SHARE, strict=True)
        ]
        if any(passed):
            figures = {"turn_deg": turn, "shift": shift}
            found.append((str(camera.get("name")), passed[1], figures))
    yield from _together(Code.PLACE_UNCERTAIN, found, "turn_deg")


def _together(
    code: Code, found: Sequence[tuple[str, bool, Mapping[str, float]]], worst: str
) -> Iterator[Finding]:
    """One finding of all cameras of one severity, with the figures of the worst, which is first."""
    for severity in (Severity.BAD, Severity.CARE):
        own = [one for one in found if one[1] == (severity is Severity.BAD)]
        if own:
            own.sort(key=lambda one: -one[2][worst])
            cameras = tuple(name for name, _, _ in own)
            yield RigFinding(code=code, severity=severity, cameras=cameras, figures=own[0][2])


def _figures(fit: Mapping[str, Any]) -> str:
    rms, out = recorded_number(fit.get("rms_px")), recorded_number(fit.get("held_out_rms_px"))
    said = [] if rms is None else [f"error {rms:.3f} px RMS over all cameras"]
    if out is not None:
        said.append(f"{out:.3f} px on shots left out")
    return ", ".join(said) or "no figures on record"
