"""All grids of all photos, and what one photo's say by themselves under the lens so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial, refit_radial
from cubicfish_cli.identification.decide import Decided, Decision, decide, decide_alone
from cubicfish_cli.identification.ends import Ends, ends_of, farthest_radius, without_strays
from cubicfish_cli.identification.grid_views import (
    GridPose,
    anonymous_pairs,
    grid_poses,
    on_plane,
    pairs_of_parts,
    view_of,
)
from cubicfish_cli.identification.search import search
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.placement import Placement, Reach, placement_of, reach_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

Decisions = list[Decision | None]
"""One for each photo; None for photos without grids."""


@dataclass(kw_only=True, eq=False)
class Scene:
    """All grids of all photos, in one list.

    Attributes:
        target: the calibration target.
        sides: its boards as they are drawn, or with the colours that the photos show.
        image_size: (width, height) of all photos, pixels.
        grids: the grids.
        reach: where on the target each of them can lie.
        photos: for each photo, indices into the list, largest grid first.
        other_colours: whether the photos show the only board's colours exchanged.
        camera: the lens so far; None where there is none.
        poses: where each grid is under that lens; None where it is no plane of squares.

    """

    target: Target
    sides: Placement
    image_size: tuple[int, int]
    grids: list[Grid]
    reach: list[Reach]
    photos: list[list[int]]
    other_colours: bool
    camera: RadialCamera | None = None
    poses: list[GridPose | None] = field(default_factory=list)
    _farthest: float | None = None  # normalised radius that corners reach under the lens

    @classmethod
    def of(
        cls, grids: Sequence[Sequence[Grid]], target: Target, image_size: tuple[int, int]
    ) -> Scene:
        """The grids of each photo, cut where strays are in the way."""
        sides = placement_of(target)
        other_colours = _has_other_colours(grids, sides)
        if other_colours:
            sides = replace(sides, colour=-sides.colour)
        scene = cls(
            target=target,
            sides=sides,
            image_size=image_size,
            grids=[],
            reach=[],
            photos=[],
            other_colours=other_colours,
        )
        for own in grids:
            first = len(scene.grids)
            for found in own:
                grid, room = found, reach_of(found.cells, found.parity, sides)
                if not room.wide_enough:
                    cut = without_strays(grid, sides.sizes_seen)
                    if cut is not None:
                        grid, room = cut, reach_of(cut.cells, cut.parity, sides)
                scene.grids.append(grid)
                scene.reach.append(room)
            order = sorted(range(first, len(scene.grids)), key=lambda k: -len(scene.grids[k]))
            scene.photos.append(order)
        return scene

    def see_through(self, camera: RadialCamera | None) -> None:
        """Take another lens; grids stay where they are until they are placed again."""
        self.camera, self._farthest = camera, None

    def place_grids(self) -> None:
        """Find where all grids are under the lens."""
        self.poses = [None] * len(self.grids)
        if self.camera is not None:
            self.poses = grid_poses(self.camera, self.grids, self.image_size)

    def put(self, index: int, grid: Grid, reach: Reach, pose: GridPose | None) -> None:
        """Another grid in the place of one."""
        self.grids[index], self.reach[index], self.poses[index] = grid, reach, pose
        self._farthest = None

    def decide(self, sides: Placement, own: Sequence[int]) -> Decision | None:
        """What becomes of one photo's grids, in the order of ``own``; None without grids.

        ``sides`` are the boards where they are, ``self.sides`` as they are drawn.
        """
        if not own:
            return None
        camera = self.camera
        usable = [
            n for n, index in enumerate(own)
            if self.reach[index].possible and (camera is None or self.poses[index] is not None)
        ]  # fmt: skip
        found = None
        if camera is not None and len(usable) > 1:
            views = [
                view_of(camera, self.grids[index], self._pose(index), self.reach[index])
                for index in (own[n] for n in usable)
            ]
            labelings = search(views, sides)
            ends = [self._ends(camera, own, own[n]) for n in usable]
            found = decide([self.grids[own[n]] for n in usable], self.sides, labelings, ends)
        part = usable
        if found is None and usable:
            part = usable[:1]
            found = self._alone(own, own[part[0]])
            if found.verdict[0] is Decided.CONVENTION and self._rivalled(own, usable):
                found = replace(found, verdict=(Decided.AMBIGUOUS,))
        decision = spread(found, part, len(own))
        verdict = list(decision.verdict)
        for n, index in enumerate(own):
            if not self.reach[index].possible:
                wide = self.reach[index].wide_enough
                verdict[n] = Decided.COLOURS if wide else Decided.TOO_LARGE
            elif n not in usable:
                verdict[n] = Decided.NOT_PLANE
        return replace(decision, verdict=tuple(verdict))

    def decide_all(self, sides: Placement) -> Decisions:
        """The same for every photo."""
        return [self.decide(sides, own) for own in self.photos]

    def ends(self, own: Sequence[int], index: int) -> Ends | None:
        """Where the board of one of a photo's grids ends; None where no lens is known."""
        return None if self.camera is None else self._ends(self.camera, own, index)

    def _ends(self, camera: RadialCamera, own: Sequence[int], index: int) -> Ends:
        if self._farthest is None:
            pixel = np.concatenate([grid.pixel for grid in self.grids])
            self._farthest = farthest_radius(camera, pixel)
        pose = self._pose(index)
        return ends_of(
            camera,
            self.grids[index],
            np.column_stack([pose.rotation[0][:, :2], pose.translation[0]]),
            np.concatenate([np.empty((0, 2)), *(self.grids[k].pixel for k in own if k != index)]),
            self._farthest,
        )

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

    def _pose(self, index: int) -> GridPose:
        pose = self.poses[index]
        if pose is None:
            raise ValueError("a grid that is no plane of squares has no place")
        return pose

    def _alone(self, own: Sequence[int], index: int) -> Decision:
        found = decide_alone(
            self.grids[index], self.sides, self.reach[index], self.ends(own, index)
        )
        pose = self.poses[index]
        return found if pose is None else replace(found, rms_px=np.array([pose.rms_px]))

    def _rivalled(self, own: Sequence[int], usable: Sequence[int]) -> bool:
        """Whether another grid is nearly as large as the largest: which one is the board then?"""
        counts = [len(self.grids[own[n]]) for n in usable]
        return len(counts) > 1 and 2 * counts[1] > counts[0]


def rigid(decision: Decision | None) -> list[int]:
    """The named grids of a photo that are posed together: none or at least two."""
    if decision is None or np.isnan(decision.rotation).any():
        return []
    named = [n for n, verdict in enumerate(decision.verdict) if verdict is Decided.NAMED]
    return named if len(named) > 1 else []


def spread(found: Decision | None, part: Sequence[int], count: int) -> Decision:
    """A decision on some grids as one on ``count`` grids, of which the others fit nowhere."""
    verdict = np.full(count, Decided.NO_FIT, object)
    side, offset = np.full(count, -1, np.intp), np.zeros((count, 2), np.intp)
    ratio, rms = np.full(count, np.inf), np.full(count, np.nan)
    if found is not None:
        part = list(part)
        verdict[part] = found.verdict
        side[part], offset[part] = found.side, found.offset
        ratio[part], rms[part] = found.ratio, found.rms_px
    return Decision(
        verdict=tuple(verdict),
        side=side,
        offset=offset,
        ratio=ratio,
        rms_px=rms,
        rotation=found.rotation if found else np.full((3, 3), np.nan),
        translation=found.translation if found else np.full(3, np.nan),
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
            votes += reach_of(largest.cells, largest.parity, exchanged).possible
            votes -= reach_of(largest.cells, largest.parity, sides).possible
    return votes > 0


def nameless_lens(scene: Scene) -> RadialReference | None:
    """A lens from all grids as planes without names; None when they do not determine one."""
    if not scene.grids:
        return None
    try:
        return fit_radial(anonymous_pairs(scene.grids, scene.image_size))
    except FitError:
        return None


def named_lens(
    scene: Scene, reference: RadialReference, decisions: Decisions
) -> RadialReference | None:
    """The lens fitted to settled photos as whole targets and to all other grids as planes."""
    world: list[FloatArray] = []
    pixel: list[FloatArray] = []
    rotation, translation = [], []
    for own, decision in zip(scene.photos, decisions, strict=True):
        together = rigid(decision)
        if decision is not None and together:
            world.append(np.concatenate([_world(scene, own[n], decision, n) for n in together]))
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


def _world(scene: Scene, index: int, decision: Decision, n: int) -> FloatArray:
    board = scene.target.boards[scene.sides.board[decision.side[n]]]
    return board.world_points(*scene.cells(index, decision, n).T)
