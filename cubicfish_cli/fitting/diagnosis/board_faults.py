"""Boards whose corners do not fit in one photo: counted from elsewhere, or misnamed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.diagnosis.finding import Finding
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.fitting.subset import select
from cubicfish_cli.model.radial import RadialCamera
from cubicfish_cli.target import Board, Target

FloatArray = npt.NDArray[np.float64]

# Other ways of counting that are tried: so many lines on, and every order of both axes.
_MOST_STEPS = 3
_FEWEST_CORNERS = 8
# A corner under its right name is within this many standard deviations.
_NEAR = 6.0
# A board that moved is as sharp as the others: this many times as noisy, photos are blurred.
_CLEAN = 3.0


def board_fault(
    camera: RadialCamera, pairs: Correspondences, target: Target, scale: float, noise: float
) -> Finding | None:
    """Why one photo does not fit, if one of its boards is to blame.

    Args:
        camera: the lens of the photos that fit.
        pairs: pairs of one photo, divided by ``scale``.
        target: the object.
        scale: the target's units in one unit of the pairs.
        noise: standard deviation of a corner's coordinate in photos that fit, pixels.

    """
    boards, counts = np.unique(pairs.board, return_counts=True)
    for board in boards[np.argsort(counts, kind="stable")]:
        others, _ = select(pairs, pairs.board != board)
        own, _ = select(pairs, pairs.board == board)
        if min(len(others.pixel), len(own.pixel)) < _FEWEST_CORNERS:
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
        photo = pairs.images[0]
        if found is None:
            # Corners that are no clean board by themselves are blurred, and say nothing of a place.
            alone, _, _ = fit_poses(camera, own)
            if (
                alone is None
                or noise_px(np.vstack([fit.residual, alone.residual])) > _CLEAN * noise
            ):
                continue
            return Finding(
                cause="board_place",
                level="note",
                what=f"{photo}: board {meant.name} is not where it is in the other photos: it "
                "moved, or its corners are named wrongly",
                evidence="without it the photo fits",
                do="look at this photo with 'cubicfish detect --draw', or leave it out",
                images=(photo,),
                boards=(meant.name,),
            )
        return Finding(
            cause="corner_names",
            level="note",
            what=f"{photo}: corners of board {meant.name} are named wrongly: {found[0]}",
            evidence=f"with that they are within {found[1]:.2f} px of where the rest puts them",
            do="correct these rows of corners.csv, or leave the photo out",
            images=(photo,),
            boards=(meant.name,),
        )
    return _all_boards(camera, pairs, target, scale, noise)


def _plane(board: Board, column: FloatArray, row: FloatArray) -> FloatArray:
    plane = board.plane_points(column, row)
    return np.asarray(board.origin + plane[:, :1] * board.x_axis + plane[:, 1:] * board.y_axis)


def _steps() -> list[tuple[int, int]]:
    reach = range(-_MOST_STEPS, _MOST_STEPS + 1)
    steps = [(x, y) for x in reach for y in reach if (x, y) != (0, 0)]
    return sorted(steps, key=lambda step: abs(step[0]) + abs(step[1]))


def _step_words(step: tuple[int, int]) -> str:
    parts = [
        f"{abs(count)} {line}{'s' * (abs(count) > 1)} too {'far' if count < 0 else 'near'}"
        for count, line in zip(step, ("column", "row"), strict=True)
        if count
    ]
    return " and ".join(parts)


def _meant(
    camera: RadialCamera,
    rotation: FloatArray,
    translation: FloatArray,
    own: Correspondences,
    target: Target,
    scale: float,
    noise: float,
) -> tuple[str, float] | None:
    """Under which other names a board's corners lie where the photo's other boards put them."""
    board = target.boards[own.board[0]]
    c, r = own.column.astype(float), own.row.astype(float)
    last_c, last_r = board.columns - 1, board.rows - 1
    tried: list[tuple[str, Board, FloatArray, FloatArray]] = [
        (_step_words(step), board, c + step[0], r + step[1]) for step in _steps()
    ]
    tried += [
        ("counted from the opposite corner", board, last_c - c, last_r - r),
        ("columns counted backwards", board, last_c - c, r),
        ("rows counted backwards", board, c, last_r - r),
        ("rows and columns exchanged", board, r, c),
        ("a quarter turn round", board, last_r - r, c),
        ("a quarter turn round", board, r, last_c - c),
    ]
    tried += [
        (f"they are of board {other.name}", other, c, r)
        for other in target.boards
        if other is not board and other.points is None
    ]
    best: tuple[str, float] | None = None
    for words, on, column, row in tried:
        camera_points = _plane(on, column, row) / scale @ rotation.T + translation
        miss = camera.project(camera_points) - own.pixel
        length = np.hypot(miss[:, 0], miss[:, 1])
        error = float(np.median(np.where(np.isfinite(length), length, np.inf)))
        if error < _NEAR * 2 * noise and (best is None or error < 0.5 * best[1]):
            best = (words, error)
    return best


def _all_boards(
    camera: RadialCamera, pairs: Correspondences, target: Target, scale: float, noise: float
) -> Finding | None:
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
            photo = pairs.images[0]
            return Finding(
                cause="corner_names",
                level="note",
                what=f"{photo}: corners of all boards are named {_step_words(step)}",
                evidence=f"with that the photo fits to {noise_px(fit.residual):.2f} px",
                do="correct these rows of corners.csv, or leave the photo out",
                images=(photo,),
            )
    return None
