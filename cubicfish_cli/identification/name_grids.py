"""Grids of all photos -> named corners: which board each grid is, and where on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.identification.as_built import decided_as_built
from cubicfish_cli.identification.decide import Decided, Decision, rim_in_doubt
from cubicfish_cli.identification.ends import solid, solid_size
from cubicfish_cli.identification.grid_views import grid_poses
from cubicfish_cli.identification.identified import GridReport, Identified, Place
from cubicfish_cli.identification.scene import Decisions, Scene, named_lens, nameless_lens, spread
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.placement import Placement, reach_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

# Times the lens is fitted again with the names so far, before what is left is given up.
_ROUNDS = 3
# Named grids must be this many before their RMS says which is too large, and how much that is.
_LEAST_GRIDS_TO_COMPARE = 6
_MISFIT_RATIO = 6.0
# A lens whose focal length is known this well, as a share of it, gains nothing from names.
_GOOD_FOCAL = 0.005


def name_grids(
    grids: Sequence[Sequence[Grid]],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Identified:
    """Name every grid that can be named beyond doubt; the others are left out and reported.

    A radial lens is fitted to all grids as nameless planes first. Photo by photo, the places
    of all grids on the target are then searched with that lens; where a photo stays unsettled,
    the lens is fitted again with the names found so far and the search repeated.

    Args:
        grids: for each photo, its grids.
        target: the calibration target.
        image_size: (width, height) of all photos, pixels.
        images: the photos' names.

    """
    scene = Scene.of(grids, target, image_size)
    decisions = _decided(scene)
    if scene.camera is not None:
        sides, decisions = decided_as_built(scene, decisions)
        _cut_unnamed(scene, scene.camera, sides, decisions)
        decisions = _without_misfits(scene, sides, decisions)
    return _identified(scene, _with_doubts(scene, decisions), tuple(images))


def name_again(
    identified: Identified,
    photos: Sequence[int] | IntArray,
    target: Target,
    grids: Sequence[Sequence[Grid]] | None = None,
) -> Identified:
    """Name the grids of some photos as they would be if the target were drawn otherwise.

    Args:
        identified: what became of all grids.
        photos: indices of the photos.
        target: the other drawing.
        grids: for each of these photos, other grids in place of its own.

    """
    corners = identified.corners
    own = [identified.found[photo] for photo in photos] if grids is None else grids
    return name_grids(own, target, corners.image_size, [corners.images[i] for i in photos])


def _decided(scene: Scene) -> Decisions:
    """The names as the boards are drawn, under the best lens that they give."""
    reference = nameless_lens(scene)
    decisions: Decisions = []
    before: list[tuple[object, ...]] = []
    for _ in range(_ROUNDS):
        scene.see_through(reference.camera if reference else None)
        scene.place_grids()
        decisions = scene.decide_all(scene.sides)
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
        reference = named_lens(scene, reference, decisions) or reference
    scene.see_through(reference.camera if reference else None)
    return decisions


def _cut_unnamed(
    scene: Scene, camera: RadialCamera, sides: Placement, decisions: Decisions
) -> None:
    """Cut what may be strays off grids that have no name, where they have one without them.

    With strays a grid may still fit a larger board of the target, and then nothing is in its way.
    """
    for photo, own in enumerate(scene.photos):
        before = decisions[photo]
        if before is None:
            continue
        cut = {
            index: part
            for n, index in enumerate(own)
            if before.verdict[n] is not Decided.NAMED
            and len(part := solid(scene.grids[index])) < len(scene.grids[index])
        }
        if not cut:
            continue
        kept = {
            index: (scene.grids[index], scene.reach[index], scene.poses[index]) for index in cut
        }
        poses = grid_poses(camera, list(cut.values()), scene.image_size)
        for (index, part), pose in zip(cut.items(), poses, strict=True):
            scene.put(index, part, reach_of(part.cells, part.parity, scene.sides), pose)
        after = scene.decide(sides, own)
        if after is not None and scene.named_corners(own, after) > scene.named_corners(own, before):
            decisions[photo] = after
            continue
        for index, whole in kept.items():
            scene.put(index, *whole)


def _without_misfits(scene: Scene, sides: Placement, decisions: Decisions) -> Decisions:
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
    for photo, (own, decision) in enumerate(zip(scene.photos, decisions, strict=True)):
        if decision is None or not (decision.rms_px > limit).any():
            continue
        bad = np.flatnonzero(decision.rms_px > limit).tolist()
        # One grid in a wrong place spoils the pose, and with it the fit of all others.
        trials = [[n] for n in bad] + ([bad] if len(bad) > 1 else [])
        again = [_decide_without(scene, sides, own, trial) for trial in trials]
        sound = [one for one in again if not (one.rms_px > limit).any()]
        checked[photo] = max(sound or again[-1:], key=lambda one: scene.named_corners(own, one))
    return checked


def _with_doubts(scene: Scene, decisions: Decisions) -> Decisions:
    """Take a grid that may hold a stray line for placed by convention.

    Only where it is alone: other boards of the target would not fit if it lay elsewhere.
    """
    checked = list(decisions)
    for photo, (own, decision) in enumerate(zip(scene.photos, decisions, strict=True)):
        if decision is None or decision.verdict.count(Decided.NAMED) != 1:
            continue
        n = decision.verdict.index(Decided.NAMED)
        board = int(scene.sides.board[decision.side[n]])
        if rim_in_doubt(scene.grids[own[n]], scene.sides, board, scene.ends(own, own[n])):
            verdict = list(decision.verdict)
            verdict[n] = Decided.CONVENTION
            checked[photo] = replace(decision, verdict=tuple(verdict))
    return checked


def _decide_without(
    scene: Scene, sides: Placement, own: Sequence[int], without: Sequence[int]
) -> Decision:
    good = [n for n in range(len(own)) if n not in without]
    return spread(scene.decide(sides, [own[n] for n in good]), good, len(own))


def _names(decision: Decision | None) -> tuple[object, ...]:
    if decision is None:
        return ()
    return (decision.verdict, tuple(decision.side), tuple(decision.offset.ravel()))


def _identified(
    scene: Scene,
    decisions: Decisions,
    images: tuple[str, ...],
) -> Identified:
    reports: list[tuple[GridReport, ...]] = []
    rows: list[tuple[int, int, IntArray, FloatArray]] = []
    exact = np.ones(len(images), bool)
    for photo, (own, decision) in enumerate(zip(scene.photos, decisions, strict=True)):
        known: dict[int, GridReport] = {}
        for n, index in enumerate(own):
            if decision is None:
                continue
            grid = scene.grids[index]
            known[index] = report = _report(scene, grid, decision, n)
            if report.place is not None:
                cells = scene.cells(index, decision, n)
                rows.append((photo, report.place.board, cells, grid.pixel))
                exact[photo] &= report.verdict is Decided.NAMED
        reports.append(tuple(known[index] for index in sorted(known)))
    counts = [len(pixel) for *_, pixel in rows]
    cells = np.concatenate([np.empty((0, 2), np.intp), *(row[2] for row in rows)])
    corners = Observations(
        image_size=scene.image_size,
        images=images,
        boards=scene.target.board_names,
        image=np.repeat(np.array([row[0] for row in rows], np.intp), counts),
        board=np.repeat(np.array([row[1] for row in rows], np.intp), counts),
        column=cells[:, 0],
        row=cells[:, 1],
        pixel=np.concatenate([np.empty((0, 2)), *(row[3] for row in rows)]),
        certain=np.repeat(exact[np.array([row[0] for row in rows], np.intp)], counts),
    )
    return Identified(
        corners=corners.with_target(scene.target).in_order(),
        found=tuple(tuple(scene.grids[index] for index in sorted(own)) for own in scene.photos),
        grids=tuple(reports),
        lens=scene.camera,
        exact=exact,
        other_colours=scene.other_colours,
        scene=scene,
    )


def _report(scene: Scene, grid: Grid, decision: Decision, n: int) -> GridReport:
    verdict = decision.verdict[n]
    place = None
    if verdict in (Decided.NAMED, Decided.CONVENTION):
        side = int(decision.side[n])
        place = Place(
            board=int(scene.sides.board[side]),
            turn=int(scene.sides.turn[side]),
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
