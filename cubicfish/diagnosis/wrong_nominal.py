"""What is wrong with the nominal target of several boards (target.yaml), by the target as measured.

Where there is no fit, the target is measured from each board's own grid of squares alone.
Every board in every photo is taken as a flat thing of its own: a lens and a pose for each follow
from that. Where two boards are in one photo, their poses give one board's place in the other's
frame. That it is the same in all photos gives the ratio of their squares.
"""

from dataclasses import replace

import numpy as np

from cubicfish.diagnosis.mirrored import in_mirror
from cubicfish.diagnosis.object_faults import Fault, object_fault
from cubicfish.fit.calibration import FailedFit, FitEvidence
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.fit.refinement import refine_object
from cubicfish.geometry import mean_rotation
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import local_noise_px, noise_px, rms_px, times_noise
from cubicfish.target.boards.board import Board
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray
from cubicfish.units import MILLIMETRES

_FEWEST_CORNERS = 12
_FEWEST_LINES = 3
_FEWEST_LINKS = 3
_ROUNDS = 20
# Photos must agree on a board's place to this many squares, or it moved between them.
_AGREE = 0.5
# The nominal target is to blame where it makes the error this many times larger; or somewhat
# larger, if one fault is nearly all of what is wrong with it and larger than a ruler's error, as a
# share of the target's extent.
_TIMES_WORSE = 2.0
_SOMEWHAT_WORSE = 1.3
_NEARLY_ALL, _BEYOND_A_RULER = 0.1, 5e-4
# Where a fit is so much worse than its corners' noise, the target is measured to see whether it is
# as given.
_MEASURED_FROM = 1.2
# Photos agree with a lens if their noise is within this many times that of the best ones.
_AGREES = 6.0
# Beyond these a deformation is no property of paper, plate or wall but a mistake in the nominal
# target or in the names of the corners. Shares are of the board's half diagonal.
_MOST_BEND_SHARE = 0.03
_MOST_STRETCH = 0.015
_MOST_SHIFT_SHARE = 0.03
_MOST_TURN_DEG = 2.0
# Of a square: prints and names are exact in the plane, whatever the plate is.
_MOST_OFFSET_SHARE = 0.02
# A sheet on a plate is flat to a thousandth, and bends as a whole by some thousandths.
_MOST_WAVES_SHARE = 0.003
# Nobody holds a target nearer to a lens or, with a print that one carries, so far away; and from so
# many times as far its corners are not seen.
_NEAREST_MM, _FARTHEST_MM, _TOO_FAR = 2.0, 2000.0, 20.0


def measured_object(pairs: Observations, target: Target) -> dict[int, FloatArray]:
    """Measure the target.

    Returns:
        (rows * columns, 3) corners of each board that could be measured, by index, row by row, in
        one frame; none where there are no boards, or too little of them is seen.

    Raises:
        FitError: the boards by themselves do not fit a lens.

    """
    views = split_into_boards(pairs, target)
    if views is None:
        return {}
    lens = fit_radial(views)
    photo, board = np.array([name.split(":") for name in lens.pairs.images], np.intp).T
    seen = np.zeros((len(pairs.images), len(target.boards)), np.intp) - 1
    seen[photo, board] = np.arange(len(photo))
    together = (seen >= 0).T.astype(np.intp) @ (seen >= 0)
    # The motion from a board's own frame, in its squares, to that of the board that most photos
    # show.
    placed = {int(np.argmax(together.diagonal())): np.eye(4)}
    while True:
        links = [
            (together[known, new], -known, -new)
            for known in placed
            for new in np.unique(board).tolist()
            if new not in placed
        ]
        most, known, new = max(links, default=(0, 0, 0))
        if most < _FEWEST_LINKS:
            break
        both = (seen[:, -known] >= 0) & (seen[:, -new] >= 0)
        step = _place_beside(lens.poses, seen[both, -known], seen[both, -new])
        if step is None:
            break
        placed[-new] = placed[-known] @ step
    measured = {}
    for index, frame in placed.items():
        one = target.boards[index]
        plane = one.plane_points(*one.places()) / one.square
        measured[index] = plane @ frame[:3, :2].T + frame[:3, 3]
    return measured


def split_into_boards(pairs: Observations, target: Target) -> Observations | None:
    """Take each board in each photo as a photo of one flat board, in squares; None without any."""
    world, names, image = np.zeros_like(pairs.world), list[str](), np.full(len(pairs.image), -1)
    for photo, index in np.unique(np.stack([pairs.image, pairs.board]), axis=1).T.tolist():
        own = np.flatnonzero((pairs.image == photo) & (pairs.board == index))
        board, column, row = target.boards[index], pairs.column[own], pairs.row[own]
        lines = min(len(np.unique(column)), len(np.unique(row)))
        if board.points is None and len(own) >= _FEWEST_CORNERS and lines >= _FEWEST_LINES:
            world[own, :2] = board.plane_points(column, row) / board.square
            image[own] = len(names)
            names.append(f"{photo}:{index}")
    if not names:
        return None
    seen = replace(pairs, images=tuple(names), image=image, boards=("board",)).with_world(world)
    seen = seen.select(image >= 0)
    return replace(seen, board=np.zeros(len(seen.image), np.intp)).by_photo()


def _place_beside(poses: Poses, one: IntArray, other: IntArray) -> FloatArray | None:
    """(4, 4) the motion from another board's frame to one's, each in its squares.

    Reweighting gives medians: a board nearly square to the camera may lean the wrong way in a
    photo.
    """
    back = poses.rotation[one].transpose(0, 2, 1)
    turns = back @ poses.rotation[other]
    system = np.zeros((len(one), 3, 4))
    system[:, :, 0] = (back @ poses.translation[other][:, :, None])[:, :, 0]
    system[:, :, 1:] = -np.eye(3)
    goal = (back @ poses.translation[one][:, :, None])[:, :, 0]
    weight = miss_weight = np.ones(len(one))
    for _ in range(_ROUNDS):
        rotation = mean_rotation(turns, weight)
        weight = 1 / np.maximum(np.linalg.norm(turns - rotation, axis=(1, 2)), 1e-6)
        root = np.sqrt(miss_weight)[:, None]
        rows = (system * root[:, :, None]).reshape(-1, 4)
        scale, *shift = np.linalg.lstsq(rows, (goal * root).reshape(-1), rcond=None)[0]
        miss = np.linalg.norm(system @ [scale, *shift] - goal, axis=1)
        miss_weight = 1 / np.maximum(miss, 1e-6)
    if scale <= 0 or np.median(miss) > _AGREE:
        return None
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = scale * rotation, shift
    return step


def find_wrong_nominal(evidence: FitEvidence) -> list[Finding]:
    """Find what is wrong with the nominal target, by the target as fitted."""
    fit, nominal = evidence.fit, evidence.fit.nominal
    if nominal.target is None or len(nominal.target.boards) < 2:
        return []
    if fit.level != "off":
        found = _compare_refined(evidence.nominal_fit, fit)
        return [replace(finding, severity=Severity.CARE) for finding in found]
    pairs, residual = fit.reference.pairs, fit.residual
    times = times_noise(pairs, residual)
    if times is None or times < _MEASURED_FROM:
        return []
    own = replace(fit, nominal=replace(nominal, pairs=pairs))
    return _compare_refined(fit, refine_object(own, "shape", ()))


def _compare_refined(nominal_fit: CameraFit, refined: CameraFit) -> list[Finding]:
    """Find what is wrong with the nominal target, where the target is free to be otherwise."""
    nominal = refined.nominal
    target, real = nominal.target, nominal.refined(refined.world)
    before, after = rms_px(nominal_fit.errors), rms_px(refined.errors)
    if before < _SOMEWHAT_WORSE * after or target is None or real is None:
        return []
    measured = {}
    for index in np.unique(nominal.pairs.board).tolist():
        measured[index] = real.boards[index].world_points(*target.boards[index].places())
    fault = object_fault(target, measured)
    if fault is None or (before < _TIMES_WORSE * after and not _does_stand_out(fault)):
        return []
    figures = {"before_px": before, "after_px": after, **fault.finding.figures}
    return [replace(fault.finding, because="refined", figures=figures)]


def _does_stand_out(fault: Fault) -> bool:
    """Whether a fault is large, and little else is wrong with the nominal target beside it."""
    extent = np.linalg.norm(np.ptp(np.concatenate(list(fault.points.values())), axis=0))
    return bool(
        fault.before > _BEYOND_A_RULER * extent and fault.after < _NEARLY_ALL * fault.before
    )


def doubted_boards(evidence: FitEvidence) -> list[Finding]:
    """Find boards that depart from the nominal ones by more than paper, plate or wall explains."""
    target, found = evidence.target, list[Finding]()
    refined = evidence.fit.nominal.refined(evidence.fit.world)
    if target is None or refined is None:
        return found
    care, note = Severity.CARE, Severity.NOTE
    for one in evidence.departures:
        place = target.board_names.index(one.board)
        board, shape = target.boards[place], refined.boards[place].shape
        size = _find_half_diagonal(board)
        deepest, stretch = max(map(abs, (*one.bend, one.twist))), max(one.stretch, key=abs)
        moved = one.shift > _MOST_SHIFT_SHARE * size or one.turn_deg > _MOST_TURN_DEG
        aside = waves = 0.0
        if shape is not None and shape.offsets.any():
            offsets = shape.offsets[shape.offsets.any(axis=2)]
            aside, waves = rms_px(offsets[:, :2]), rms_px(offsets[:, 2:])
        off = aside > _MOST_OFFSET_SHARE * (board.square or size)
        wavy = waves > _MOST_WAVES_SHARE * size
        found += [
            Finding(
                code=code,
                case=case,
                severity=severity,
                boards=(one.board,),
                figures={**figures, "units": target.units},
            )
            for code, case, severity, is_odd, figures in (
                (Code.BENT, "", care, deepest > _MOST_BEND_SHARE * size, {"size": deepest}),
                (Code.BENT, "wavy", note, wavy, {"size": waves, "aside": aside}),
                (
                    Code.STRETCHED,
                    "",
                    care,
                    abs(stretch) > _MOST_STRETCH,
                    {"percent": 100 * stretch},
                ),
                (Code.MOVED, "", care, moved, {"size": one.shift, "turn_deg": one.turn_deg}),
                (Code.CORNERS_OFF, "", care, off, {"size": aside}),
            )
            if is_odd
        ]
    return found


def odd_distance(evidence: FitEvidence) -> list[Finding]:
    """Ask whether squares have their size, where the camera was too near or too far for a lens."""
    target, fit = evidence.target, evidence.fit
    unit = MILLIMETRES.get(target.units.lower()) if target else None
    if target is None or unit is None:
        return []
    pairs = fit.reference.pairs
    away = np.linalg.norm(fit.poses.apply(pairs.image, pairs.world), axis=1)
    distance = float(np.median(away)) * fit.nominal.scale * unit
    if _NEAREST_MM < distance < _FARTHEST_MM:
        return []
    square = max(board.square or 0.0 for board in target.boards)
    figures = {"distance_mm": distance, "square": square, "units": target.units}
    odd = distance <= _NEAREST_MM or distance > _TOO_FAR * _FARTHEST_MM
    severity = Severity.CARE if odd else Severity.NOTE
    return [Finding(code=Code.BOARD_SQUARE, case="distance", severity=severity, figures=figures)]


def _find_half_diagonal(board: Board) -> float:
    if board.points is not None:
        return float(np.linalg.norm(np.ptp(board.points, axis=0))) / 2
    return float(np.hypot(*board.normalised(np.zeros(2))[1]))


def explain_failure(evidence: FailedFit) -> list[Finding]:
    """Find the fault of the nominal target without which the corners fit."""
    target = evidence.target
    if target is None or len(target.boards) < 2:
        return []
    pairs, scale = evidence.scaled
    fault = object_fault(target, measured_object(pairs, target))
    if fault is None:
        return []
    world = pairs.world.copy()
    for index, real in fault.points.items():
        own = pairs.board == index
        world[own] = real[pairs.row[own] * target.boards[index].columns + pairs.column[own]] / scale
    corrected = pairs.with_world(world)
    if fault.finding.code == Code.MIRRORED:
        corrected = in_mirror(corrected)
    again = fit_radial(corrected)
    noise = local_noise_px(again.pairs, again.residual)
    if noise_px(again.residual) > _AGREES * max(noise, 1e-3):
        return []
    figures = {"after_px": noise_px(again.residual), **fault.finding.figures}
    return [replace(fault.finding, because="corrected", figures=figures)]
