"""What is likely wrong with a rig's shots: a camera that moved, photos of other shots, too few."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cubicfish_cli.app.diagnosis.diagnose import Cost, Hypothesis, find_faults
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding, RigFinding
from cubicfish_cli.core.fit.evidence import Evidence
from cubicfish_cli.core.fit.robust import noise_px
from cubicfish_cli.extensions.rigs.fit.evidence import Moved, RigEvidence
from cubicfish_cli.extensions.rigs.fit.moved import explained, says

# Two cameras that fewer shots connect stand where one shot's errors put them.
_FEW = 5
# Fewer shots say nothing of the usual one.
_LEAST_SHOTS = 3
# Shots are not of one moment where the usual one is off by more of its corners' noise; one shot
# stands out that is off by more of it, and by so many times more than the usual one.
_OFF, _APART, _STANDS_OUT = 1.5, 2.0, 6.0
# Less than that, in pixels, is not worth words, however quiet the corners are.
_LEAST_PX = 0.25
# Of more of the shots than these, it is no longer single ones that stand out.
_SINGLE = 0.2


def camera_moved(evidence: RigEvidence) -> list[Finding]:
    """That cameras stood elsewhere before some shot than after."""
    names = evidence.names
    return [
        RigFinding(
            code=Code.CAMERA_MOVED,
            severity=Severity.BAD,
            case="" if len(names) > 2 else "either",
            cameras=(names[moved.camera],) if len(names) > 2 else tuple(names),
            shots=(moved.shot,),
            figures={
                "turn_deg": float(np.rad2deg(np.linalg.norm(moved.step[:3]))),
                "shift": float(np.linalg.norm(moved.step[3:])) * evidence.scale,
                "effect_px": moved.effect_px,
                "photos": len(moved.apart),
                "part": _part(moved),
            },
        )
        for moved in evidence.moved
    ]


def _part(moved: Moved) -> str:
    if not len(moved.apart):
        return "none"
    return "before" if moved.before else "after"


def not_at_once(evidence: RigEvidence) -> list[Finding]:
    """Shots of which a camera's photo does not go with the others', and it did not move for good.

    All shots where cameras are not triggered at once and something moves; single ones where
    something was knocked, or a photo is of a neighbouring shot.
    """
    names, shots, lens = evidence.names, evidence.shots, evidence.lens
    noise = noise_px(evidence.fit.residual)
    off = np.zeros((len(lens.lenses), len(shots)))
    for camera in range(len(lens.lenses)):
        shot, hessian, gradient, corners = says(evidence, camera)
        # Six unknowns take so much of the noise, whatever is wrong.
        more = np.maximum(explained(hessian, gradient) - 6 * noise**2, 0) / np.maximum(corners, 1)
        off[camera, shot] = np.sqrt(more)
    shared = np.bincount(lens.shot, minlength=len(shots)) > 1
    if int(shared.sum()) < _LEAST_SHOTS:
        return []
    worst = off.max(axis=0)
    usual = float(np.median(worst[shared]))
    if usual > max(_OFF * noise, _LEAST_PX):
        whom = int(np.argmax(np.sum(np.square(off), axis=1) / np.maximum((off > 0).sum(axis=1), 1)))
        return [_off(Code.NOT_AT_ONCE, names, (whom,), (), usual)]
    limit = max(_APART * noise, _STANDS_OUT * usual, _LEAST_PX)
    out = np.flatnonzero(shared & (worst > limit))
    if len(out) > max(1.0, _SINGLE * shared.sum()):
        return []
    found: list[Finding] = []
    for shot in out[np.argsort(-worst[out])].tolist():
        seen_by = lens.camera[lens.shot == shot].tolist()
        apart = tuple(seen_by) if len(seen_by) < 3 else (int(np.argmax(off[:, shot])),)
        found.append(_off(Code.SHOT_APART, names, apart, (shots[shot],), worst[shot]))
    return found


def _off(
    code: Code, names: Sequence[str], whom: tuple[int, ...], shots: tuple[str, ...], off_px: float
) -> RigFinding:
    both = len(names) == 2
    cameras = tuple(names) if both else tuple(names[one] for one in whom)
    return RigFinding(
        code=code,
        severity=Severity.BAD if code is Code.NOT_AT_ONCE else Severity.CARE,
        case="either" if len(cameras) > 1 else "",
        cameras=cameras,
        shots=shots,
        figures={"off_px": float(off_px)},
    )


def clocks_differ(evidence: RigEvidence) -> list[Finding]:
    """Cameras whose clocks are not the first one's, which was taken out."""
    names, clocks = evidence.names, evidence.clocks
    if clocks is None:
        return []
    return [
        RigFinding(
            code=Code.CLOCKS_DIFFER,
            severity=Severity.NOTE,
            case="ahead" if clocks.late[camera] < 0 else "",
            cameras=(names[camera], names[0]),
            figures={
                "late_ms": 1e3 * abs(float(clocks.late[camera])),
                "sigma_ms": 1e3 * float(clocks.sigma[camera]),
                "effect_px": float(clocks.effect_px[camera]),
            },
        )
        for camera in np.flatnonzero(clocks.late).tolist()
    ]


def mismatched(evidence: RigEvidence) -> list[Finding]:
    """Photos that are not of their shot."""
    names, start, lens = evidence.names, evidence.start, evidence.lens
    return [
        RigFinding(
            code=Code.SHOT_MISMATCHED,
            severity=Severity.BAD,
            cameras=(names[lens.camera[view]],),
            shots=(evidence.photos[view],),
            figures={"off_px": float(start.misfit[view])},
        )
        for view in np.flatnonzero(start.apart).tolist()
    ]


def few_common_shots(evidence: RigEvidence) -> list[Finding]:
    """Cameras whose strongest connection to the others is weak."""
    names = evidence.names
    common = evidence.lens.common_shots
    found: list[RigFinding] = []
    for camera, name in enumerate(names):
        others = np.delete(np.arange(len(names)), camera)
        best = int(others[np.argmax(common[camera, others])])
        shared = int(common[camera, others].sum())
        said = any({name, names[best]} == set(one.cameras) for one in found)
        if shared < _FEW and not said:
            found.append(
                RigFinding(
                    code=Code.FEW_COMMON_SHOTS,
                    severity=Severity.CARE,
                    cameras=(name, names[best]),
                    figures={"shots": float(shared), "wanted": float(_FEW - shared)},
                )
            )
    return list(found)


HYPOTHESES: tuple[Hypothesis[Any], ...] = (
    Hypothesis(RigEvidence, (Code.SHOT_MISMATCHED,), Cost.TABLES, mismatched),
    Hypothesis(RigEvidence, (Code.CLOCKS_DIFFER,), Cost.TABLES, clocks_differ),
    Hypothesis(RigEvidence, (Code.CAMERA_MOVED,), Cost.PASS, camera_moved),
    Hypothesis(
        RigEvidence,
        (Code.NOT_AT_ONCE, Code.SHOT_APART),
        Cost.PASS,
        not_at_once,
        lambda e, found: all(one.code is not Code.CAMERA_MOVED for one in found),
    ),
    Hypothesis(RigEvidence, (Code.FEW_COMMON_SHOTS,), Cost.TABLES, few_common_shots),
)
"""What may be wrong with a fitted rig, in the order in which it is told."""


def find_rig_faults(evidence: Evidence, known: Sequence[Finding] = ()) -> list[Finding]:
    """What is likely wrong with a rig, or with one of its cameras; see :func:`find_faults`."""
    return find_faults(evidence, known, HYPOTHESES)
