"""What is wrong with the drawing of several boards, by the object as it was measured.

Where there is no fit, it is measured with no drawing but each board's own grid of squares.
Every board in every photo is taken as a flat thing of its own: a lens and a pose for each follow
from that. Where two boards are in one photo, their poses give one's place in the other's frame,
and that it is the same in all photos gives the ratio of their squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.diagnosis.mirrored import in_mirror
from cubicfish_cli.diagnosis.object_faults import EXCHANGED, Fault, object_fault
from cubicfish_cli.diagnosis.photo_lenses import enough_photos, fit_of_few, spread_out
from cubicfish_cli.fitting.evidence import FailedFit, FitEvidence
from cubicfish_cli.fitting.local_noise import local_noise_px, times_noise
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial
from cubicfish_cli.fitting.refinement import Drawing, ObjectFit, refine_object
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.geometry import mean_rotation
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

_FEWEST_CORNERS = 12
_FEWEST_LINES = 3
_FEWEST_LINKS = 3
_ROUNDS = 20
# Photos must agree on where a board is to this many squares, or it moved between them.
_AGREE = 0.5
# The object as drawn is to blame where it makes the error this many times larger; or somewhat
# larger, where one fault is nearly all of what is wrong with it and beyond what a ruler misses, as
# a share of the object's extent.
_TIMES_WORSE = 2.0
_SOMEWHAT_WORSE = 1.3
_NEARLY_ALL, _BEYOND_A_RULER = 0.1, 5e-4
# A fit so much worse than its corners' noise, and the object is measured to see whether it is as
# drawn.
_WORTH_MEASURING = 1.2
# Photos agree with a lens when their noise is within this many times the best ones'.
_AGREES = 6.0
_SAID_RATIOS = {25.4: "inches_mm", 10.0: "cm_mm", 1000.0: "m_mm", 2.54: "inches_cm"}


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredBoard:
    """Where a board is: points are ``origin + plane @ axes`` of plane coordinates in squares.

    Attributes:
        origin: (3,) in the first board's frame and squares.
        axes: (2, 3) steps of a square along x and y.

    """

    origin: FloatArray
    axes: FloatArray

    def points(self, plane: FloatArray) -> FloatArray:
        """Plane coordinates in squares (..., 2) -> (..., 3)."""
        return np.asarray(self.origin + plane @ self.axes)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredObject:
    """The boards that could be measured, by index, in one frame, and the lens that did it."""

    boards: dict[int, MeasuredBoard]
    lens: RadialReference


def plane_in_squares(board: Board, column: IntArray, row: IntArray) -> FloatArray:
    """(N, 2) place of corners on their board, in squares."""
    return np.asarray(board.plane_points(column, row) / board.square)


def measured_object(pairs: Observations, target: Target) -> MeasuredObject | None:
    """Measure the object.

    Returns:
        None where there are no boards, or they cannot be put together.

    Raises:
        FitError: the boards by themselves do not fit a lens.

    """
    views = _views(pairs, target)
    if views is None:
        return None
    lens = fit_radial(views)
    photo, board = np.array([name.split(":") for name in lens.pairs.images], np.intp).T
    boards = np.unique(board)
    seen = np.zeros((len(pairs.images), len(target.boards)), np.intp) - 1
    seen[photo, board] = np.arange(len(photo))
    first = int(boards[np.argmax([(board == one).sum() for one in boards])])
    identity = MeasuredBoard(origin=np.zeros(3), axes=np.eye(3)[:2])
    placed = {first: identity}
    while len(placed) < len(boards):
        links = {
            (known, new): int(((seen[:, known] >= 0) & (seen[:, new] >= 0)).sum())
            for known in placed
            for new in boards.tolist()
            if new not in placed
        }
        (known, new), most = max(links.items(), key=lambda link: link[1])
        if most < _FEWEST_LINKS:
            break
        both = (seen[:, known] >= 0) & (seen[:, new] >= 0)
        step = _relative(lens.poses, seen[both, known], seen[both, new])
        if step is None:
            break
        placed[new] = _after(placed[known], step)
    return MeasuredObject(boards=placed, lens=lens) if placed else None


def _views(pairs: Observations, target: Target) -> Observations | None:
    """Each board in each photo as a photo of one flat board, in squares; None without any."""
    world = np.zeros_like(pairs.world)
    usable = np.zeros(len(world), bool)
    for index, board in enumerate(target.boards):
        own = np.flatnonzero(pairs.board == index)
        if board.points is not None or not own.size:
            continue
        world[own, :2] = plane_in_squares(board, pairs.column[own], pairs.row[own])
        for photo in np.unique(pairs.image[own]):
            here = own[pairs.image[own] == photo]
            lines = min(len(np.unique(pairs.column[here])), len(np.unique(pairs.row[here])))
            usable[here] = len(here) >= _FEWEST_CORNERS and lines >= _FEWEST_LINES
    if not usable.any():
        return None
    views, image = np.unique(
        np.stack([pairs.image, pairs.board], axis=1)[usable], axis=0, return_inverse=True
    )
    seen = replace(
        pairs.select(usable).with_world(world[usable]),
        images=tuple(f"{photo}:{board}" for photo, board in views),
        image=image.reshape(-1).astype(np.intp),
        board=np.zeros(len(image), np.intp),
        boards=("board",),
    )
    return seen.by_photo()


def _relative(
    poses: Poses, one: IntArray, other: IntArray
) -> tuple[FloatArray, float, FloatArray] | None:
    """Rotation (3, 3), scale and shift (3,) from another board's frame to one's.

    Medians by reweighting: a board nearly square to the camera may lean the wrong way in a photo.
    """
    back = poses.rotation[one].transpose(0, 2, 1)
    turns = back @ poses.rotation[other]
    u = (back @ poses.translation[other][:, :, None])[:, :, 0]
    v = (back @ poses.translation[one][:, :, None])[:, :, 0]
    weight = np.ones(len(one))
    rotation = turns[0]
    for _ in range(_ROUNDS):
        rotation = mean_rotation(turns, weight)
        weight = 1 / np.maximum(np.linalg.norm(turns - rotation, axis=(1, 2)), 1e-6)
    weight = np.ones(len(one))
    system = np.zeros((len(one), 3, 4))
    system[:, :, 0] = u
    system[:, :, 1:] = -np.eye(3)
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(
            (system * root[:, :, None]).reshape(-1, 4), (v * root).reshape(-1), rcond=None
        )[0]
        miss = np.linalg.norm(system @ solution - v, axis=1)
        weight = 1 / np.maximum(miss, 1e-6)
    if solution[0] <= 0 or np.median(miss) > _AGREE:
        return None
    return np.array(rotation, float), float(solution[0]), np.array(solution[1:], float)


def _after(known: MeasuredBoard, step: tuple[FloatArray, float, FloatArray]) -> MeasuredBoard:
    """A board that is placed in the frame of a known one, in the frame of that one's own."""
    rotation, scale, shift = step
    size = float(np.linalg.norm(known.axes[0]))
    frame = np.vstack([known.axes, np.cross(known.axes[0], known.axes[1]) / size])
    return MeasuredBoard(
        origin=known.origin + shift @ frame, axes=scale * rotation[:, :2].T @ frame
    )


def wrong_drawing(evidence: FitEvidence) -> list[Finding]:
    """What is wrong with the drawing, where the object as fitted shows it."""
    fit, drawing = evidence.fit, evidence.drawing
    if drawing.target is None or len(drawing.target.boards) < 2:
        return []
    if fit.level != "off":
        found = _of_refined(evidence.drawn, fit, drawing)
        return [replace(finding, severity=Severity.CARE) for finding in found]
    pairs, residual = fit.reference.pairs, fit.cubic.residual
    times = times_noise(pairs, residual)
    if times is None or times < _WORTH_MEASURING:
        return []
    everyone = np.arange(len(pairs.images))
    few = spread_out(everyone, enough_photos(len(everyone)))
    found = []
    for photos in (few, everyone)[: 1 + (len(few) < len(everyone))]:
        part = fit_of_few(fit, photos)
        own = drawing.of(part.reference.pairs)
        refined = refine_object(part, own, "shape", ())
        found = _of_refined(part, refined, own)
        if not found:
            break
    return found


def _of_refined(drawn: ObjectFit, refined: ObjectFit, drawing: Drawing) -> list[Finding]:
    """What is wrong with the drawing, where the object is free to be otherwise."""
    target, real = drawing.target, refined.refined_target(drawing)
    before, after = rms_px(drawn.cubic.residual), rms_px(refined.cubic.residual)
    if before < _SOMEWHAT_WORSE * after or target is None or real is None:
        return []
    measured = {}
    for index in np.unique(drawing.pairs.board):
        measured[int(index)] = real.boards[index].world_points(*target.boards[index].places())
    fault = object_fault(target, measured)
    if fault is None or (before < _TIMES_WORSE * after and not _stands_out(fault)):
        return []
    return [_object_finding(fault, target, "refined", before_px=before, after_px=after)]


def _stands_out(fault: Fault) -> bool:
    """Whether a fault is large, and what else is wrong with the drawing is little beside it."""
    extent = np.linalg.norm(np.ptp(np.concatenate(list(fault.points.values())), axis=0))
    return bool(
        fault.before > _BEYOND_A_RULER * extent and fault.after < _NEARLY_ALL * fault.before
    )


def _object_finding(fault: Fault, target: Target, because: str, **figures: float) -> Finding:
    """A fault of the drawing as it is told."""
    boards = [target.boards[index] for index in fault.boards]
    every = len(boards) == len(target.boards) > 1
    told = partial(
        Finding,
        severity=Severity.BAD,
        because=because,
        boards=() if fault.kind == "mirror" else tuple(board.name for board in boards),
    )
    if fault.kind == "mirror":
        return told(code=Code.MIRRORED, case="target", figures=figures)
    if fault.kind == "names":
        return told(code=Code.BOARD_NAMES, figures=figures)
    if fault.kind == "order":
        order, size = fault.order, next((one for one in boards if one.columns != one.rows), None)
        if order in EXCHANGED:
            order = "exchanged" if size is None else "exchanged_size"
        shape = {} if size is None else {"columns": size.columns, "rows": size.rows}
        which = "all" if every else "one"
        return told(
            code=Code.BOARD_ORDER, figures={**figures, **shape, "order": order, "which": which}
        )
    if fault.kind in ("square", "squares"):
        sizes = sorted({board.square for board in boards})
        mixed = _mixed_units(fault.ratio)
        return told(
            code=Code.BOARD_SQUARE,
            case="_".join(["all"] * every + ["units"] * bool(mixed)),
            figures={
                **figures,
                "off": fault.ratio - 1,
                "times": max(fault.ratio, 1 / fault.ratio),
                "real": ", ".join(
                    f"{fault.ratio * size:.4g} {target.units} for {size:g}" for size in sizes
                ),
                **({"units_mixed": mixed} if mixed else {}),
            },
        )
    case = ["of", "two"] * (len(fault.points) == 2) + ["and", "square"] * (fault.kind != "place")
    return told(
        code=Code.BOARD_PLACE,
        case="_".join(case),
        figures={
            **figures,
            "shift": fault.shift,
            "turn_deg": fault.turn_deg,
            "units": target.units,
            "off": fault.ratio - 1,
            "both": [target.boards[index].name for index in fault.points],
        },
    )


def _mixed_units(ratio: float) -> str:
    larger = max(ratio, 1 / ratio)
    return next((mix for known, mix in _SAID_RATIOS.items() if abs(larger / known - 1) < 0.02), "")


def wrong_drawing_of_failure(evidence: FailedFit) -> list[Finding]:
    """The fault of the drawing without which the corners fit."""
    target = evidence.target
    if target is None or len(target.boards) < 2:
        return []
    pairs, scale = evidence.scaled
    measured = measured_object(pairs, target)
    if measured is None:
        return []
    points = {}
    for index, board in measured.boards.items():
        drawn = target.boards[index]
        points[index] = board.points(plane_in_squares(drawn, *drawn.places()))
    fault = object_fault(target, points)
    if fault is None:
        return []
    world = pairs.world.copy()
    for index, real in fault.points.items():
        own = pairs.board == index
        world[own] = real[pairs.row[own] * target.boards[index].columns + pairs.column[own]] / scale
    corrected = pairs.with_world(world)
    if fault.kind == "mirror":
        corrected = in_mirror(corrected)
    again = fit_radial(corrected)
    noise = local_noise_px(again.pairs, again.residual)
    if noise_px(again.residual) > _AGREES * max(noise, 1e-3):
        return []
    return [_object_finding(fault, target, "corrected", after_px=noise_px(again.residual))]
