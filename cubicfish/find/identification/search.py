"""All labelings of one photo's grids that could be, best first, with the lens known.

A hypothesis gives some of the grids a place on the target. Every grid has a pose of its own
(from its squares alone, which needs no name), so a place for one grid puts the whole target in
front of the camera and says within a square or two where every other grid must lie: pairs of
grids are enumerated in this way, then grown by the remaining grids, keeping the best.

To first order the reprojection error of a point X (camera frame) seen along the unit ray d is
J X / |X|, with J = d pixel / d ray, since J d = 0. With the distance taken from the grid's own
pose, the sum of its squares over a grid is a quadratic form in the 3x3 matrix H that takes
(i, j, 1) to the camera frame: vec(H)ᵀ M vec(H). M is computed once per grid, so that a
hypothesis costs a few small matrix products however many corners the grid has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cubicfish.find.detection.grids import Rows
from cubicfish.find.detection.lattice import window
from cubicfish.find.identification.allowed_offsets import AllowedOffsets
from cubicfish.geometry import nearest_rotation
from cubicfish.models.radial import RadialCamera, project_jacobian
from cubicfish.solve.poses import rotation_from_vector
from cubicfish.target.placement import Placement
from cubicfish.types import BoolArray, FloatArray, IntArray

# How far a grid's own orientation may be off: a few corners with noise give no better.
_MAX_TILT_DEG = 25.0
# How far, in squares, a grid may lie from where another grid's pose puts it.
_PAIR_WINDOW, _GROW_WINDOW = 2, 1
_MAX_OFF_PLANE = 2.5
# Hypotheses that are scored at all, and those that are kept and refined.
_MAX_PAIRS = 20_000
_BEAM = 200
# Pairs of grids to start from: a false grid must not be part of all of them.
_START_GRIDS = 4


def grid_moments(
    lens: RadialCamera, cells: IntArray, pixel: FloatArray, camera_from_grid: FloatArray
) -> FloatArray:
    """M (9, 9) of a grid, in px² for H in squares; index = 3 · camera axis + grid axis.

    Args:
        lens: the lens.
        cells: (N, 2) i, j.
        pixel: (N, 2).
        camera_from_grid: (3, 3) the grid's own pose: (i, j, 1) to the camera frame, in squares.

    """
    rays = lens.unproject(pixel)
    seen = np.isfinite(rays).all(axis=-1)
    rays = rays[seen]
    grid = np.column_stack([cells[seen], np.ones(len(rays))])
    distance = np.linalg.norm(grid @ camera_from_grid.T, axis=-1)
    slope = project_jacobian(lens.parameters, rays)[1] / distance[:, None, None]
    rows = (slope[:, :, :, None] * grid[:, None, None, :]).reshape(-1, 9)
    return rows.T @ rows


def form_cost(moments: FloatArray, form: FloatArray) -> FloatArray:
    """Squared error, px²: M (9, 9) and H (..., 3, 3), in squares -> (...,)."""
    flat = form.reshape(*form.shape[:-2], 9)
    return np.einsum("...i,...i->...", flat @ moments, flat)


def normal_equations(
    moments: FloatArray, form: FloatArray, pivot: FloatArray, square: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cost, half its gradient and its Gauss-Newton Hessian by small moves of the target.

    Args:
        moments: (9, 9) M of a grid.
        form: (K, 3, 3) H in world units.
        pivot: (K, 3) the point of the camera frame that rotations leave in place.
        square: (K,) the board's square, world units.

    Returns:
        (K,), (K, 6), (K, 6, 6); a move is a rotation vector about the pivot, then a shift.

    """
    arm = form.copy()
    arm[:, :, 2] -= pivot
    jacobian = np.zeros((len(form), 6, 3, 3))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = -arm[:, 2], arm[:, 1]
    jacobian[:, 1, 0], jacobian[:, 1, 2] = arm[:, 2], -arm[:, 0]
    jacobian[:, 2, 0], jacobian[:, 2, 1] = -arm[:, 1], arm[:, 0]
    for axis in range(3):
        jacobian[:, 3 + axis, axis, 2] = 1
    flat = jacobian.reshape(-1, 6, 9) / square[:, None, None]
    value = form.reshape(-1, 9) / square[:, None]
    weighted = (flat.reshape(-1, 9) @ moments).reshape(-1, 6, 9)
    cost = np.einsum("ki,ki->k", value @ moments, value)
    return cost, np.einsum("kmi,ki->km", weighted, value), weighted @ np.swapaxes(flat, 1, 2)


def gauss_newton(gradient: FloatArray, hessian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps (K, 6) and the decrease of the cost that each promises (K,)."""
    scale = np.sqrt(np.maximum(np.diagonal(hessian, axis1=1, axis2=2), 1e-300))
    scaled = hessian / (scale[:, :, None] * scale[:, None, :]) + 1e-9 * np.eye(6)
    step = -np.linalg.solve(scaled, (gradient / scale)[:, :, None])[:, :, 0] / scale
    return step, -np.einsum("km,km->k", step, gradient)


def moved(
    rotation: FloatArray, translation: FloatArray, pivot: FloatArray, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (K, 3, 3) and (K, 3) after steps (K, 6) about their pivots (K, 3)."""
    turn = rotation_from_vector(step[:, :3])
    arm = (turn @ (translation - pivot)[:, :, None])[:, :, 0]
    return turn @ rotation, arm + pivot + step[:, 3:]


@dataclass(frozen=True, kw_only=True, eq=False)
class GridView:
    """One grid of a photo as the known lens sees it.

    Attributes:
        allowed: its places on the target.
        middle: (3,) mean cell as (i, j, 1).
        rotation: (C, 3, 3) camera_from_grid, best first; two where the lens cannot tell.
        camera_middle: (C, 3) the mean cell in the camera frame, squares.
        moments: (9, 9), see :mod:`cubicfish.find.identification.search`.
        corners: how many corners it has.
        gate_px: RMS from which it does not fit a place.

    """

    allowed: AllowedOffsets
    middle: FloatArray
    rotation: FloatArray
    camera_middle: FloatArray
    moments: FloatArray
    corners: int
    gate_px: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Labelings(Rows):
    """Hypotheses for the G grids of one photo, best first.

    Attributes:
        side: (K, G) the side of each grid's place, -1 where the grid is left out.
        offset: (K, G, 2).
        rotation, translation: (K, 3, 3), (K, 3) camera_from_world.
        pivot: (K, 3) a point of the target in the camera frame.
        grid_cost: (K, G) each grid's summed squared error, px²; a grid left out costs its gate.

    """

    side: IntArray
    offset: IntArray
    rotation: FloatArray
    translation: FloatArray
    pivot: FloatArray
    grid_cost: FloatArray

    def __len__(self) -> int:
        return len(self.side)

    def __getitem__(self, rows: IntArray | BoolArray | slice) -> Labelings:
        return self.select(rows)

    @property
    def cost(self) -> FloatArray:
        """(K,) summed squared error, px²."""
        return self.grid_cost.sum(axis=1)


def search(views: Sequence[GridView], sides: Placement) -> Labelings:
    """Labelings of one photo with at least two grids named, best first.

    Args:
        views: the photo's grids, largest first.
        sides: the target's boards.

    Returns:
        At most a few hundred different labelings; none when no two grids go together.

    """
    found: list[Labelings] = []
    for first, second in combinations(range(min(len(views), _START_GRIDS)), 2):
        beam = _place_alone(views, first, sides)
        for grid in (second, *(n for n in range(len(views)) if n not in (first, second))):
            if len(beam):
                beam = _grow_labelings(beam, views, grid, sides)
        if not len(beam):
            continue
        beam = refined(beam, views, sides, rounds=3)
        found.append(beam)
        best = beam.grid_cost[0]
        if (beam.side[0] >= 0).all() and all(
            cost < view.corners * view.gate_px**2 for cost, view in zip(best, views, strict=True)
        ):
            break
    if not found:
        return _place_alone(views, 0, sides)[:0]
    return _keep_distinct(Labelings.joined(found))[:_BEAM]


def refined(
    beam: Labelings, views: Sequence[GridView], sides: Placement, *, rounds: int
) -> Labelings:
    """The same labelings with their poses fitted, sorted by cost."""
    for _ in range(rounds):
        gradient, hessian, cost = _make_system(beam, views, sides)
        step, _ = gauss_newton(gradient, hessian)
        rotation, translation = moved(beam.rotation, beam.translation, beam.pivot, step)
        trial = replace(beam, rotation=rotation, translation=translation)
        trial = replace(trial, grid_cost=_compute_grid_cost(trial, views, sides))
        better = (trial.cost < cost)[:, None]
        beam = replace(
            beam,
            rotation=np.where(better[:, :, None], trial.rotation, beam.rotation),
            translation=np.where(better, trial.translation, beam.translation),
        )
    beam = replace(beam, grid_cost=_compute_grid_cost(beam, views, sides))
    return beam[np.argsort(beam.cost, kind="stable")]


def _make_forms(beam: Labelings, rows: IntArray, grid: int, sides: Placement) -> FloatArray:
    """(i, j, 1) to the camera frame, world units: (len(rows), 3, 3)."""
    form: FloatArray = beam.rotation[rows] @ sides.world_from_grid(
        beam.side[rows, grid], beam.offset[rows, grid]
    )
    form[:, :, 2] += beam.translation[rows]
    return form


def _compute_grid_cost(beam: Labelings, views: Sequence[GridView], sides: Placement) -> FloatArray:
    cost = np.empty((len(beam), len(views)))
    for grid, view in enumerate(views):
        cost[:, grid] = view.corners * view.gate_px**2
        rows = np.flatnonzero(beam.side[:, grid] >= 0)
        form = _make_forms(beam, rows, grid, sides)
        square = sides.square[beam.side[rows, grid]]
        cost[rows, grid] = form_cost(view.moments, form / square[:, None, None])
    return cost


def _make_system(
    beam: Labelings, views: Sequence[GridView], sides: Placement
) -> tuple[FloatArray, FloatArray, FloatArray]:
    gradient = np.zeros((len(beam), 6))
    hessian = np.zeros((len(beam), 6, 6))
    cost = np.zeros(len(beam))
    for grid, view in enumerate(views):
        rows = np.flatnonzero(beam.side[:, grid] >= 0)
        form = _make_forms(beam, rows, grid, sides)
        own, own_gradient, own_hessian = normal_equations(
            view.moments, form, beam.pivot[rows], sides.square[beam.side[rows, grid]]
        )
        gradient[rows] += own_gradient
        hessian[rows] += own_hessian
        cost += view.corners * view.gate_px**2
        cost[rows] += own - view.corners * view.gate_px**2
    return gradient, hessian, cost


def _choose_promising(
    beam: Labelings, views: Sequence[GridView], sides: Placement, keep: int
) -> Labelings:
    """The ``keep`` labelings that promise the lowest cost after one step, that step taken."""
    gradient, hessian, cost = _make_system(beam, views, sides)
    step, decrease = gauss_newton(gradient, hessian)
    rows = np.argsort(cost - decrease, kind="stable")[:keep]
    beam, step = beam[rows], step[rows]
    rotation, translation = moved(beam.rotation, beam.translation, beam.pivot, step)
    return replace(beam, rotation=rotation, translation=translation)


def _place_alone(views: Sequence[GridView], grid: int, sides: Placement) -> Labelings:
    """Labelings of one grid by all its places, under each of its own poses; the rest left out."""
    view = views[grid]
    place_side, place_offset = view.allowed.places()
    pose = np.repeat(np.arange(len(view.rotation)), len(place_side))
    side = np.full((len(pose), len(views)), -1, np.intp)
    offset = np.zeros((len(pose), len(views), 2), np.intp)
    side[:, grid] = np.tile(place_side, len(view.rotation))
    offset[:, grid] = np.tile(place_offset, (len(view.rotation), 1))
    # camera_from_world, as the grid alone would have it
    rotation = view.rotation[pose] @ np.swapaxes(sides.frame[side[:, grid]], 1, 2)
    middle = sides.square[side[:, grid]][:, None] * view.camera_middle[pose]
    world = sides.world_from_grid(side[:, grid], offset[:, grid]) @ view.middle
    return Labelings(
        side=side,
        offset=offset,
        rotation=rotation,
        translation=middle - (rotation @ world[:, :, None])[:, :, 0],
        pivot=middle,
        grid_cost=np.zeros(side.shape),
    )


def _grow_labelings(
    beam: Labelings, views: Sequence[GridView], grid: int, sides: Placement
) -> Labelings:
    """The labelings with one more grid named, and as they were where they name two."""
    view, named = views[grid], beam.side >= 0
    alone = len(beam) > 0 and int(named[0].sum()) == 1
    parts, share = [] if alone else [beam], 1.0
    if alone:
        corners = sum(one.corners for one, own in zip(views, named[0], strict=True) if own)
        share = corners / (corners + view.corners)
    for number in range(len(view.rotation)):
        own = view.rotation[number] @ np.swapaxes(sides.frame, 1, 2)
        agree = _find_within(beam.rotation, own, _MAX_TILT_DEG)
        agree &= (view.allowed.high >= view.allowed.low).all(axis=1)
        row, side = np.nonzero(agree)
        more, middle = beam[row], sides.square[side][:, None] * view.camera_middle[number]
        if alone:  # neither grid knows better than the other how the camera is turned
            turned = nearest_rotation(share * more.rotation + (1 - share) * own[side])
            pivot = _rotate_back(more.rotation, more.pivot - more.translation)
            shift = more.pivot - (turned @ pivot[:, :, None])[:, :, 0]
            more = replace(more, rotation=turned, translation=shift)
        world = _rotate_back(more.rotation, middle - more.translation)
        farthest = _PAIR_WINDOW if alone else _GROW_WINDOW
        pick, offset, misfit = _list_offsets_near(world, side, view, sides, farthest)
        if len(pick) > _MAX_PAIRS:
            nearest = np.sort(np.argpartition(misfit, _MAX_PAIRS)[:_MAX_PAIRS])
            pick, offset = pick[nearest], offset[nearest]
        more = more[pick]
        more.side[:, grid] = side[pick]
        more.offset[:, grid] = offset
        parts.append(_choose_promising(more, views, sides, 2 * _BEAM))
    return _keep_distinct(refined(Labelings.joined(parts), views, sides, rounds=2))[:_BEAM]


def _list_offsets_near(
    world: FloatArray, side: IntArray, view: GridView, sides: Placement, farthest: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Whole offsets near where a grid's middle was predicted.

    Args:
        world: (K, 3) predicted world position of the grid's middle.
        side: (K,) the side it is tried on.
        view: the grid.
        sides: the target's boards.
        farthest: largest distance from the prediction, squares.

    Returns:
        Indices into the K predictions (Q,), offsets (Q, 2), squared misfits in squares (Q,).

    """
    arm = (world - sides.origin[side]) / sides.square[side][:, None]
    above = np.einsum("ki,ki->k", sides.frame[side][:, :, 2], arm)
    cell = np.einsum("kij,ki->kj", sides.axes[side], arm)
    wanted = cell - sides.matrix[side] @ view.middle[:2]
    shift = window(farthest)
    near = np.flatnonzero(
        (np.abs(above) < _MAX_OFF_PLANE)
        & (wanted > view.allowed.low[side] - farthest - 1).all(axis=1)
        & (wanted < view.allowed.high[side] + farthest + 1).all(axis=1)
    )
    offset = (np.rint(wanted[near]).astype(np.intp)[:, None] + shift).reshape(-1, 2)
    pick = np.repeat(near, len(shift))
    fits = view.allowed.allows(side[pick], offset)
    pick, offset = pick[fits], offset[fits]
    misfit = np.square(offset - wanted[pick]).sum(axis=1) + np.square(above[pick])
    return pick, offset, misfit


def _rotate_back(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    return np.einsum("kji,kj->ki", rotation, vector)


def _find_within(first: FloatArray, second: FloatArray, degrees: float) -> BoolArray:
    """Rotations (A, 3, 3) and (B, 3, 3) -> (A, B) whether they differ by at most ``degrees``."""
    trace = first.reshape(-1, 9) @ second.reshape(-1, 9).T
    return trace >= 1 + 2 * np.cos(np.deg2rad(degrees))


def _keep_distinct(beam: Labelings) -> Labelings:
    """One of each labeling, the one with the lowest cost, sorted by cost."""
    beam = beam[np.argsort(beam.cost, kind="stable")]
    named = beam.side >= 0
    keys = np.concatenate([beam.side, np.where(named, beam.offset[..., 0], 0),
                           np.where(named, beam.offset[..., 1], 0)], axis=1)  # fmt: skip
    _, first = np.unique(keys, axis=0, return_index=True)
    return beam[np.sort(first)]
