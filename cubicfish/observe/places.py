"""Where the boards are of which target.yaml says ``place: unknown``.

Every board in every photo is taken as a flat thing of its own, which gives a lens and a pose for
each (`measured_object`). Photos that show two boards say how these lie to each other; all photos
together then adjust lens, poses and the unknown places.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from cubicfish.diagnosis.wrong_nominal import measured_object, split_into_boards
from cubicfish.errors import FitError
from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.identified import Identified
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.geometry import similarity
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.deformable_target import NominalTarget
from cubicfish.solve.statistics import huber_px, noise_px
from cubicfish.solve.subset import middle, world_scale
from cubicfish.target.boards.board import Board
from cubicfish.target.observations import Observations
from cubicfish.target.placement import TURNS
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray, IntArray

# What boards may move by in the adjustment, as shares of their size: known ones not at all.
_FREE, _FIXED = 1.0, 1e-9


def with_places(pairs: Observations, target: Target) -> Target:
    """The target with the places of all boards that photos show beside boards of known places.

    Args:
        pairs: named corners of boards of the target.
        target: some of its boards are of unknown places.

    """
    certain = pairs.select(pairs.certain).with_target(target)
    try:
        pairs = _turned_alike(certain, target)
        measured = measured_object(pairs, target)
        known = [index for index in measured if not target.boards[index].unplaced]
        found = [index for index in measured if target.boards[index].unplaced]
        if not known or not found:
            return target
        nominal = [board.world_points(*board.places()) for board in target.boards]
        to_world = similarity(
            np.concatenate([measured[index] for index in known]),
            np.concatenate([nominal[index] for index in known]),
        )
        boards = {
            index: _laid_on(target.boards[index], to_world(measured[index])) for index in found
        }
        placed = target.with_boards(boards)
        return _adjusted(pairs, placed, {board.name for board in boards.values()})
    except FitError:
        return target


def _laid_on(board: Board, points: FloatArray) -> Board:
    """A board where its corners (N, 3), row by row, were measured in the world."""
    plane = board.plane_points(*board.places())
    move = similarity(np.column_stack([plane, np.zeros(len(plane))]), points, scaled=False)
    x_axis, y_axis, _ = move.rotation.T
    return replace(board, origin=move.shift, x_axis=x_axis, y_axis=y_axis, unplaced=False)


def _turned_alike(pairs: Observations, target: Target) -> Observations:
    """The corners of boards that look alike when turned, counted from the same end in all photos.

    Which end that is says the photo with most corners; a board's first corner is a convention
    where nobody knows its place.
    """
    views = split_into_boards(pairs, target)
    if views is None:
        return pairs
    lens = fit_radial(views)
    names = [tuple(map(int, name.split(":"))) for name in lens.pairs.images]
    rotation = dict(zip(names, lens.poses.rotation, strict=True))
    counts = Counter(board for _, board in names)
    upright = [index for index in counts if len(_list_turns(target.boards[index])) == 1]
    if not upright:
        return pairs
    beside = max(upright, key=lambda index: counts[index])
    column, row = pairs.column.copy(), pairs.row.copy()
    for index in counts.keys() - upright:
        board, first = target.boards[index], None
        last = np.array([board.columns - 1, board.rows - 1])
        photos = [photo for photo, own in names if own == index and (photo, beside) in rotation]
        size = np.bincount(pairs.image[pairs.board == index], minlength=len(pairs.images))
        for photo in sorted(photos, key=lambda one: -size[one]):
            turn = rotation[photo, beside].T @ rotation[photo, index]
            first = turn if first is None else first
            plane = max(
                _list_turns(board),
                key=lambda one: np.trace(first[:, :2].T @ turn[:, :2] @ one),
            )
            own = (pairs.board == index) & (pairs.image == photo)
            cells = np.stack([column[own], row[own]], axis=-1)
            column[own], row[own] = ((2 * cells - last) @ plane + last).T // 2
    return replace(pairs, column=column, row=row)


def _list_turns(board: Board) -> list[IntArray]:
    """The turns (2, 2) that carry a plain board's squares onto squares of the same colour."""
    columns, rows = board.columns, board.rows
    if board.markers is not None or not board.has_squares or columns % 2 != rows % 2:
        return [TURNS[0]]
    return [*TURNS] if columns == rows and columns % 2 == 0 else [TURNS[0], TURNS[2]]


def _adjusted(pairs: Observations, target: Target, free: Collection[str]) -> Target:
    """The target with the places of some boards adjusted, along with lens and poses."""
    # The first board stays where it is.
    boards = sorted(target.boards, key=lambda board: board.name in free)
    origin = middle(pairs.with_target(target))
    near = replace(target, boards=tuple(boards)).moved(-origin)
    own = pairs.with_target(near)
    scale = world_scale(own)
    reference = fit_radial(own.with_world(own.world / scale))
    nominal = NominalTarget(target=near, pairs=reference.pairs, scale=scale)
    world = nominal.free(noise=noise_px(reference.residual))
    spread = np.full_like(world.spread, _FIXED)
    for part in world.parts:
        if near.boards[part.board].name in free:
            spread[part.place] = _FREE
    adjusted = adjust(
        reference.lens,
        reference.poses,
        reference.pairs,
        huber_px(reference.residual),
        world=replace(world, spread=spread),
    )
    refined = nominal.refined(adjusted.world)
    if refined is None:
        return target
    found = {board.name: board for board in refined.moved(origin).boards}
    changed = {}
    for index, board in enumerate(target.boards):
        now = found[board.name]
        if board.name in free:
            changed[index] = replace(board, origin=now.origin, x_axis=now.x_axis, y_axis=now.y_axis)
    return target.with_boards(changed)


@one_blas_thread()
def placed_by_grids(
    grids: Sequence[Sequence[Grid]],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Target:
    """As :func:`with_places`, by grids that nobody has named: the arguments of ``name_grids``.

    Grids are named one by one at first. What is left over where the placed boards have been named
    is then of the other boards, and so on.
    """
    alone = [(photo, grid) for photo, own in enumerate(grids) for grid in own]
    pairs = _named_alone(alone, target, image_size, images)
    while True:
        before, target = target.unplaced, with_places(pairs, target)
        if target.unplaced in ((), before):
            return target
        known, others = (
            replace(target, boards=tuple(one for one in target.boards if one.unplaced is unplaced))
            for unplaced in (False, True)
        )
        together = name_grids(grids, known, image_size, images)
        rest = _named_alone(_left_over(together), others, image_size, images)
        parts = [one.with_target(target) for one in (together.corners, rest)]
        pairs = Observations.stacked(parts).by_photo()


def _left_over(identified: Identified) -> list[tuple[int, Grid]]:
    return [
        (photo, grid)
        for photo, (own, reports) in enumerate(zip(identified.found, identified.grids, strict=True))
        for grid, report in zip(own, reports, strict=True)
        if not report.named
    ]


def _named_alone(
    grids: Sequence[tuple[int, Grid]],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Observations:
    """Corners that each grid has by itself; a board that two of a photo would be has none there."""
    photo = np.array([one for one, _ in grids], np.intp)
    views = [[grid] for _, grid in grids]
    found = name_grids(views, target, image_size, [str(view) for view in range(len(grids))]).corners
    corners = replace(found, images=tuple(images), image=photo[found.image])
    view = np.stack([corners.image, corners.board, found.image])
    seen = Counter(tuple(one) for one in np.unique(view, axis=1)[:2].T.tolist())
    once = [seen[one] == 1 for one in zip(*view[:2].tolist(), strict=True)]
    return corners.select(np.array(once, bool))


def told_of_places(before: Target, target: Target, seen: Collection[str]) -> list[Finding]:
    """Say which of the boards that photos show have been placed, and which have not.

    Args:
        before: the target as given.
        target: the target with the places that were found.
        seen: names of the boards that photos show.

    """
    found = [name for name in before.unplaced if name not in target.unplaced]
    lost = [name for name in target.unplaced if name in seen]
    return [
        Finding(code=Code.BOARD_PLACE, case=case, severity=severity, boards=tuple(names))
        for case, severity, names in (
            ("found", Severity.NOTE, found),
            ("not_found", Severity.CARE, lost),
        )
        if names
    ]
