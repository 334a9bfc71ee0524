"""What is likely wrong with a set-up, from a fit or from its failure.

A right set-up costs a pass over its corners. Whatever costs more is tried only where the fit is
worse than the corners' own noise explains, or where photos or boards do not fit it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.diagnosis.board_faults import (
    FEWEST_CORNERS,
    board_fault,
    board_findings,
)
from cubicfish_cli.fitting.diagnosis.failed_lens import failed_lens, mirrored_object
from cubicfish_cli.fitting.diagnosis.few_photos import enough_photos, fit_of_few, spread_out
from cubicfish_cli.fitting.diagnosis.handedness import local_noise_px, seen_sides
from cubicfish_cli.fitting.diagnosis.lens_faults import left_out_lens, lens_findings
from cubicfish_cli.fitting.diagnosis.measured_object import measured_object, plane_in_squares
from cubicfish_cli.fitting.diagnosis.object_faults import EXCHANGED, Fault, object_fault
from cubicfish_cli.fitting.diagnosis.repeats import NEAR_SHARE, repeated_groups
from cubicfish_cli.fitting.diagnosis.squares_counted import squares_counted
from cubicfish_cli.fitting.diagnosis.unsteady import unsteady
from cubicfish_cli.fitting.radial_reference import fit_radial
from cubicfish_cli.fitting.refinement import Drawing, ObjectFit, refine_object
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.fitting.subset import flatness, select_photos, world_scale
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

# The object as drawn is to blame where it makes the error this many times larger; or somewhat
# larger, where one fault is nearly all of what is wrong with it and beyond what a ruler misses, as
# a share of the object's extent.
_TIMES_WORSE = 2.0
_SOMEWHAT_WORSE = 1.3
_NEARLY_ALL, _BEYOND_A_RULER = 0.1, 5e-4
# Errors of neighbouring corners that go together make a fit so much worse than their noise.
_BEYOND_NOISE = 1.5
# So much worse, and the object is measured to see whether it is as drawn.
_WORTH_MEASURING = 1.2
_FEWEST_PHOTOS = 3
_MOST_LEFT_OUT = 30
# A fault in so many of a board's photos is the drawing's.
_NEARLY_ALL_PHOTOS = 0.8
# Counting squares shows in so many photos of the whole board.
_WHOLE_BOARDS = 3
# Photos agree with a lens when their noise is within this many times the best ones'.
_AGREES = 6.0
_SAID_RATIOS = {25.4: "inches_mm", 10.0: "cm_mm", 1000.0: "m_mm", 2.54: "inches_cm"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What hypotheses are judged by.

    Attributes:
        pairs: all pairs, in the target's units.
        drawn: the fit to the object as drawn.
        fit: the final fit.
        drawing: the object as drawn.
        dropped: photo and board of each corner that was left out as grossly wrong.
        known: what was found before the fit, and comes first.

    """

    pairs: Correspondences
    drawn: ObjectFit
    fit: ObjectFit
    drawing: Drawing
    dropped: Sequence[tuple[str, str | None]]
    known: Sequence[Finding] = ()


class Hypothesis(NamedTuple):
    """One kind of thing that may be wrong.

    Attributes:
        explain: what is found of it, from the evidence and what was found before.
        applies: whether what was found before leaves anything to be explained by it.
        instead_of: what it makes needless, where it is found.

    """

    explain: Callable[[Evidence, Sequence[Finding]], list[Finding]]
    applies: Callable[[Evidence, Sequence[Finding]], bool] = lambda evidence, found: True
    instead_of: tuple[Code, ...] = ()


def _is_named(evidence: Evidence, _: Sequence[Finding]) -> bool:
    """Corners that are named by a wrong drawing say nothing of the lens or of the drawing."""
    return not _is_bad(evidence.known)


def _is_bad(found: Sequence[Finding]) -> bool:
    return any(finding.severity is Severity.BAD for finding in found)


def _lacks(code: Code, found: Sequence[Finding]) -> bool:
    return all(finding.code is not code for finding in found)


# What is tried, one after the other: from what costs least, as far as one depends on another.
HYPOTHESES = (
    Hypothesis(lambda e, found: _handed(e.pairs)),
    Hypothesis(lambda e, found: lens_findings(e.fit, e.drawn), _is_named),
    Hypothesis(
        lambda e, found: _of_object(e.drawn, e.fit, e.drawing), lambda e, found: not _is_bad(found)
    ),
    Hypothesis(
        lambda e, found: unsteady(e.fit),
        lambda e, found: not _is_bad(found) and _lacks(Code.SHEARED, found),
        # Where all photos differ, those that do so most are not odd.
        instead_of=(Code.PHOTO_LENS,),
    ),
    Hypothesis(
        lambda e, found: _of_left_out(e.pairs, e.fit, e.drawing, e.dropped, found), _is_named
    ),
    Hypothesis(
        lambda e, found: _counted_squares(e.pairs, e.drawing.target),
        lambda e, found: (
            _is_named(e, found) and all(one.code is not Code.CORNER_COUNT for one in found)
        ),
    ),
    Hypothesis(lambda e, found: _repeats(e.fit)),
)


def find_faults(evidence: Evidence) -> list[Finding]:
    """What is likely wrong with a set-up of which the fit succeeded."""
    found = list(evidence.known)
    for hypothesis in HYPOTHESES:
        if hypothesis.applies(evidence, found):
            more = hypothesis.explain(evidence, found)
            if more:
                found = [one for one in found if one.code not in hypothesis.instead_of]
            found += more
    return found


def explained(
    error: FitError,
    pairs: Correspondences,
    target: Target | None,
    known: Sequence[Finding] = (),
    *,
    fits: bool = False,
) -> FitError:
    """The same error with its likely cause in place of general advice, where one is found.

    Args:
        error: why there is no fit.
        pairs: all pairs, in the target's units.
        target: the drawing.
        known: what was found before the fit; what is bad is believed.
        fits: whether the corners do fit one lens and the drawing, so that neither is to blame.

    """
    try:
        wrong = [finding for finding in known if finding.severity is Severity.BAD]
        finding = next(iter(wrong), None) or _of_failure(pairs, target, fits)
    except (FitError, np.linalg.LinAlgError):
        return error
    if finding is None:
        return error
    return FitError(error.what, do=finding.line)


# Which way round


def _handed(pairs: Correspondences) -> list[Finding]:
    """Photos or boards that are seen as in a mirror, though the fit succeeded."""
    sides = seen_sides(pairs)
    some = _some_mirrored(sides, pairs)
    if some is not None:
        return [some]
    if flatness(pairs.world) < 1e-4 and (sides < 0).any() and not (sides > 0).any():
        return [Finding(code=Code.MIRRORED, case="behind", severity=Severity.CARE)]
    return []


def _some_mirrored(sides: IntArray, pairs: Correspondences) -> Finding | None:
    """Photos that show boards the other way round than most photos show the same boards."""
    usual = np.sign(sides.sum(axis=0))
    against = (sides * usual < 0).any(axis=1) & ~(sides * usual > 0).any(axis=1)
    known = (sides * usual != 0).any(axis=1)
    if not against.any() or 2 * against.sum() >= known.sum():
        return None
    names = tuple(pairs.images[photo] for photo in np.flatnonzero(against))
    return Finding(code=Code.MIRRORED, case="some", images=names)


# The object


def _of_object(drawn: ObjectFit, fit: ObjectFit, drawing: Drawing) -> list[Finding]:
    """What is wrong with the drawing, where the object as fitted shows it."""
    if drawing.target is None or len(drawing.target.boards) < 2:
        return []
    if fit.level != "off":
        found = _of_refined(drawn, fit, drawing)
        return [replace(finding, severity=Severity.CARE) for finding in found]
    pairs, residual = fit.reference.pairs, fit.cubic.residual
    times = _times_noise(pairs, residual)
    if times is None or times < _WORTH_MEASURING:
        return []
    everyone = np.arange(len(pairs.images))
    few = spread_out(everyone, enough_photos(len(everyone)))
    found = []
    for photos in (few, everyone)[: 1 + (len(few) < len(everyone))]:
        part = fit_of_few(fit, photos)
        own = drawing.of(part.reference.pairs)
        try:
            refined = refine_object(part, own, "shape", ())
        except (FitError, np.linalg.LinAlgError):
            return []
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


# Photos and boards that were left out


def _of_left_out(
    pairs: Correspondences,
    fit: ObjectFit,
    drawing: Drawing,
    dropped: Sequence[tuple[str, str | None]],
    known: Sequence[Finding],
) -> list[Finding]:
    """Why photos, or boards in photos, do not fit the lens of the others."""
    mirrored = {name for one in known if one.code is Code.MIRRORED for name in one.images}
    names = _left_out(pairs, fit, dropped) - mirrored
    photos = np.array([i for i, name in enumerate(pairs.images) if name in names], np.intp)
    if not photos.size:
        return []
    camera, noise = fit.reference.camera, noise_px(fit.reference.residual)
    scaled = replace(pairs, world=pairs.world / drawing.scale)
    findings: list[Finding] = []
    unfit = [photo for photo in photos if pairs.images[photo] in fit.reference.unfit]
    if unfit:
        own = left_out_lens(
            camera, select_photos(scaled, np.array(unfit)), noise, order=pairs.images
        )
        if own is not None:
            findings.append(own)
            photos = np.setdiff1d(
                photos, [i for i, name in enumerate(pairs.images) if name in own.images]
            )
    if drawing.target is not None:
        target, tried = drawing.target, photos[:_MOST_LEFT_OUT]
        singly = (select_photos(scaled, np.array([photo])) for photo in tried)
        faults = [board_fault(camera, one, target, drawing.scale, noise) for one in singly]

        def is_usual(name: str, times: int) -> bool:
            """Whether so many of the photos that were tried show it of nearly all there are."""
            own = pairs.image[pairs.board == pairs.boards.index(name)]
            shown = np.flatnonzero(np.bincount(own) >= FEWEST_CORNERS)
            among, lost = (np.isin(shown, some).sum() for some in (tried, photos))
            return bool(
                times >= _FEWEST_PHOTOS and times * lost >= _NEARLY_ALL_PHOTOS * among * len(shown)
            )

        findings += board_findings([fault for fault in faults if fault is not None], is_usual)
    return findings


def _left_out(
    pairs: Correspondences, fit: ObjectFit, dropped: Sequence[tuple[str, str | None]]
) -> set[str]:
    """Photos that were left out, and those of which a board lost half of its corners."""
    unfit = fit.reference.unfit.items()
    names = {name for name, why in unfit if why.code is not Code.TOO_FEW_CORNERS}
    counts: dict[tuple[str, str], int] = {}
    for image, board in dropped:
        if board is not None:
            counts[image, board] = counts.get((image, board), 0) + 1
    for (image, board), lost in counts.items():
        own = (pairs.image == pairs.images.index(image)) & (
            pairs.board == pairs.boards.index(board)
        )
        if 2 * lost >= own.sum() > _FEWEST_PHOTOS:
            names.add(image)
    return names


def _counted_squares(pairs: Correspondences, target: Target | None) -> list[Finding]:
    """Boards that are seen whole in photos, but for the last column and row that they are to have.

    Corners that come as a table may be counted rightly where the target's squares are counted.
    """
    boards = []
    for index, board in enumerate(target.boards if target else ()):
        own = pairs.board == index
        if board.points is not None or not own.any() or min(board.columns, board.rows) < 3:
            continue
        last = pairs.column[own].max() + 1, pairs.row[own].max() + 1
        if last != (board.columns - 1, board.rows - 1):
            continue
        seen = np.bincount(pairs.image[own], minlength=len(pairs.images))
        if (seen == last[0] * last[1]).sum() >= _WHOLE_BOARDS:
            boards.append(board)
    if not boards:
        return []
    return [squares_counted(boards)]


# Photos that say the same


def _repeats(fit: ObjectFit) -> list[Finding]:
    pairs, poses = fit.reference.pairs, fit.cubic.poses
    focal = fit.reference.camera.fx
    count = len(pairs.images)
    if count < 2:
        return []
    group = repeated_groups(poses, pairs, focal)
    distinct = int(group.max()) + 1
    if count >= _FEWEST_PHOTOS and repeated_groups(poses, pairs, focal, NEAR_SHARE).max() == 0:
        figures = {"photos": count, "near": NEAR_SHARE}
        return [Finding(code=Code.ONE_PLACE, severity=Severity.CARE, figures=figures)]
    if distinct == count:
        return []
    repeats = [
        f"{pairs.images[np.flatnonzero(group == group[photo])[0]]} = {pairs.images[photo]}"
        for photo in range(count)
        if np.flatnonzero(group == group[photo])[0] != photo
    ]
    few = 2 * distinct <= count or distinct < _FEWEST_PHOTOS
    return [
        Finding(
            code=Code.REPEATS,
            severity=Severity.CARE if few else Severity.NOTE,
            figures={"photos": count, "distinct": distinct, "repeats": repeats},
            images=tuple(np.array(pairs.images)[np.bincount(group)[group] > 1].tolist()),
        )
    ]


# When there is no fit


def within_noise(pairs: Correspondences, residual: FloatArray) -> bool:
    """Whether residuals (N, 2) are no larger than the corners' own noise explains."""
    times = _times_noise(pairs, residual)
    return times is not None and times < _BEYOND_NOISE


def _times_noise(pairs: Correspondences, residual: FloatArray) -> float | None:
    """How many times the corners' own noise the residuals are; None where it is not known."""
    noise = local_noise_px(pairs, residual)
    return noise_px(residual) / noise if noise else None


def _of_failure(pairs: Correspondences, target: Target | None, fits: bool) -> Finding | None:
    """The likeliest reason why pairs could not be fitted."""
    scale = world_scale(pairs)
    pairs = select_photos(replace(pairs, world=pairs.world / scale), np.arange(len(pairs.images)))
    some = _some_mirrored(seen_sides(pairs), pairs)
    if some is not None or fits:
        return some
    if target is not None and len(target.boards) > 1:
        found = _failed_object(pairs, target, scale)
        if found is not None:
            return found
    return mirrored_object(pairs) or failed_lens(pairs)


def _failed_object(pairs: Correspondences, target: Target, scale: float) -> Finding | None:
    """The fault of the drawing without which the corners fit."""
    measured = measured_object(pairs, target)
    if measured is None:
        return None
    points = {}
    for index, board in measured.boards.items():
        drawn = target.boards[index]
        points[index] = board.points(plane_in_squares(drawn, *drawn.places()))
    fault = object_fault(target, points)
    if fault is None:
        return None
    world = pairs.world.copy()
    for index, real in fault.points.items():
        own = pairs.board == index
        world[own] = real[pairs.row[own] * target.boards[index].columns + pairs.column[own]] / scale
    corrected = replace(pairs, world=world)
    if fault.kind == "mirror":
        pixel = corrected.pixel * [-1, 1] + [pairs.image_size[0] - 1, 0]
        corrected = replace(corrected, pixel=pixel)
    try:
        again = fit_radial(corrected)
    except (FitError, np.linalg.LinAlgError):
        return None
    noise = local_noise_px(again.pairs, again.residual)
    if noise_px(again.residual) > _AGREES * max(noise, 1e-3):
        return None
    return _object_finding(fault, target, "corrected", after_px=noise_px(again.residual))
