"""Grids of all photos -> named corners: which board each grid is, and where on it.

Where the boards really are: a target is never quite nominal.

A box glued by hand is off by millimetres. Then the right names fit badly, and a symmetry of the
nominal target is none of the target: names that differ from photo to photo by such a symmetry would
blur it. Each named grid says where its board is in front of the camera, so the photos together
say how the boards lie to each other, and names that fit this target agree from photo to photo.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cubicfish.errors import FitError
from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.decide import Decision, rim_in_doubt
from cubicfish.find.identification.ends import solid
from cubicfish.find.identification.identified import Decided, GridReport, Identified, Place
from cubicfish.find.identification.scene import (
    Decisions,
    Scene,
    anonymous_pairs,
    named_lens,
    rigid,
    spread,
)
from cubicfish.fit.radial_reference import RadialReference, fit_radial
from cubicfish.geometry import mean_rotation
from cubicfish.target.observations import Observations
from cubicfish.target.placement import Placement
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray, IntArray

# Times the lens is fitted again with the names so far, before what is left is given up.
_ROUNDS = 3
# Named grids must be this many before their RMS says which is too large, and how much that is.
_LEAST_GRIDS_TO_COMPARE = 6
_MISFIT_RATIO = 6.0
# A lens whose focal length is known this well, as a share of it, gains nothing from names.
_GOOD_FOCAL = 0.005


@one_blas_thread()
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
    try:
        reference = fit_radial(anonymous_pairs(scene.grids, image_size)) if scene.grids else None
    except FitError:  # planes without names need not determine a lens
        reference = None
    scene, decisions = _decide_nominally(scene, reference)
    if scene.camera is not None:
        sides, decisions = decided_as_built(scene, decisions)
        scene, decisions = _cut_unnamed(scene, sides, decisions)
        decisions = _leave_out_misfits(scene, sides, decisions)
    return _make_identified(scene, _doubt_strays(scene, decisions), tuple(images))


def name_again(
    identified: Identified,
    photos: Sequence[int] | IntArray,
    target: Target,
    grids: Sequence[Sequence[Grid]] | None = None,
) -> Identified:
    """Name the grids of some photos as they would be if the nominal target were another.

    Args:
        identified: what became of all grids.
        photos: indices of the photos.
        target: the other nominal target.
        grids: for each of these photos, other grids in place of its own.

    """
    corners = identified.corners
    own = [identified.found[photo] for photo in photos] if grids is None else grids
    return name_grids(own, target, corners.image_size, [corners.images[i] for i in photos])


def _decide_nominally(scene: Scene, reference: RadialReference | None) -> tuple[Scene, Decisions]:
    """The names by the nominal boards, and the scene under the best lens that they give.

    ``reference`` is the lens that they give without names.
    """
    decisions: Decisions = []
    before: Sequence[object] = []
    for _ in range(_ROUNDS):
        scene = scene.seen_through(reference.camera if reference else None).placed()
        decisions = scene.decide_all(scene.sides)
        names = [(one.verdict, one.side.tolist(), one.offset.tolist()) for one in decisions]
        verdicts = {verdict for one in decisions for verdict in one.verdict}
        unsettled = not verdicts.isdisjoint((Decided.AMBIGUOUS, Decided.NO_FIT))
        if reference is None or not unsettled or names == before:
            break
        if reference.focal_uncertainty < _GOOD_FOCAL:
            break
        before = names
        reference = named_lens(scene, reference, decisions) or reference
    return scene.seen_through(reference.camera if reference else None), decisions


def _cut_unnamed(scene: Scene, sides: Placement, decisions: Decisions) -> tuple[Scene, Decisions]:
    """Cut what may be strays off grids that have no name, where they have one without them.

    With strays a grid may still fit a larger board of the target, and then nothing is in its way.
    """
    decided = list(decisions)
    for photo, own in enumerate(scene.photos):
        before = decisions[photo]
        unnamed = [
            index
            for index, verdict in zip(own, before.verdict, strict=True)
            if verdict is not Decided.NAMED
        ]
        parts = {index: solid(scene.grids[index]) for index in unnamed}
        cut = {k: part for k, part in parts.items() if len(part) < len(scene.grids[k])}
        if not cut:
            continue
        trial = scene.with_grids(cut)
        after = trial.decide(sides, own)
        if trial.named_corners(own, after) > scene.named_corners(own, before):
            scene, decided[photo] = trial, after
    return scene, decided


def _leave_out_misfits(scene: Scene, sides: Placement, decisions: Decisions) -> Decisions:
    """Decide photos again without grids that fit far worse than the grids of the other photos.

    A grid that is no board of the target may fit a place by chance, within the width of the
    first gate, which must allow for targets that are not quite nominal.
    """
    rms = np.concatenate([np.empty(0), *(decision.rms_px for decision in decisions)])
    rms = rms[np.isfinite(rms)]
    if len(rms) < _LEAST_GRIDS_TO_COMPARE:
        return decisions
    limit = _MISFIT_RATIO * float(np.median(rms))
    checked = list(decisions)
    for photo, (own, decision) in enumerate(zip(scene.photos, decisions, strict=True)):
        bad = np.flatnonzero(decision.rms_px > limit).tolist()
        if not bad:
            continue
        # One grid in a wrong place spoils the pose, and with it the fit of all others.
        trials = [[n] for n in bad] + ([bad] if len(bad) > 1 else [])
        again = [_decide_without(scene, sides, own, trial) for trial in trials]
        sound = [one for one in again if not (one.rms_px > limit).any()]
        checked[photo] = max(sound or again[-1:], key=lambda one: scene.named_corners(own, one))
    return checked


def _doubt_strays(scene: Scene, decisions: Decisions) -> Decisions:
    """Take a grid that may hold a stray line for placed by convention.

    Only where it is alone: other boards of the target would not fit if it lay elsewhere.
    """
    checked = list(decisions)
    for photo, (own, decision) in enumerate(zip(scene.photos, decisions, strict=True)):
        if decision.verdict.count(Decided.NAMED) != 1:
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


def _make_identified(
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
        exact=exact,
        other_colours=scene.other_colours,
        scene=scene,
    )


def _report(scene: Scene, grid: Grid, decision: Decision, n: int) -> GridReport:
    verdict = decision.verdict[n]
    place, extent = None, (0, 0)
    if verdict in (Decided.NAMED, Decided.CONVENTION):
        side = int(decision.side[n])
        place = Place(
            board=int(scene.sides.board[side]),
            turn=int(scene.sides.turn[side]),
            column=int(decision.offset[n, 0]),
            row=int(decision.offset[n, 1]),
        )
        board = scene.target.boards[place.board]
        extent = board.columns, board.rows
    # Of what was left out, lines of hardly any corners say nothing of its size.
    shown = grid if place is not None else solid(grid)
    columns, rows = (np.ptp(shown.cells, axis=0) + 1).tolist()
    return GridReport(
        verdict=verdict,
        place=place,
        corners=len(grid),
        size=(columns, rows),
        rms_px=float(decision.rms_px[n]),
        whole=sorted((columns, rows)) == sorted(extent),
    )


# Grids that fit the target this much worse than planes of their own, and miss it by this share
# of the distance of neighbouring corners: it is not nominal.
_OFF_RATIO, _OFF_STEPS = 1.5, 0.01
# One photo fits whatever it measures, so that several must show boards together.
_LEAST_PHOTOS_TO_MEASURE = 3


def decided_as_built(scene: Scene, decisions: Decisions) -> tuple[Placement, Decisions]:
    """Decide again with the boards where the photos have them, if they are not at their nominal
    places.

    The photo that shows most says how the boards lie first, so that all names agree with one
    photo's; all photos say it then. Kept only if it explains more, or the same better.
    """
    photos = range(len(decisions))
    together = sum(bool(rigid(decision)) for decision in decisions)
    if together < _LEAST_PHOTOS_TO_MEASURE or not _are_boards_elsewhere(scene, decisions):
        return scene.sides, decisions
    built, trial = scene.sides, decisions
    reference = max(photos, key=lambda photo: _count_extent(scene, decisions, photo))
    for some in ([reference], photos):
        sightings = [one for photo in some for one in _list_sightings(scene, trial, photo)]
        built = built_sides(built, sightings)
        trial = scene.decide_all(built)
    others = [photo for photo in photos if photo != reference]
    if _rate_names(scene, trial, others) > _rate_names(scene, decisions, others):
        return built, trial
    return scene.sides, decisions


class Sighting(NamedTuple):
    """Where one photo has one board.

    Attributes:
        board: index into the target's boards.
        weight: the square of how many corners say so.
        turned: (3, 3) world directions of its columns, rows and depth.
        place: (2,) the middle of what is seen, on the board.
        point: (3,) that in the world.

    """

    board: int
    weight: float
    turned: FloatArray
    place: FloatArray
    point: FloatArray


def built_sides(sides: Placement, sightings: Sequence[Sighting]) -> Placement:
    """The sides with every board where the sightings have it on average.

    Boards without a sighting stay where they are.
    """
    origin, axes = sides.origin.copy(), sides.axes.copy()
    for board in {one.board for one in sightings}:
        own = [one for one in sightings if one.board == board]
        _, weight, turned, place, point = map(np.array, zip(*own, strict=True))
        mean = mean_rotation(turned, weight)
        rows = np.flatnonzero(sides.board == board)
        origin[rows] = np.average(point - place @ mean[:, :2].T, axis=0, weights=weight)
        axes[rows] = mean[:, :2]
    return replace(sides, origin=origin, axes=axes)


def _are_boards_elsewhere(scene: Scene, decisions: Decisions) -> bool:
    """Whether named grids fit the target clearly worse than planes of their own."""
    ratio, share = [], []
    for own, decision in zip(scene.photos, decisions, strict=True):
        for n in rigid(decision):
            pose = scene.poses[own[n]]
            if pose is not None:
                ratio.append(decision.rms_px[n] / max(pose.rms_px, 1e-3))
                share.append(decision.rms_px[n] / scene.grids[own[n]].step)
    return bool(ratio) and bool(np.median(ratio) > _OFF_RATIO and np.median(share) > _OFF_STEPS)


def _count_extent(scene: Scene, decisions: Decisions, photo: int) -> tuple[int, int]:
    """Boards and corners that a photo shows together."""
    decision = decisions[photo]
    named = rigid(decision)
    if not named:
        return 0, 0
    boards = len(np.unique(scene.sides.board[decision.side[named]]))
    return boards, sum(len(scene.grids[scene.photos[photo][n]]) for n in named)


def _list_sightings(scene: Scene, decisions: Decisions, photo: int) -> list[Sighting]:
    decision, sides, seen = decisions[photo], scene.sides, []
    for n in rigid(decision):
        index = scene.photos[photo][n]
        pose, cells = scene.poses[index], scene.grids[index].cells
        if pose is None:
            continue
        side, middle = decision.side[n], cells.mean(axis=0)
        square, back = sides.square[side], np.eye(3)
        back[:2, :2] = sides.matrix[side].T
        in_camera = square * (pose.rotation[0][:, :2] @ middle + pose.translation[0])
        seen.append(
            Sighting(
                board=int(sides.board[side]),
                weight=float(len(cells) ** 2),
                turned=decision.rotation.T @ pose.rotation[0] @ back,
                place=square * (sides.matrix[side] @ middle + decision.offset[n]),
                point=decision.rotation.T @ (in_camera - decision.translation),
            )
        )
    return seen


def _rate_names(scene: Scene, decisions: Decisions, photos: Sequence[int]) -> tuple[int, float]:
    """Corners named exactly, then how well they fit, in some photos."""
    corners, square = 0, 0.0
    for photo in photos:
        decision = decisions[photo]
        for n, index in enumerate(scene.photos[photo]):
            if decision.verdict[n] is Decided.NAMED:
                corners += len(scene.grids[index])
                square += len(scene.grids[index]) * np.nan_to_num(decision.rms_px[n]) ** 2
    return corners, -float(square)
