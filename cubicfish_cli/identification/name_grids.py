"""Grids of all photos -> named corners: which board each grid is, and where on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Corners, Correspondences
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial, refit_radial
from cubicfish_cli.identification.as_built import Sighting, built_sides
from cubicfish_cli.identification.decide import (
    Decided,
    Decision,
    decide,
    decide_alone,
    rim_in_doubt,
)
from cubicfish_cli.identification.ends import Ends, ends_of, farthest_radius
from cubicfish_cli.identification.grid_views import GridPose, anonymous_pairs, grid_poses, view_of
from cubicfish_cli.identification.placement import Placement, Reach, placement_of, reach_of
from cubicfish_cli.identification.search import search
from cubicfish_cli.identification.strays import solid, solid_size, without_strays
from cubicfish_cli.model.radial import RadialCamera
from cubicfish_cli.target import Target

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]

# Times the lens is fitted again with the names so far, before what is left is given up.
_ROUNDS = 3
# Named grids must be this many before their RMS says which is too large, and how much that is.
_LEAST_GRIDS_TO_COMPARE = 6
_MISFIT_RATIO = 6.0
# Grids that fit the object this much worse than planes of their own, and miss it by this share
# of the distance of neighbouring corners: it is not as drawn.
_OFF_RATIO, _OFF_STEPS = 1.5, 0.01
# One photo fits whatever it measures, so that several must show boards together.
_LEAST_PHOTOS_TO_MEASURE = 3
# A lens whose focal length is known this well, as a share of it, gains nothing from names.
_GOOD_FOCAL = 0.005
_NO_POSE = (np.full((3, 3), np.nan), np.full(3, np.nan))

FEWEST_CORNERS = 12
"""A grid of fewer corners may be anything: it says nothing of why others have no place."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where on the target a grid lies.

    Corner (i, j) of the grid is corner turn · (i, j) + (column, row) of the board.

    Attributes:
        board: index into the target's boards.
        turn: quarter turns, index into :data:`cubicfish_cli.identification.placement.TURNS`.
        column, row: where the grid's cell (0, 0) lies on the board.

    """

    board: int
    turn: int
    column: int
    row: int


@dataclass(frozen=True, kw_only=True, eq=False)
class GridReport:
    """What became of one grid.

    Attributes:
        verdict: named, or why not.
        place: where it lies, None when it was left out.
        corners: how many corners it has.
        size: columns and rows of its bounding box; where it was left out, without lines of one or
            two corners at its rim.
        ratio: how many times worse the best other name fits; inf without a rival.
        rms_px: how well it fits its name under the lens of :class:`Identified`; NaN when unknown.

    """

    verdict: Decided
    place: Place | None
    corners: int
    size: tuple[int, int]
    ratio: float
    rms_px: float

    @property
    def named(self) -> bool:
        """Whether its corners are among the named ones."""
        return self.place is not None


@dataclass(frozen=True, kw_only=True, eq=False)
class Identified:
    """The named corners of all photos.

    Attributes:
        corners: the named corners; photos without any are listed in ``images`` all the same.
        found: for each photo, its grids, without the strays that were cut off.
        grids: for each photo, what became of each of its grids.
        lens: the radial lens that the names were checked with, None when none could be fitted.
        exact: (M,) whether the photo's corners are surely these corners of the target. False
            where a board seen in part may be a few squares further along its plane: as good
            for a lens, but not for measuring the target.
        other_colours: whether the only board is light where the target says that it is dark, in
            most photos that tell.

    """

    corners: Corners
    found: tuple[tuple[Grid, ...], ...]
    grids: tuple[tuple[GridReport, ...], ...]
    lens: RadialCamera | None
    exact: BoolArray
    other_colours: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class _Task:
    """All grids of all photos, in one list."""

    target: Target
    sides: Placement
    image_size: tuple[int, int]
    grids: list[Grid]
    reach: list[Reach]
    photos: list[list[int]]  # for each photo, indices into the list, largest grid first
    other_colours: bool


def name_grids(
    grids: Sequence[Sequence[Grid]],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Identified:
    """Name every grid that can be named beyond doubt; the others are left out and reported.

    A radial lens is fitted to all grids as nameless planes first. Photo by photo, the places
    of all grids on the target are then searched with that lens; where a photo stays unsettled,
    the lens is fitted again with the names found so far and the search repeated.

    Args:
        grids: for each photo, its grids.
        target: the object.
        image_size: (width, height) of all photos, pixels.
        images: the photos' names.
        progress: called with photos done and all photos while the search runs.

    """
    task = _task(grids, target, image_size)
    decisions, lens = _decide_all(task, progress)
    return _identified(task, decisions, lens, tuple(images))


def name_again(
    identified: Identified,
    photos: Sequence[int] | IntArray,
    target: Target,
    grids: Sequence[Sequence[Grid]] | None = None,
) -> Identified:
    """Name the grids of some photos as they would be if the object were drawn otherwise.

    Args:
        identified: what became of all grids.
        photos: indices of the photos.
        target: the other drawing.
        grids: for each of these photos, other grids in place of its own.

    """
    corners = identified.corners
    own = [identified.found[photo] for photo in photos] if grids is None else grids
    return name_grids(own, target, corners.image_size, [corners.images[i] for i in photos])


def _task(
    grids: Sequence[Sequence[Grid]],
    target: Target,
    image_size: tuple[int, int],
) -> _Task:
    sides = placement_of(target)
    other_colours = _has_other_colours(grids, sides)
    if other_colours:
        sides = replace(sides, colour=-sides.colour)
    flat: list[Grid] = []
    reach: list[Reach] = []
    photos: list[list[int]] = []
    for own in grids:
        first = len(flat)
        for found in own:
            grid, room = found, reach_of(found, sides)
            if not room.wide_enough:
                cut = without_strays(grid, sides.sizes_seen)
                if cut is not None:
                    grid, room = cut, reach_of(cut, sides)
            flat.append(grid)
            reach.append(room)
        photos.append(sorted(range(first, len(flat)), key=lambda k: -len(flat[k])))
    return _Task(
        target=target,
        sides=sides,
        image_size=image_size,
        grids=flat,
        reach=reach,
        photos=photos,
        other_colours=other_colours,
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
        whole = max(
            (grid for grid in own if (_box(grid) == sides.sizes_seen).all(axis=1).any()),
            key=len,
            default=None,
        )
        if whole is not None:
            votes += reach_of(whole, exchanged).possible
            votes -= reach_of(whole, sides).possible
    return votes > 0


def _box(grid: Grid) -> IntArray:
    size: IntArray = np.ptp(grid.cells, axis=0) + 1
    return size


def _decide_all(
    task: _Task, progress: Callable[[int, int], None] | None
) -> tuple[list[Decision | None], RadialCamera | None]:
    reference = _nameless_lens(task)
    decisions: list[Decision | None] = [None] * len(task.photos)
    before: list[tuple[object, ...]] = []
    for _ in range(_ROUNDS):
        camera = reference.camera if reference else None
        poses = _poses(task, camera)
        for photo, own in enumerate(task.photos):
            decisions[photo] = _decide_photo(task, task.sides, own, camera, poses)
            if progress is not None:
                progress(photo + 1, len(task.photos))
        names = [_names(decision) for decision in decisions]
        unsettled = any(
            Decided.AMBIGUOUS in decision.verdict or Decided.NO_FIT in decision.verdict
            for decision in decisions if decision is not None
        )  # fmt: skip
        if reference is None or not unsettled or names == before:
            break
        if reference.focal_uncertainty < _GOOD_FOCAL:
            break
        before = names
        reference = _named_lens(task, reference, decisions, poses) or reference
    if reference is not None:
        sides, decisions = _with_built(task, reference.camera, poses, decisions)
        _cut_unnamed(task, sides, reference.camera, poses, decisions)
        decisions = _without_misfits(task, sides, reference.camera, poses, decisions)
    camera = reference.camera if reference else None
    return _with_doubts(task, camera, poses, decisions), camera


def _with_built(
    task: _Task,
    camera: RadialCamera,
    poses: list[GridPose | None],
    decisions: list[Decision | None],
) -> tuple[Placement, list[Decision | None]]:
    """Decide again with the boards where the photos have them, if they are not as drawn.

    The photo that shows most says how the boards lie first, so that all names agree with one
    photo's; all photos say it then. Kept only if it explains more, or the same better.
    """
    sides, kept = task.sides, decisions
    together = sum(bool(_rigid(decision)) for decision in decisions)
    if together < _LEAST_PHOTOS_TO_MEASURE or not _off_the_drawing(task, poses, decisions):
        return sides, kept
    trial = decisions
    reference = max(range(len(decisions)), key=lambda photo: _extent(task, decisions, photo))
    for photos in ([reference], range(len(decisions))):
        sightings = [one for photo in photos for one in _sightings(task, poses, trial, photo)]
        built = built_sides(sides, sightings)
        trial = [_decide_photo(task, built, own, camera, poses) for own in task.photos]
        sides = built
    others = [photo for photo in range(len(decisions)) if photo != reference]
    if _merit(task, trial, others) > _merit(task, kept, others):
        return sides, trial
    return task.sides, kept


def _off_the_drawing(
    task: _Task, poses: list[GridPose | None], decisions: list[Decision | None]
) -> bool:
    """Whether named grids fit the object clearly worse than planes of their own."""
    ratio, share = [], []
    for own, decision in zip(task.photos, decisions, strict=True):
        for n in _rigid(decision):
            pose = poses[own[n]]
            if pose is not None and decision is not None:
                ratio.append(decision.rms_px[n] / max(pose.rms_px, 1e-3))
                share.append(decision.rms_px[n] / task.grids[own[n]].step)
    return bool(ratio) and bool(np.median(ratio) > _OFF_RATIO and np.median(share) > _OFF_STEPS)


def _extent(task: _Task, decisions: list[Decision | None], photo: int) -> tuple[int, int]:
    """Boards and corners that a photo shows together."""
    decision = decisions[photo]
    named = _rigid(decision)
    if decision is None or not named:
        return 0, 0
    boards = len(np.unique(task.sides.board[decision.side[named]]))
    return boards, sum(len(task.grids[task.photos[photo][n]]) for n in named)


def _sightings(
    task: _Task, poses: list[GridPose | None], decisions: list[Decision | None], photo: int
) -> list[Sighting]:
    decision, seen = decisions[photo], []
    for n in _rigid(decision):
        index = task.photos[photo][n]
        pose = poses[index]
        if pose is None or decision is None:
            continue
        middle = task.grids[index].cells.mean(axis=0)
        rotation = pose.rotation[0]
        seen.append(
            Sighting(
                side=int(decision.side[n]),
                offset=decision.offset[n],
                middle=middle,
                rotation=rotation,
                camera_middle=rotation[:, :2] @ middle + pose.translation[0],
                camera_from_world=(decision.rotation, decision.translation),
                corners=len(task.grids[index]),
            )
        )
    return seen


def _merit(
    task: _Task, decisions: list[Decision | None], photos: Sequence[int]
) -> tuple[int, float]:
    """Corners named exactly, then how well they fit, in some photos."""
    corners, square = 0, 0.0
    for photo in photos:
        decision = decisions[photo]
        for n, index in enumerate(task.photos[photo]):
            if decision is not None and decision.verdict[n] is Decided.NAMED:
                corners += len(task.grids[index])
                square += len(task.grids[index]) * np.nan_to_num(decision.rms_px[n]) ** 2
    return corners, -float(square)


def _cut_unnamed(
    task: _Task,
    sides: Placement,
    camera: RadialCamera,
    poses: list[GridPose | None],
    decisions: list[Decision | None],
) -> None:
    """Cut what may be strays off grids that have no name, where they have one without them.

    With strays a grid may still fit a larger board of the target, and then nothing is in its way.
    """
    for photo, own in enumerate(task.photos):
        before = decisions[photo]
        if before is None:
            continue
        cut = {
            index: part
            for n, index in enumerate(own)
            if before.verdict[n] is not Decided.NAMED
            and len(part := solid(task.grids[index])) < len(task.grids[index])
        }
        if not cut:
            continue
        kept = {index: (task.grids[index], task.reach[index], poses[index]) for index in cut}
        for (index, part), pose in zip(
            cut.items(), grid_poses(camera, list(cut.values()), task.image_size), strict=True
        ):
            task.grids[index], task.reach[index] = part, reach_of(part, task.sides)
            poses[index] = pose
        after = _decide_photo(task, sides, own, camera, poses)
        if after is not None and _named_corners(task, own, after) > _named_corners(
            task, own, before
        ):
            decisions[photo] = after
            continue
        for index, (grid, reach, pose) in kept.items():
            task.grids[index], task.reach[index], poses[index] = grid, reach, pose


def _without_misfits(
    task: _Task,
    sides: Placement,
    camera: RadialCamera,
    poses: list[GridPose | None],
    decisions: list[Decision | None],
) -> list[Decision | None]:
    """Decide photos again without grids that fit far worse than the grids of the other photos.

    A grid that is no board of the target may fit a place by chance, within the width of the
    first gate, which must allow for targets that are not as drawn.
    """
    rms = np.concatenate([np.empty(0), *(d.rms_px for d in decisions if d is not None)])
    rms = rms[np.isfinite(rms)]
    if len(rms) < _LEAST_GRIDS_TO_COMPARE:
        return decisions
    limit = _MISFIT_RATIO * float(np.median(rms))
    checked = list(decisions)
    for photo, (own, decision) in enumerate(zip(task.photos, decisions, strict=True)):
        if decision is None or not (decision.rms_px > limit).any():
            continue
        bad = np.flatnonzero(decision.rms_px > limit).tolist()
        # One grid in a wrong place spoils the pose, and with it the fit of all others.
        trials = [[n] for n in bad] + ([bad] if len(bad) > 1 else [])
        again = [_decide_without(task, sides, own, trial, camera, poses) for trial in trials]
        sound = [one for one in again if not (one.rms_px > limit).any()]
        checked[photo] = max(sound or again[-1:], key=lambda one: _named_corners(task, own, one))
    return checked


def _with_doubts(
    task: _Task,
    camera: RadialCamera | None,
    poses: list[GridPose | None],
    decisions: list[Decision | None],
) -> list[Decision | None]:
    """Take a grid that may hold a stray line for placed by convention.

    Only where it is alone: other boards of the object would not fit if it lay elsewhere.
    """
    checked = list(decisions)
    for photo, (own, decision) in enumerate(zip(task.photos, decisions, strict=True)):
        if decision is None or decision.verdict.count(Decided.NAMED) != 1:
            continue
        n = decision.verdict.index(Decided.NAMED)
        ends = _ends(task, camera, own, own[n], poses) if camera else None
        board = int(task.sides.board[decision.side[n]])
        if rim_in_doubt(task.grids[own[n]], task.sides, board, ends):
            verdict = list(decision.verdict)
            verdict[n] = Decided.CONVENTION
            checked[photo] = replace(decision, verdict=tuple(verdict))
    return checked


def _decide_without(
    task: _Task,
    sides: Placement,
    own: list[int],
    without: list[int],
    camera: RadialCamera,
    poses: list[GridPose | None],
) -> Decision:
    good = [n for n in range(len(own)) if n not in without]
    found = _decide_photo(task, sides, [own[n] for n in good], camera, poses)
    return _spread(found, good, len(own))


def _named_corners(task: _Task, own: list[int], decision: Decision) -> int:
    return sum(
        len(task.grids[index])
        for index, verdict in zip(own, decision.verdict, strict=True)
        if verdict is Decided.NAMED
    )


def _spread(found: Decision | None, part: Sequence[int], count: int) -> Decision:
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
        rotation=found.rotation if found else _NO_POSE[0],
        translation=found.translation if found else _NO_POSE[1],
    )


def _names(decision: Decision | None) -> tuple[object, ...]:
    if decision is None:
        return ()
    return (decision.verdict, tuple(decision.side), tuple(decision.offset.ravel()))


def _nameless_lens(task: _Task) -> RadialReference | None:
    """A lens from all grids as planes without names; None when they do not determine one."""
    if not task.grids:
        return None
    try:
        return fit_radial(anonymous_pairs(task.grids, task.image_size))
    except FitError:
        return None


def _poses(task: _Task, camera: RadialCamera | None) -> list[GridPose | None]:
    if camera is None:
        return [None] * len(task.grids)
    return grid_poses(camera, task.grids, task.image_size)


def _decide_photo(
    task: _Task,
    sides: Placement,
    own: list[int],
    camera: RadialCamera | None,
    poses: list[GridPose | None],
) -> Decision | None:
    """Verdicts for one photo's grids, in the order of ``own``; None without grids.

    ``sides`` are the boards where they are, ``task.sides`` as they are drawn.
    """
    if not own:
        return None
    usable = [
        n for n, index in enumerate(own)
        if task.reach[index].possible and (camera is None or poses[index] is not None)
    ]  # fmt: skip
    found = None
    if camera is not None and len(usable) > 1:
        views = []
        for n in usable:
            pose = poses[own[n]]
            if pose is not None:
                views.append(view_of(camera, task.grids[own[n]], pose, task.reach[own[n]]))
        labelings = search(views, sides)
        ends = [_ends(task, camera, own, own[n], poses) for n in usable]
        found = decide([task.grids[own[n]] for n in usable], task.sides, labelings, ends)
    part = usable
    if found is None and usable:
        part = usable[:1]
        index = own[part[0]]
        ends_alone = _ends(task, camera, own, index, poses) if camera else None
        found = decide_alone(task.grids[index], task.sides, task.reach[index], ends_alone)
        if found.verdict[0] is Decided.CONVENTION and _rivalled(task, own, usable):
            found = replace(found, verdict=(Decided.AMBIGUOUS,))
        alone = poses[index]
        if alone is not None:
            found = replace(found, rms_px=np.array([alone.rms_px]))
    decision = _spread(found, part, len(own))
    verdict = list(decision.verdict)
    for n, index in enumerate(own):
        if not task.reach[index].possible:
            wide = task.reach[index].wide_enough
            verdict[n] = Decided.COLOURS if wide else Decided.TOO_LARGE
        elif n not in usable:
            verdict[n] = Decided.NOT_PLANE
    return replace(decision, verdict=tuple(verdict))


def _rivalled(task: _Task, own: list[int], usable: list[int]) -> bool:
    """Whether another grid is nearly as large as the largest: which one is the board then?"""
    counts = [len(task.grids[own[n]]) for n in usable]
    return len(counts) > 1 and 2 * counts[1] > counts[0]


def _ends(
    task: _Task, camera: RadialCamera, own: list[int], index: int, poses: list[GridPose | None]
) -> Ends:
    pose = poses[index]
    if pose is None:
        raise ValueError("a grid without a pose has no ends")
    return ends_of(
        camera,
        task.grids[index],
        np.column_stack([pose.rotation[0][:, :2], pose.translation[0]]),
        np.concatenate([np.empty((0, 2)), *(task.grids[k].pixel for k in own if k != index)]),
        farthest_radius(camera, np.concatenate([grid.pixel for grid in task.grids])),
    )


def _named_lens(
    task: _Task,
    reference: RadialReference,
    decisions: list[Decision | None],
    poses: list[GridPose | None],
) -> RadialReference | None:
    """The lens fitted to settled photos as whole objects and to all other grids as planes."""
    parts: list[tuple[FloatArray, FloatArray]] = []
    rotation, translation = [], []
    for own, decision in zip(task.photos, decisions, strict=True):
        rigid = _rigid(decision)
        if decision is not None and rigid:
            world = np.concatenate([_world(task, own[n], decision, n) for n in rigid])
            pixel = np.concatenate([task.grids[own[n]].pixel for n in rigid])
            parts.append((world, pixel))
            rotation.append(decision.rotation)
            translation.append(decision.translation)
        for n, index in enumerate(own):
            pose = poses[index]
            if n in rigid or pose is None:
                continue
            cells = task.grids[index].cells
            plane = np.column_stack([cells, np.zeros(len(cells))]).astype(float)
            parts.append((plane, task.grids[index].pixel))
            rotation.append(pose.rotation[0])
            translation.append(pose.translation[0])
    if not parts:
        return None
    counts = [len(pixel) for _, pixel in parts]
    pairs = Correspondences(
        image_size=task.image_size,
        images=tuple(str(k) for k in range(len(parts))),
        boards=("object",),
        image=np.repeat(np.arange(len(parts)), counts),
        world=np.concatenate([world for world, _ in parts]),
        pixel=np.concatenate([pixel for _, pixel in parts]),
        weight=np.ones(sum(counts)),
        board=np.zeros(sum(counts), np.intp),
        column=np.concatenate([np.arange(count) for count in counts]),
        row=np.zeros(sum(counts), np.intp),
    )
    start = Poses(rotation=np.stack(rotation), translation=np.stack(translation))
    return refit_radial(reference, pairs, start)


def _rigid(decision: Decision | None) -> list[int]:
    """The named grids of a photo that are posed together: none or at least two."""
    if decision is None or np.isnan(decision.rotation).any():
        return []
    named = [n for n, verdict in enumerate(decision.verdict) if verdict is Decided.NAMED]
    return named if len(named) > 1 else []


def _world(task: _Task, index: int, decision: Decision, n: int) -> FloatArray:
    cells = task.sides.board_cells(
        int(decision.side[n]), decision.offset[n], task.grids[index].cells
    )
    board = int(task.sides.board[decision.side[n]])
    return task.target.boards[board].world_points(cells[:, 0], cells[:, 1])


def _identified(
    task: _Task,
    decisions: list[Decision | None],
    lens: RadialCamera | None,
    images: tuple[str, ...],
) -> Identified:
    reports: list[tuple[GridReport, ...]] = []
    rows: list[tuple[int, int, IntArray, FloatArray]] = []
    exact = np.ones(len(images), bool)
    for photo, (own, decision) in enumerate(zip(task.photos, decisions, strict=True)):
        in_order: dict[int, GridReport] = {}
        for n, index in enumerate(own):
            if decision is None:
                continue
            grid = task.grids[index]
            in_order[index] = report = _report(task, grid, decision, n)
            if report.place is not None:
                cells = task.sides.board_cells(
                    int(decision.side[n]), decision.offset[n], grid.cells
                )
                rows.append((photo, report.place.board, cells, grid.pixel))
                exact[photo] &= report.verdict is Decided.NAMED
        reports.append(tuple(in_order[index] for index in sorted(in_order)))
    counts = [len(pixel) for *_, pixel in rows]
    cells = np.concatenate([np.empty((0, 2), np.intp), *(row[2] for row in rows)])
    corners = Corners(
        image_size=task.image_size,
        images=images,
        boards=task.target.board_names,
        image=np.repeat(np.array([row[0] for row in rows], np.intp), counts),
        board=np.repeat(np.array([row[1] for row in rows], np.intp), counts),
        column=cells[:, 0],
        row=cells[:, 1],
        pixel=np.concatenate([np.empty((0, 2)), *(row[3] for row in rows)]),
        weight=np.ones(len(cells)),
        certain=np.repeat(exact[np.array([row[0] for row in rows], np.intp)], counts),
        target=task.target,
    )
    return Identified(
        corners=_sorted(corners),
        found=tuple(tuple(task.grids[index] for index in sorted(own)) for own in task.photos),
        grids=tuple(reports),
        lens=lens,
        exact=exact,
        other_colours=task.other_colours,
    )


def _report(task: _Task, grid: Grid, decision: Decision, n: int) -> GridReport:
    verdict = decision.verdict[n]
    place = None
    if verdict in (Decided.NAMED, Decided.CONVENTION):
        side = int(decision.side[n])
        place = Place(
            board=int(task.sides.board[side]),
            turn=int(task.sides.turn[side]),
            column=int(decision.offset[n, 0]),
            row=int(decision.offset[n, 1]),
        )
    width, height = np.ptp(grid.cells, axis=0) + 1
    return GridReport(
        verdict=verdict,
        place=place,
        corners=len(grid),
        size=(int(width), int(height)) if place is not None else solid_size(grid),
        ratio=float(decision.ratio[n]),
        rms_px=float(decision.rms_px[n]),
    )


def _sorted(corners: Corners) -> Corners:
    """By photo, board, row and column."""
    order = np.lexsort([corners.column, corners.row, corners.board, corners.image])
    return replace(
        corners,
        image=corners.image[order],
        board=corners.board[order],
        column=corners.column[order],
        row=corners.row[order],
        pixel=corners.pixel[order],
        weight=corners.weight[order],
        certain=corners.certain[order],
    )
