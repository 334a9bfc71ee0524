"""Why photos, or boards in photos, do not fit the lens of the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.diagnosis.lens_faults import left_out_lens
from cubicfish_cli.diagnosis.mirrored import handed
from cubicfish_cli.diagnosis.object_faults import COUNTED, ORDERS, flat_points
from cubicfish_cli.fitting.adjustment import Adjustment
from cubicfish_cli.fitting.evidence import FitEvidence
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.refinement import ObjectFit
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.subset import select, select_photos
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Other ways of counting that are tried: so many lines on, and every order of both axes.
_MOST_STEPS = 3
FEWEST_CORNERS = 8
"""A board of fewer corners in a photo is not judged."""
# A corner under its right name is within this many standard deviations.
_NEAR = 6.0
# A board that moved is as sharp as the others: this many times as noisy, photos are blurred.
_CLEAN = 3.0
_FEWEST_PHOTOS = 3
_MOST_LEFT_OUT = 30
# A fault in so many of a board's photos is the drawing's.
_NEARLY_ALL_PHOTOS = 0.8


@dataclass(frozen=True, kw_only=True)
class Misnaming:
    """How the corners of a board are counted or named otherwise than the drawing says.

    Attributes:
        code: what kind of fault of the drawing it is, where it is so in all photos.
        named: how, a key of the catalogue.
        figures: what that needs, as pairs of name and value.

    """

    code: Code
    named: str
    figures: tuple[tuple[str, int | bool | str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class BoardFault:
    """Why one photo does not fit.

    Attributes:
        photo: its name.
        board: the board to blame; None for all boards alike.
        misnaming: what its corners are; None where the board lies elsewhere.
        error_px: how far, in the median, corners then are from where the rest puts them, pixels.

    """

    photo: str
    board: str | None
    misnaming: Misnaming | None
    error_px: float


def board_fault(
    camera: RadialCamera, pairs: Observations, target: Target, scale: float, noise: float
) -> BoardFault | None:
    """Why one photo does not fit, if one of its boards is to blame.

    Args:
        camera: the lens of the photos that fit.
        pairs: pairs of one photo, divided by ``scale``.
        target: the object.
        scale: the target's units in one unit of the pairs.
        noise: standard deviation of a corner's coordinate in photos that fit, pixels.

    """
    photo = pairs.images[0]
    boards, counts = np.unique(pairs.board, return_counts=True)
    for board in boards[np.argsort(counts, kind="stable")]:
        others, _ = select(pairs, pairs.board != board)
        own, _ = select(pairs, pairs.board == board)
        if min(len(others.pixel), len(own.pixel)) < FEWEST_CORNERS:
            continue
        fit = _sharp(camera, others, noise)
        if fit is None:
            continue
        meant = target.boards[board]
        found = None
        if meant.points is None:
            found = _meant(camera, fit.poses.rotation[0], fit.poses.translation[0], own, target,
                           scale, noise)  # fmt: skip
        if found is None:
            # Corners that are no clean board by themselves are blurred, and say nothing of a place.
            alone, _, _ = fit_poses(camera, own)
            if (
                alone is None
                or noise_px(np.vstack([fit.residual, alone.residual])) > _CLEAN * noise
            ):
                continue
            return BoardFault(
                photo=photo,
                board=meant.name,
                misnaming=None,
                error_px=noise_px(fit.residual),
            )
        return BoardFault(photo=photo, board=meant.name, misnaming=found[0], error_px=found[1])
    return _all_boards(camera, pairs, target, scale, noise)


def board_findings(
    faults: Sequence[BoardFault], is_usual: Callable[[str, int], bool]
) -> list[Finding]:
    """What is to be said of photos with the same fault together.

    Args:
        faults: of :func:`board_fault`, each of another photo.
        is_usual: whether a fault of a board (by name) in so many photos is in nearly all that
            show it, so that the drawing is to blame.

    """
    alike: dict[tuple[str | None, Misnaming | None], list[BoardFault]] = {}
    for fault in faults:
        alike.setdefault((fault.board, fault.misnaming), []).append(fault)
    findings = []
    for (board, misnaming), own in alike.items():
        photos = tuple(fault.photo for fault in own)
        error = max(fault.error_px for fault in own)
        if board is not None and is_usual(board, len(own)):
            findings.append(_of_drawing(board, misnaming, photos, error))
        else:
            findings.append(_of_photos(board, misnaming, photos, error))
    return findings


def _of_drawing(
    board: str, misnaming: Misnaming | None, photos: tuple[str, ...], error: float
) -> Finding:
    told = partial(Finding, severity=Severity.CARE, images=photos, boards=(board,))
    if misnaming is None:
        return told(code=Code.BOARD_PLACE, case="in_most", figures={"photos": len(photos)})
    figures = {"photos": len(photos), "error_px": error, **dict(misnaming.figures)}
    key = "order" if misnaming.code is Code.BOARD_ORDER else "named"
    return told(code=misnaming.code, case="of_photos", figures={**figures, key: misnaming.named})


def _of_photos(
    board: str | None, misnaming: Misnaming | None, photos: tuple[str, ...], error: float
) -> Finding:
    told = partial(Finding, images=photos, boards=() if board is None else (board,))
    if misnaming is None:
        return told(code=Code.BOARD_PLACE, case="moved")
    return told(
        code=Code.CORNER_NAMES,
        case="" if board else "all_boards",
        figures={"error_px": error, "named": misnaming.named, **dict(misnaming.figures)},
    )


def _steps() -> list[tuple[int, int]]:
    reach = range(-_MOST_STEPS, _MOST_STEPS + 1)
    steps = [(x, y) for x in reach for y in reach if (x, y) != (0, 0)]
    return sorted(steps, key=lambda step: abs(step[0]) + abs(step[1]))


def _stepped(step: tuple[int, int]) -> Misnaming:
    columns, rows = step
    return Misnaming(
        code=Code.BOARD_PLACE,
        named="both" if columns and rows else "columns" if columns else "rows",
        figures=(
            ("column_steps", abs(columns)),
            ("columns_far", columns < 0),
            ("row_steps", abs(rows)),
            ("rows_far", rows < 0),
        ),
    )


def _meant(
    camera: RadialCamera,
    rotation: FloatArray,
    translation: FloatArray,
    own: Observations,
    target: Target,
    scale: float,
    noise: float,
) -> tuple[Misnaming, float] | None:
    """Under which other names a board's corners lie where the photo's other boards put them."""
    board = target.boards[own.board[0]]
    c, r = own.column.astype(float), own.row.astype(float)
    tried: list[tuple[Misnaming, Board, FloatArray, FloatArray]] = [
        (_stepped(step), board, c + step[0], r + step[1]) for step in _steps()
    ]
    tried += [
        (
            Misnaming(code=Code.BOARD_ORDER, named=order.removesuffix("_back")),
            board,
            *ORDERS[order](c, r, board.columns, board.rows),
        )
        for order in COUNTED
    ]
    tried += [
        (
            Misnaming(code=Code.BOARD_NAMES, named="other_board", figures=(("other", other.name),)),
            other,
            c,
            r,
        )
        for other in target.boards
        if other is not board and other.points is None
    ]
    best: tuple[Misnaming, float] | None = None
    for misnaming, on, column, row in tried:
        camera_points = flat_points(on, column, row) / scale @ rotation.T + translation
        miss = camera.project(camera_points) - own.pixel
        length = np.hypot(miss[:, 0], miss[:, 1])
        error = float(np.median(np.where(np.isfinite(length), length, np.inf)))
        if error < _NEAR * 2 * noise and (best is None or error < 0.5 * best[1]):
            best = (misnaming, error)
    return best


def _all_boards(
    camera: RadialCamera, pairs: Observations, target: Target, scale: float, noise: float
) -> BoardFault | None:
    """Whether the corners of all boards of a photo are counted from one line further on."""
    if any(target.boards[board].points is not None for board in np.unique(pairs.board)):
        return None
    if len(np.unique(pairs.board)) < 2:
        return None
    for step in _steps()[:8]:
        world = np.empty_like(pairs.world)
        for board in np.unique(pairs.board):
            here = pairs.board == board
            c, r = pairs.column[here] + float(step[0]), pairs.row[here] + float(step[1])
            world[here] = flat_points(target.boards[board], c, r) / scale
        fit = _sharp(camera, pairs.with_world(world), noise)
        if fit is not None:
            return BoardFault(
                photo=pairs.images[0],
                board=None,
                misnaming=_stepped(step),
                error_px=noise_px(fit.residual),
            )
    return None


def _sharp(camera: RadialCamera, pairs: Observations, noise: float) -> Adjustment | None:
    """The poses of all photos, where their corners fit nearly as well as those of others."""
    fit, placed, _ = fit_poses(camera, pairs)
    if fit is None or len(placed.pixel) < len(pairs.pixel):
        return None
    return fit if noise_px(fit.residual) < _NEAR * noise else None


def left_out(evidence: FitEvidence) -> list[Finding]:
    """Why photos, or boards in photos, do not fit the lens of the others."""
    pairs, fit, drawing = evidence.pairs, evidence.fit, evidence.drawing
    mirrored = {name for one in handed(pairs) for name in one.images}
    names = _left_out(pairs, fit, evidence.dropped) - mirrored
    photos = np.array([i for i, name in enumerate(pairs.images) if name in names], np.intp)
    if not photos.size:
        return []
    camera, noise = fit.reference.camera, noise_px(fit.reference.residual)
    scaled = pairs.with_world(pairs.world / drawing.scale)
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
    pairs: Observations, fit: ObjectFit, dropped: Sequence[tuple[str, str | None]]
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
