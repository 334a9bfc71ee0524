"""Boards whose corners do not fit in one photo: counted from elsewhere, or misnamed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.diagnosis.finding import Cause, Finding, listed
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.subset import select
from cubicfish_cli.model.radial import RadialCamera
from cubicfish_cli.target import Board, Target

FloatArray = npt.NDArray[np.float64]

# Other ways of counting that are tried: so many lines on, and every order of both axes.
_MOST_STEPS = 3
FEWEST_CORNERS = 8
"""A board of fewer corners in a photo is not judged."""
# A corner under its right name is within this many standard deviations.
_NEAR = 6.0
# A board that moved is as sharp as the others: this many times as noisy, photos are blurred.
_CLEAN = 3.0


@dataclass(frozen=True, kw_only=True)
class Misnaming:
    """How the corners of a board are counted or named otherwise than the drawing says.

    Attributes:
        of_photo: in words, after "corners of board x are named wrongly:".
        of_drawing: in words, after "board x:", where it is so in all photos.
        cause: what kind of fault of the drawing it is then.

    """

    of_photo: str
    of_drawing: str
    cause: Cause


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
    camera: RadialCamera, pairs: Correspondences, target: Target, scale: float, noise: float
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
        fit, placed, _ = fit_poses(camera, others)
        if fit is None or len(placed.pixel) < len(others.pixel):
            continue
        if noise_px(fit.residual) > _NEAR * noise:
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
    if misnaming is None:
        return Finding(
            cause="board_place",
            level="care",
            what=f"board {board} is not where target.yaml puts it beside the other boards",
            evidence=f"so in {len(photos)} photos, which fit without it",
            do="measure its origin and axes again, correct target.yaml and calibrate again",
            images=photos,
            boards=(board,),
        )
    return Finding(
        cause=misnaming.cause,
        level="care",
        what=f"board {board}: {misnaming.of_drawing}",
        evidence=f"so in {len(photos)} photos; with that its corners are within {error:.2f} px of "
        "where the other boards put them",
        do="correct target.yaml, or the order in corners.csv, and calibrate again: the camera is "
        "made without this board",
        images=photos,
        boards=(board,),
    )


def _of_photos(
    board: str | None, misnaming: Misnaming | None, photos: tuple[str, ...], error: float
) -> Finding:
    one = len(photos) == 1
    these, leave = ("this photo", "it") if one else ("these photos", "them")
    boards = () if board is None else (board,)
    which = listed(photos, "photos")
    if misnaming is None:
        return Finding(
            cause="board_place",
            level="note",
            what=f"{which}: board {board} is not where it is in the other photos: it moved, or its "
            "corners are named wrongly",
            evidence=f"without it {'the photo fits' if one else 'the photos fit'}",
            do=f"look at {these} with 'cubicfish detect --draw', or leave {leave} out",
            images=photos,
            boards=boards,
        )
    if board is None:
        what = f"{which}: corners of all boards are named {misnaming.of_photo}"
        evidence = f"with that {'the photo fits' if one else 'the photos fit'} to {error:.2f} px"
    else:
        what = f"{which}: corners of board {board} are named wrongly: {misnaming.of_photo}"
        evidence = f"with that they are within {error:.2f} px of where the rest puts them"
    return Finding(
        cause="corner_names",
        level="note",
        what=what,
        evidence=evidence,
        do=f"correct these rows of corners.csv, or leave the {'photo' if one else 'photos'} out",
        images=photos,
        boards=boards,
    )


def _plane(board: Board, column: FloatArray, row: FloatArray) -> FloatArray:
    plane = board.plane_points(column, row)
    return np.asarray(board.origin + plane[:, :1] * board.x_axis + plane[:, 1:] * board.y_axis)


def _steps() -> list[tuple[int, int]]:
    reach = range(-_MOST_STEPS, _MOST_STEPS + 1)
    steps = [(x, y) for x in reach for y in reach if (x, y) != (0, 0)]
    return sorted(steps, key=lambda step: abs(step[0]) + abs(step[1]))


def _stepped(step: tuple[int, int]) -> Misnaming:
    parts = [
        f"{abs(count)} {line}{'s' * (abs(count) > 1)} too {'far' if count < 0 else 'near'}"
        for count, line in zip(step, ("column", "row"), strict=True)
        if count
    ]
    words = " and ".join(parts)
    return Misnaming(
        of_photo=words, of_drawing=f"its corners are named {words}", cause="board_place"
    )


# What the drawing's corners may be counted as: in words of one photo and of the drawing.
_OPPOSITE = Misnaming(
    of_photo="counted from the opposite corner",
    of_drawing="corners are counted from the opposite corner, the board turned by 180°",
    cause="board_order",
)
_COLUMNS = Misnaming(
    of_photo="columns counted backwards",
    of_drawing="columns are counted the other way round than target.yaml says",
    cause="board_order",
)
_ROWS = Misnaming(
    of_photo="rows counted backwards",
    of_drawing="rows are counted the other way round than target.yaml says",
    cause="board_order",
)
_EXCHANGED = Misnaming(
    of_photo="rows and columns exchanged",
    of_drawing="rows and columns are exchanged",
    cause="board_order",
)
_QUARTER = Misnaming(
    of_photo="a quarter turn round",
    of_drawing="it is a quarter turn from how target.yaml has it",
    cause="board_order",
)


def _of_other(name: str) -> Misnaming:
    return Misnaming(
        of_photo=f"they are of board {name}",
        of_drawing=f"its corners are those of board {name}",
        cause="board_names",
    )


def _meant(
    camera: RadialCamera,
    rotation: FloatArray,
    translation: FloatArray,
    own: Correspondences,
    target: Target,
    scale: float,
    noise: float,
) -> tuple[Misnaming, float] | None:
    """Under which other names a board's corners lie where the photo's other boards put them."""
    board = target.boards[own.board[0]]
    c, r = own.column.astype(float), own.row.astype(float)
    last_c, last_r = board.columns - 1, board.rows - 1
    tried: list[tuple[Misnaming, Board, FloatArray, FloatArray]] = [
        (_stepped(step), board, c + step[0], r + step[1]) for step in _steps()
    ]
    tried += [
        (_OPPOSITE, board, last_c - c, last_r - r),
        (_COLUMNS, board, last_c - c, r),
        (_ROWS, board, c, last_r - r),
        (_EXCHANGED, board, r, c),
        (_QUARTER, board, last_r - r, c),
        (_QUARTER, board, r, last_c - c),
    ]
    tried += [
        (_of_other(other.name), other, c, r)
        for other in target.boards
        if other is not board and other.points is None
    ]
    best: tuple[Misnaming, float] | None = None
    for misnaming, on, column, row in tried:
        camera_points = _plane(on, column, row) / scale @ rotation.T + translation
        miss = camera.project(camera_points) - own.pixel
        length = np.hypot(miss[:, 0], miss[:, 1])
        error = float(np.median(np.where(np.isfinite(length), length, np.inf)))
        if error < _NEAR * 2 * noise and (best is None or error < 0.5 * best[1]):
            best = (misnaming, error)
    return best


def _all_boards(
    camera: RadialCamera, pairs: Correspondences, target: Target, scale: float, noise: float
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
            world[here] = _plane(target.boards[board], c, r) / scale
        fit, placed, _ = fit_poses(camera, replace(pairs, world=world))
        if fit is None or len(placed.pixel) < len(pairs.pixel):
            continue
        if noise_px(fit.residual) < _NEAR * noise:
            return BoardFault(
                photo=pairs.images[0],
                board=None,
                misnaming=_stepped(step),
                error_px=noise_px(fit.residual),
            )
    return None
