"""All grids of all photos, and what one photo's say by themselves under the lens so far.

The lens and every grid's pose before any grid has a name.

A grid of squares is a plane with known geometry whatever its name, so the grids of all photos,
each with a pose of its own, calibrate a radial lens. Under this lens every grid has a place in
front of the camera, in squares, and names follow from how these places fit together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.allowed_offsets import (
    AllowedOffsets,
    find_allowed_offsets,
)
from cubicfish.find.identification.decide import Decision, decide, decide_alone, unnamed
from cubicfish.find.identification.ends import Ends, ends_of, farthest_radius, without_strays
from cubicfish.find.identification.identified import Decided
from cubicfish.find.identification.search import GridView, grid_moments, search
from cubicfish.fit.radial_reference import RadialReference, refit_radial
from cubicfish.fit.start import fit_poses
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import wide_px
from cubicfish.target.observations import Observations
from cubicfish.target.placement import Placement, placement_of
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

Decisions = list[Decision]
"""One for each photo, of as many grids as it has."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """All grids of all photos, in one list.

    Attributes:
        target: the calibration target.
        sides: its nominal boards, or with the colours that the photos show.
        image_size: (width, height) of all photos, pixels.
        grids: the grids.
        allowed: where on the target each of them can lie.
        photos: for each photo, indices into the list, largest grid first.
        other_colours: whether the photos show the only board's colours exchanged.
        camera: the lens so far; None where there is none.
        poses: where each grid is under a lens; None where it is no plane of squares.
        placed_under: the lens that they were placed under, all but those that were cut since.

    """

    target: Target
    sides: Placement
    image_size: tuple[int, int]
    grids: Sequence[Grid]
    allowed: Sequence[AllowedOffsets]
    photos: Sequence[Sequence[int]]
    other_colours: bool
    camera: RadialCamera | None = None
    poses: Sequence[GridPose | None] = ()
    placed_under: RadialCamera | None = None

    @classmethod
    def of(
        cls, grids: Sequence[Sequence[Grid]], target: Target, image_size: tuple[int, int]
    ) -> Scene:
        """The grids of each photo, cut where strays are in the way."""
        sides = placement_of(target)
        other_colours = _has_other_colours(grids, sides)
        if other_colours:
            sides = replace(sides, colour=-sides.colour)
        fitting = [_cut_to_boards(grid, sides) for own in grids for grid in own]
        every = [grid for grid, _ in fitting]
        counts = [len(own) for own in grids]
        first = np.cumsum([0, *counts])[:-1].tolist()
        numbers = [range(start, start + n) for start, n in zip(first, counts, strict=True)]
        return cls(
            target=target,
            sides=sides,
            image_size=image_size,
            grids=every,
            allowed=[allowed for _, allowed in fitting],
            photos=[sorted(own, key=lambda k: -len(every[k])) for own in numbers],
            other_colours=other_colours,
            poses=[None] * len(every),
        )

    def seen_through(self, camera: RadialCamera | None) -> Scene:
        """The same with another lens; grids stay where they are until they are placed again."""
        return replace(self, camera=camera)

    def placed(self) -> Scene:
        """The same with all grids where they are under the lens."""
        if self.camera is not None and self.placed_under is self.camera:
            return self
        return replace(self, poses=self._find_poses(self.grids), placed_under=self.camera)

    def with_grids(self, others: Mapping[int, Grid]) -> Scene:
        """The same with other grids in the place of some, where they are under the lens."""
        grids, allowed, poses = list(self.grids), list(self.allowed), list(self.poses)
        found = self._find_poses(list(others.values()))
        for (index, grid), pose in zip(others.items(), found, strict=True):
            grids[index], poses[index] = grid, pose
            allowed[index] = find_allowed_offsets(grid.cells, grid.parity, self.sides)
        return replace(self, grids=grids, allowed=allowed, poses=poses)

    def _find_poses(self, grids: Sequence[Grid]) -> list[GridPose | None]:
        if self.camera is None:
            return [None] * len(grids)
        return grid_poses(self.camera, grids, self.image_size)

    def decide(self, sides: Placement, own: Sequence[int]) -> Decision:
        """What becomes of one photo's grids, in the order of ``own``.

        ``sides`` are the boards where they are, ``self.sides`` where they are nominally.
        """
        out = [self._why_out(index) for index in own]
        usable = [n for n, why in enumerate(out) if why is None]
        part, found = usable, None
        if self.camera is not None and len(usable) > 1:
            found = self._decide_together(self.camera, sides, own, usable)
        if found is None and usable:
            part, found = usable[:1], self._decide_largest(own, usable)
        decision = spread(found, part, len(own))
        verdict = [why or given for why, given in zip(out, decision.verdict, strict=True)]
        return replace(decision, verdict=tuple(verdict))

    def _why_out(self, index: int) -> Decided | None:
        """Why a grid can have no place, if it is no board's or no plane; None where it may."""
        allowed = self.allowed[index]
        if not allowed.possible:
            return Decided.COLOURS if allowed.wide_enough else Decided.TOO_LARGE
        flat = self.camera is None or self.poses[index] is not None
        return None if flat else Decided.NOT_PLANE

    def _decide_together(
        self, camera: RadialCamera, sides: Placement, own: Sequence[int], usable: Sequence[int]
    ) -> Decision | None:
        """The names of grids that lie on the target together; None where they do not."""
        some = [own[n] for n in usable]
        views = [
            view_of(camera, self.grids[index], self._get_pose(index), self.allowed[index])
            for index in some
        ]
        ends = [self._find_ends(camera, own, index) for index in some]
        return decide([self.grids[index] for index in some], self.sides, search(views, sides), ends)

    def _decide_largest(self, own: Sequence[int], usable: Sequence[int]) -> Decision:
        """The name of the largest grid, by itself."""
        index, *others = (own[n] for n in usable)
        grid, pose = self.grids[index], self.poses[index]
        found = decide_alone(grid, self.sides, self.allowed[index], self.ends(own, index))
        if pose is not None:
            found = replace(found, rms_px=np.array([pose.rms_px]))
        # Another may be nearly as large as the largest: which one is the board then?
        has_runner_up = any(2 * len(self.grids[other]) > len(grid) for other in others[:1])
        if found.verdict[0] is Decided.CONVENTION and has_runner_up:
            found = replace(found, verdict=(Decided.AMBIGUOUS,))
        return found

    def decide_all(self, sides: Placement) -> Decisions:
        """The same for every photo."""
        return [self.decide(sides, own) for own in self.photos]

    def ends(self, own: Sequence[int], index: int) -> Ends | None:
        """Where the board of one of a photo's grids ends; None where no lens is known."""
        return None if self.camera is None else self._find_ends(self.camera, own, index)

    def _find_ends(self, camera: RadialCamera, own: Sequence[int], index: int) -> Ends:
        pose = self._get_pose(index)
        return ends_of(
            camera,
            self.grids[index],
            np.column_stack([pose.rotation[0][:, :2], pose.translation[0]]),
            np.concatenate([np.empty((0, 2)), *(self.grids[k].pixel for k in own if k != index)]),
            self._farthest,
        )

    @cached_property
    def _farthest(self) -> float:
        """How far from the axis nearly all corners of all photos lie, normalised."""
        if self.camera is None:
            return np.inf
        return farthest_radius(self.camera, np.concatenate([grid.pixel for grid in self.grids]))

    def named_corners(self, own: Sequence[int], decision: Decision) -> int:
        """How many corners of a photo's grids have surely a name."""
        return sum(
            len(self.grids[index])
            for index, verdict in zip(own, decision.verdict, strict=True)
            if verdict is Decided.NAMED
        )

    def cells(self, index: int, decision: Decision, n: int) -> IntArray:
        """(N, 2) columns and rows of a grid that has a place: the n-th of its photo."""
        return self.sides.board_cells(
            int(decision.side[n]), decision.offset[n], self.grids[index].cells
        )

    def _get_pose(self, index: int) -> GridPose:
        pose = self.poses[index]
        if pose is None:
            raise ValueError("a grid that is no plane of squares has no place")
        return pose


def _cut_to_boards(grid: Grid, sides: Placement) -> tuple[Grid, AllowedOffsets]:
    """A grid without the strays that hide its board, if any, and where it can lie."""
    allowed = find_allowed_offsets(grid.cells, grid.parity, sides)
    cut = None if allowed.wide_enough else without_strays(grid, sides.sizes_seen)
    if cut is None:
        return grid, allowed
    return cut, find_allowed_offsets(cut.cells, cut.parity, sides)


def rigid(decision: Decision) -> list[int]:
    """The named grids of a photo that are posed together: none or at least two."""
    if np.isnan(decision.rotation).any():
        return []
    named = [n for n, verdict in enumerate(decision.verdict) if verdict is Decided.NAMED]
    return named if len(named) > 1 else []


def spread(found: Decision | None, part: Sequence[int], count: int) -> Decision:
    """A decision on some grids as one on ``count`` grids, of which the others fit nowhere."""
    whole = unnamed(count)
    if found is None:
        return whole
    own = dict(zip(part, found.verdict, strict=True))
    for name in ("side", "offset", "ratio", "rms_px"):
        getattr(whole, name)[list(part)] = getattr(found, name)
    return replace(
        whole,
        verdict=tuple(own.get(n, Decided.NO_FIT) for n in range(count)),
        rotation=found.rotation,
        translation=found.translation,
    )


def _has_other_colours(grids: Sequence[Sequence[Grid]], sides: Placement) -> bool:
    """Whether most photos show the only board with light and dark exchanged.

    A lens does not depend on it, and it is hard to see on a print which corner is the first: it
    must not lose a photo. Grids that span the board tell, if its size does not allow both.
    """
    if len(sides.board) != 4:
        return False
    exchanged = replace(sides, colour=-sides.colour)
    votes = 0
    for own in grids:
        whole = [
            grid for grid in own
            if (np.ptp(grid.cells, axis=0) + 1 == sides.sizes_seen).all(axis=1).any()
        ]  # fmt: skip
        if whole:
            largest = max(whole, key=len)
            votes += find_allowed_offsets(largest.cells, largest.parity, exchanged).possible
            votes -= find_allowed_offsets(largest.cells, largest.parity, sides).possible
    return votes > 0


def named_lens(
    scene: Scene, reference: RadialReference, decisions: Decisions
) -> RadialReference | None:
    """The lens fitted to settled photos as whole targets and to all other grids as planes."""
    world: list[FloatArray] = []
    pixel: list[FloatArray] = []
    rotation, translation = [], []
    for own, decision in zip(scene.photos, decisions, strict=True):
        together = rigid(decision)
        if together:
            world.append(
                np.concatenate([_compute_world(scene, own[n], decision, n) for n in together])
            )
            pixel.append(np.concatenate([scene.grids[own[n]].pixel for n in together]))
            rotation.append(decision.rotation)
            translation.append(decision.translation)
        for n, index in enumerate(own):
            pose = scene.poses[index]
            if n in together or pose is None:
                continue
            world.append(on_plane(scene.grids[index]))
            pixel.append(scene.grids[index].pixel)
            rotation.append(pose.rotation[0])
            translation.append(pose.translation[0])
    if not world:
        return None
    start = Poses(rotation=np.stack(rotation), translation=np.stack(translation))
    return refit_radial(reference, pairs_of_parts(world, pixel, scene.image_size), start)


def _compute_world(scene: Scene, index: int, decision: Decision, n: int) -> FloatArray:
    board = scene.target.boards[scene.sides.board[decision.side[n]]]
    return board.world_points(*scene.cells(index, decision, n).T)


# RMS, as a share of the distance of neighbouring corners, from which a grid is no plane of
# squares, and from which it does not fit a place: targets are never quite nominal, while one
# step along the board, or another board, misses by several times as much.
_PLANE_STEPS, _PLACE_STEPS = 0.1, 0.25
_SMALLEST_GATE_PX = 1.0
# Corners in all, beyond which grids are thinned, and how many each keeps at least.
_ENOUGH_CORNERS, _LEAST_CORNERS = 15_000, 100
# A mirrored pose counts as possible too while its error is at most this many times the other's.
_MIRROR_RATIO = 1.5
_MIRROR_SLACK_PX = 0.05
_DIFFERENT_DEG = 3.0


def _choose_gate_px(grid: Grid, steps: float) -> float:
    return max(_SMALLEST_GATE_PX, steps * grid.step)


def anonymous_pairs(grids: Sequence[Grid], image_size: tuple[int, int]) -> Observations:
    """Each grid as a photo of its own plane, in squares: corner (i, j) is at (i, j, 0).

    Of very many corners only some of each grid are taken, spread over it.
    """
    most = max(_LEAST_CORNERS, _ENOUGH_CORNERS // max(len(grids), 1))
    picks = [_spread(len(grid), most) for grid in grids]
    return pairs_of_parts(
        [on_plane(grid)[pick] for grid, pick in zip(grids, picks, strict=True)],
        [grid.pixel[pick] for grid, pick in zip(grids, picks, strict=True)],
        image_size,
    )


def on_plane(grid: Grid) -> FloatArray:
    """(N, 3) where its corners are on its own plane, in squares."""
    return np.column_stack([grid.cells, np.zeros(len(grid))]).astype(float)


def pairs_of_parts(
    world: Sequence[FloatArray], pixel: Sequence[FloatArray], image_size: tuple[int, int]
) -> Observations:
    """Pairs without names, one part per photo: (N, 3) points and (N, 2) pixels each."""
    counts = [len(one) for one in pixel]
    return Observations.without_names(
        image_size=image_size,
        images=tuple(str(index) for index in range(len(counts))),
        image=np.repeat(np.arange(len(counts)), counts),
        world=np.concatenate(world),
        pixel=np.concatenate(pixel),
        column=np.arange(sum(counts)),
    )


def _spread(count: int, most: int) -> IntArray:
    """At most ``most`` of ``count`` indices, without a pattern, the same every time."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).permutation(count)[:most])


@dataclass(frozen=True, kw_only=True, eq=False)
class GridPose:
    """Where one grid is under a known lens.

    Attributes:
        rotation, translation: (C, 3, 3), (C, 3) camera_from_grid in squares, best first.
        rms_px: how well it fits a plane of squares.

    """

    rotation: FloatArray
    translation: FloatArray
    rms_px: float


def grid_poses(
    camera: RadialCamera, grids: Sequence[Grid], image_size: tuple[int, int]
) -> list[GridPose | None]:
    """The pose of every grid; None where its corners are no plane of squares."""
    pairs = anonymous_pairs(grids, image_size)
    fit, own, placed = fit_poses(camera, pairs)
    found: list[GridPose | None] = [None] * len(grids)
    if fit is None:
        return found
    rms = _measure_rms(fit.residual, own)
    middle = np.stack([own.world[own.image == k].mean(axis=0) for k in range(len(placed))])
    mirror = adjust(
        FixedLens(camera=camera),
        _mirror_poses(fit.poses, middle),
        own,
        huber_px=wide_px(fit.residual),
        max_iterations=20,
    )
    mirror_rms = _measure_rms(mirror.residual, own)
    for k, index in enumerate(placed):
        candidates = sorted([(rms[k], 0), (mirror_rms[k], 1)])
        if candidates[0][0] > _choose_gate_px(grids[index], _PLANE_STEPS):
            continue
        both = Poses(
            rotation=np.stack([fit.poses.rotation[k], mirror.poses.rotation[k]]),
            translation=np.stack([fit.poses.translation[k], mirror.poses.translation[k]]),
        )
        order = [candidates[0][1]]
        trace = np.trace(both.rotation[0] @ both.rotation[1].T)
        apart = trace < 1 + 2 * np.cos(np.deg2rad(_DIFFERENT_DEG))
        if apart and candidates[1][0] < _MIRROR_RATIO * candidates[0][0] + _MIRROR_SLACK_PX:
            order.append(candidates[1][1])
        found[index] = GridPose(
            rotation=both.rotation[order],
            translation=both.translation[order],
            rms_px=float(candidates[0][0]),
        )
    return found


def view_of(camera: RadialCamera, grid: Grid, pose: GridPose, allowed: AllowedOffsets) -> GridView:
    """What the search for names needs of a grid."""
    middle = np.array([*grid.cells.mean(axis=0), 1.0])
    camera_from_grid = np.column_stack([pose.rotation[0][:, :2], pose.translation[0]])
    return GridView(
        allowed=allowed,
        middle=middle,
        rotation=pose.rotation,
        camera_middle=pose.rotation[:, :, :2] @ middle[:2] + pose.translation,
        moments=grid_moments(camera, grid.cells, grid.pixel, camera_from_grid),
        corners=len(grid),
        gate_px=_choose_gate_px(grid, _PLACE_STEPS),
    )


def _measure_rms(residual: FloatArray, pairs: Observations) -> FloatArray:
    squares = np.bincount(pairs.image, weights=np.square(residual).sum(axis=1))
    return np.sqrt(squares / np.bincount(pairs.image))


def _mirror_poses(poses: Poses, middle: FloatArray) -> Poses:
    """The planes that look alike from afar: depth about the middle reversed (Necker's cube)."""
    centre = (poses.rotation @ middle[:, :, None])[:, :, 0] + poses.translation
    sight = centre / np.linalg.norm(centre, axis=1, keepdims=True)
    columns = poses.rotation[:, :, :2]
    depth = sight[:, None, :] @ columns
    columns = columns - 2 * sight[:, :, None] * depth
    normal = np.cross(columns[..., 0], columns[..., 1])
    rotation = np.concatenate([columns, normal[..., None]], axis=-1)
    return Poses(rotation=rotation, translation=centre - (rotation @ middle[:, :, None])[:, :, 0])
