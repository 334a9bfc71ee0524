"""The target in least squares: a nominal one, or a deformable one.

Boards of a deformable target bend, twist, stretch and lie a little off their places, and corners
lie a little off theirs. No print is exactly nominal, and the deviations of a target repeat in
every photo, which distinguishes them from noise. The overall scale cannot be seen and stays
nominal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from cubicfish.judge.fit_record import Departure
from cubicfish.solve.normal_equations import gram
from cubicfish.solve.poses import cross, rotation_from_vector
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.observations import Observations
from cubicfish.target.placement import Symmetry
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

# What a board may deviate by: one standard deviation of the prior, relative to the board's half
# diagonal (for turns, radians). Prints stretch and walls bend by some thousandths.
_SHAPE_SPREAD = 0.01
_PLACE_SPREAD = 0.02
# What boards usually deviate by.
_USUAL_SPREAD = 0.003
_SHAPE_TERMS = 5  # bend x, bend y, twist, stretch x, stretch y
_STRETCH = 3  # index of the first of them that stretches
_SHAPE_SPREADS = [_SHAPE_SPREAD] * _STRETCH + [_USUAL_SPREAD] * (_SHAPE_TERMS - _STRETCH)
_STRETCHED = 1  # index of stretches among the kinds of parameters
# The mean stretch of all boards is kept this close to zero: no photo shows the overall scale.
_SCALE_SPREAD = 1e-6
_PLACE_TERMS = 6  # rotation vector, shift
TargetModel = Literal["off", "shape", "points"]
TARGET_MODELS: tuple[TargetModel, ...] = ("off", "shape", "points")
"""How much of the target is free: nothing, its boards, or each corner as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardPart:
    """One board's pairs, and where its parameters stand among all.

    Attributes:
        board: index of the board in the target.
        pairs: indices of its pairs.
        cell: (n,) the board's corner that each pair shows, counted row by row.
        basis: (C, 3, F) world displacement of each of the board's corners by each shape parameter;
            F is 5, or 0 for a board that is a list of points.
        shape: the places of the F shape parameters.
        place: the places of the 6 of rotation and shift; empty for the board that stays in place.
        middle: (3,) the point about which the board turns.
        size: half diagonal, in the world's units.

    """

    board: int
    pairs: IntArray
    cell: IntArray
    basis: FloatArray
    shape: slice
    place: slice
    middle: FloatArray
    size: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DeformableTarget:
    """A target whose world points follow the boards' shapes and places, and corners' own offsets.

    Attributes:
        nominal: (N, 3) nominal world point of each pair.
        parts: the boards that were seen; none for a target that stays nominal.
        parameters: (S,) relative to each board's half diagonal; zero is the nominal target.
        spread: (S,) standard deviation of each parameter's pull to zero.
        noise: standard deviation of a corner's coordinate, pixels: a deviation of one spread costs
            this.
        corner: (N,) the free corner that each pair shows; empty when corners have no offsets.
        offsets: (Q, 3) world offset of each free corner; Q is 0 when corners have none.
        offset_spread: standard deviation of the pull of offsets to zero.

    """

    nominal: FloatArray
    parts: tuple[BoardPart, ...] = ()
    parameters: FloatArray = field(default_factory=lambda: np.zeros(0))
    spread: FloatArray = field(default_factory=lambda: np.zeros(0))
    noise: float = 1.0
    corner: IntArray = field(default_factory=lambda: np.zeros(0, np.intp))
    offsets: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    offset_spread: float = np.inf

    @property
    def offset_weight(self) -> float:
        """Pixels that an offset of one unit counts as."""
        return self.noise / self.offset_spread

    @property
    def free(self) -> bool:
        """Whether the target may depart from the nominal one."""
        return bool(self.parts)

    @cached_property
    def kinds(self) -> IntArray:
        """(S,) the kind of each parameter: bends and twists, stretches, places."""
        kinds = np.zeros(len(self.parameters), np.intp)
        for part in self.parts:
            kinds[part.shape.start + _STRETCH : part.shape.stop] = _STRETCHED
            kinds[part.place] = 2
        return kinds

    def with_spreads(self, variance: FloatArray) -> DeformableTarget:
        """The same target, with the prior of each kind of parameter estimated from the parameters.

        Expectation and maximisation: the variance of a kind is the mean of the squared estimates
        and of the variances that are left open. Few boards say little about it, so it is drawn to
        what is usual of prints. Stretches keep their prior: prints are known to keep their
        proportions, and if a board is always held upright, no photo shows whether it or the pixels
        are not square.

        Args:
            variance: (S,) variance of each parameter that the pairs leave open.

        """
        spread = self.spread.copy()
        for kind in np.setdiff1d(self.kinds, [_STRETCHED]):
            own = self.kinds == kind
            found = np.sum(self.parameters[own] ** 2 + variance[own])
            spread[own] = np.sqrt((found + _USUAL_SPREAD**2) / (own.sum() + 1))
        return replace(self, spread=spread)

    def select(self, rows: IntArray) -> DeformableTarget:
        """The same target for the pairs of some rows (n,); what is free stays as it is."""
        parts = []
        for part in self.parts:
            place = np.full(len(self.nominal), -1, np.intp)
            place[part.pairs] = np.arange(len(part.pairs))
            own = np.flatnonzero(place[rows] >= 0)
            parts.append(replace(part, pairs=own, cell=part.cell[place[rows[own]]]))
        return replace(
            self,
            nominal=self.nominal[rows],
            parts=tuple(parts),
            corner=self.corner[rows] if len(self.corner) else self.corner,
        )

    def started(self, other: DeformableTarget) -> DeformableTarget:
        """The same free parameters, started with boards' shapes and places in another target."""
        parameters, spread = self.parameters.copy(), self.spread.copy()
        theirs = {part.board: part for part in other.parts}
        for part in self.parts:
            known = theirs.get(part.board, part)
            for own, other_own in ((part.shape, known.shape), (part.place, known.place)):
                # The board that stays in place may be another one.
                if known is not part and own.stop - own.start == other_own.stop - other_own.start:
                    parameters[own] = other.parameters[other_own]
                    spread[own] = other.spread[other_own]
        return replace(self, parameters=parameters, spread=spread)

    @cached_property
    def points(self) -> FloatArray:
        """(N, 3) world point of each pair."""
        if not self.free:
            return self.nominal
        points = self.nominal.copy()
        if len(self.corner):
            points += self.offsets[self.corner]
        for part in self.parts:
            own = points[part.pairs] + (part.basis @ self.parameters[part.shape])[part.cell]
            place = self.parameters[part.place]
            if len(place):
                rotation = rotation_from_vector(place[:3])
                own = part.middle + (own - part.middle) @ rotation.T + place[3:] * part.size
            points[part.pairs] = own
        return points

    def moved(self, parameters: FloatArray, offsets: FloatArray) -> DeformableTarget:
        """The same target after steps (S,) and (Q, 3)."""
        return replace(
            self, parameters=self.parameters + parameters, offsets=self.offsets + offsets
        )

    def chain(self, d_world: FloatArray, run: slice) -> FloatArray:
        """Convert d pixel / d world point (n, 2, 3) to d pixel / d parameters (n, 2, S).

        The n pairs are those of ``run``. Turns of a board are small (some hundredths of a radian at
        most): the derivatives of its shape and of its corners' offsets leave the turn out.
        """
        chained = np.zeros((len(d_world), 2, len(self.parameters)))
        d_world = np.ascontiguousarray(d_world)
        for part in self.parts:
            first, stop = np.searchsorted(part.pairs, [run.start, run.stop])
            pairs = part.pairs[first:stop]
            own, shape = d_world[pairs - run.start], part.basis.shape[2]
            columns = np.empty((len(pairs), 2, part.place.stop - part.shape.start))
            basis = part.basis[part.cell[first:stop]]
            columns[:, :, :shape] = np.einsum("nai,nis->nas", own, basis)
            place = self.parameters[part.place]
            if len(place):
                arm = self.points[pairs] - part.middle - place[3:] * part.size
                turned = cross(arm.T, own.transpose(1, 2, 0))
                columns[:, :, shape:-3] = turned.transpose(2, 0, 1)
                columns[:, :, -3:] = own * part.size
            chained[pairs - run.start, :, part.shape.start : part.place.stop] = columns
        return chained

    def pulls(self) -> FloatArray:
        """The prior of the parameters: pulls to zero, and a far firmer one of the mean stretch.

        It is (S + 1, S + 1) like a lens's prior; the mean stretch is the overall scale.
        """
        if not self.parts:
            return np.zeros((1, 1))
        weight = self.noise / self.spread
        rows = [np.diag(weight)]
        stretches = np.flatnonzero(self.kinds == _STRETCHED)
        if len(stretches):
            mean = np.zeros((1, len(self.parameters)))
            mean[0, stretches] = self.noise / (_SCALE_SPREAD * len(stretches))
            rows.append(mean)
        slope = np.concatenate(rows)
        return gram(slope, slope @ self.parameters)


@dataclass(frozen=True, kw_only=True, eq=False)
class NominalTarget:
    """The nominal target, and its pairs in units in which it is of order 1.

    Attributes:
        pairs: pairs with nominal world points, divided by ``scale``.
        target: the nominal target; None for pairs without one.
        scale: the target's units in one unit of ``pairs``.
        renamed: photos whose corners were renamed, and the motion of the target that renames them.

    """

    pairs: Observations
    target: Target | None = None
    scale: float = 1.0
    renamed: Mapping[str, Symmetry] = field(default_factory=dict)

    def pairs_at(self, level: TargetModel) -> Observations:
        """The pairs of a fit at a level of the target; ``error_known`` is set for this level.

        If no corner of a target is certain, each one tells the error that its own point leaves.
        """
        certain = self.pairs.certain
        if level != "points" or not certain.any():
            return self.pairs
        return replace(self.pairs, error_known=certain)

    def free(self, *, noise: float, offset_spread: float | None = None) -> DeformableTarget:
        """The deformable target, started as nominal.

        Args:
            noise: standard deviation of a corner's coordinate, pixels.
            offset_spread: standard deviation of corners' own offsets, in the pairs' units; None
                where corners have none.

        Raises:
            ValueError: the nominal target is unknown.

        """
        pairs, target, parts, spread = self.pairs, self.target, list[BoardPart](), list[float]()
        if target is None:
            raise ValueError("pairs without a target have no boards to refine")
        for index in np.unique(pairs.board).tolist():
            part = _make_part(
                pairs, target.boards[index], index, self.scale, len(spread), not parts
            )
            spread += _SHAPE_SPREADS[: part.basis.shape[2]]
            spread += [_PLACE_SPREAD] * (part.place.stop - part.place.start)
            parts.append(part)
        world = DeformableTarget(
            nominal=pairs.world,
            parts=tuple(parts),
            parameters=np.zeros(len(spread)),
            spread=np.array(spread),
            noise=noise,
        )
        if offset_spread is not None:
            # An uncertain corner has an offset that no other photo shares: its place stays as
            # uncertain as corners' places are.
            apart = np.where(pairs.certain, -1, pairs.image)
            keys = np.stack([pairs.board, pairs.row, pairs.column, apart], axis=1)
            unique, corner = np.unique(keys, axis=0, return_inverse=True)
            offsets = np.zeros((len(unique), 3))
            world = replace(
                world, corner=corner.reshape(-1), offsets=offsets, offset_spread=offset_spread
            )
        return world

    def refined(self, world: DeformableTarget) -> Target | None:
        """The target as fitted, in its own units; the nominal target where nothing was fitted."""
        if self.target is None or not world.free:
            return self.target
        return self.target.with_boards(
            {
                part.board: _refine_board(world, part, self, self.target.boards[part.board])
                for part in world.parts
            }
        )


def _refine_board(
    world: DeformableTarget, part: BoardPart, nominal: NominalTarget, board: Board
) -> Board:
    pairs, scale = nominal.pairs, nominal.scale
    place = world.parameters[part.place]
    if not len(place):
        place = np.zeros(_PLACE_TERMS)
    rotation = rotation_from_vector(place[:3])
    shift = place[3:] * part.size * scale
    middle = part.middle * scale
    offsets = np.zeros((board.rows, board.columns, 3))
    if len(world.corner):
        sure = part.pairs[pairs.certain[part.pairs]]
        own = world.offsets[world.corner[sure]] * scale
        offsets[pairs.row[sure], pairs.column[sure]] = own @ board.axes.T
    shape = np.zeros(_SHAPE_TERMS)
    if part.basis.shape[2]:
        shape = world.parameters[part.shape] * part.size * scale
    half = board.normalised(np.zeros(2))[1] if board.points is None else np.ones(2)
    departed = BoardShape(
        bend=shape[:2], twist=float(shape[2]), stretch=shape[3:] / half, offsets=offsets
    )
    shape_now = departed if board.shape is None else board.shape.plus(departed)
    if board.points is not None:
        # A list of points has no axes of its own that could turn: its points and offsets do.
        points = middle + (board.points - middle) @ rotation.T + shift
        turned = replace(shape_now, offsets=shape_now.offsets @ rotation.T)
        return replace(board, points=points, shape=turned)
    return replace(
        board,
        origin=middle + rotation @ (board.origin - middle) + shift,
        x_axis=rotation @ board.x_axis,
        y_axis=rotation @ board.y_axis,
        shape=shape_now,
    )


def _make_part(
    pairs: Observations, board: Board, index: int, scale: float, first: int, still: bool
) -> BoardPart:
    own = np.flatnonzero(pairs.board == index)
    if board.points is None:
        row, column = np.divmod(np.arange(board.rows * board.columns), board.columns)
        plane = board.plane_points(column, row)
        hat, half = board.normalised(plane)
        middle = board.world_points((board.columns - 1) / 2, (board.rows - 1) / 2) / scale
        size = float(np.hypot(*half)) / scale
        (x, y), (x_axis, y_axis, normal) = hat.T, board.axes
        terms = (x**2, normal), (y**2, normal), (x * y, normal), (x, x_axis), (y, y_axis)
        basis = np.stack([np.outer(*term) for term in terms], axis=2)
        basis *= size
    else:
        extent = np.ptp(board.points, axis=0)
        middle = (board.points.min(axis=0) + extent / 2) / scale
        size = float(np.linalg.norm(extent)) / 2 / scale
        basis = np.zeros((board.rows * board.columns, 3, 0))
    stop = first + basis.shape[2]
    return BoardPart(
        board=index,
        pairs=own,
        cell=pairs.row[own] * board.columns + pairs.column[own],
        basis=basis,
        shape=slice(first, stop),
        place=slice(stop, stop + (0 if still else _PLACE_TERMS)),
        middle=middle,
        size=size,
    )


def departures(nominal: Target | None, refined: Target | None) -> tuple[Departure, ...]:
    """How far each board departs from the nominal one; boards that do not are left out."""
    if nominal is None or refined is None:
        return ()
    both = zip(nominal.boards, refined.boards, strict=True)
    return tuple(_measure_departure(before, after) for before, after in both if after is not before)


def _measure_departure(nominal: Board, refined: Board) -> Departure:
    shape = refined.shape or BoardShape.none(refined.columns, refined.rows)
    turn = 0.0
    if nominal.points is not None and refined.points is not None:
        middle, moved = nominal.points.mean(axis=0), refined.points.mean(axis=0)
    else:
        half = nominal.normalised(np.zeros(2))[1]
        middle, moved = (board.origin + half @ board.axes[:2] for board in (nominal, refined))
        cosine = (np.trace(refined.axes @ nominal.axes.T) - 1) / 2
        turn = float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))
    length = np.linalg.norm(shape.offsets, axis=2)
    return Departure(
        board=nominal.name,
        bend=(float(shape.bend[0]), float(shape.bend[1])),
        twist=float(shape.twist),
        stretch=(float(shape.stretch[0]), float(shape.stretch[1])),
        shift=float(np.linalg.norm(moved - middle)),
        turn_deg=turn,
        offset_rms=float(np.sqrt(np.mean(length[length > 0] ** 2))) if length.any() else 0.0,
    )
