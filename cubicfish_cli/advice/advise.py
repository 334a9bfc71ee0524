"""The next photos to take, and how much each would lower the uncertainty.

For sampled poses the normal equations of the fit are extended by the corners that would be seen
from there, the pose's own six unknowns eliminated, and the uncertainty over the field is worked
out again. The best is taken, then the best after it, and so on: three good photos, not three of
the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.advice.gaps import (
    Gaps,
    find_gaps,
    photo_distances,
    place_words,
    tilt_words,
)
from cubicfish_cli.advice.knowledge import Knowledge, know, recorded_poses
from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.assess.uncertainty import FieldUncertainty, recorded_uncertainty, summed
from cubicfish_cli.assess.verdict import verdict
from cubicfish_cli.fitting.findings import FieldCells
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.uncertainty import Information, field_grid
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.rendering.views import Distances, Viewpoint, WholeLens, sample_views
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray
from cubicfish_cli.units import length_words
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

GOAL_PX = 0.2
"""Wanted over the field, for photos of up to :data:`GOAL_SIDE` pixels per side; larger ones in
proportion."""
GOAL_SIDE = 2000.0
PROPOSALS = 3
MOST_PHOTOS = 12
"""Photos are counted up to this many; beyond it another target or camera is the better advice."""
# Photos so far show where this camera is in focus and the target is in view: proposals go to half
# their nearest distance and to twice their farthest, and no farther.
_NEARER, _FARTHER = 0.5, 2.0
_VIEWS = 90
GRID = (21, 15)
"""Columns and rows over the photo of the uncertainty that pictures show."""
_FEWEST_PHOTOS = 3
# A fit again whose uncertainty differs by more than this factor is another one.
_SAME = 30.0
_ENOUGH_COVERAGE = 0.85
# A point of the grid belongs to a view when a corner is so near, as a share of the short side.
_NEAR = 0.1
# The picture beyond the trusted field counts as not seen yet below this share of its inner circle.
_SEEN_SHARE, _SEEN_WELL = 0.5, 0.9
# Most lenses that are called fisheyes show less than this to each side.
_WIDE_DEG = 85.0
_BEYOND_DEG = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal:
    """A photo to take.

    Attributes:
        view: from where, and what would be seen.
        words: that as an instruction.
        before, after: uncertainty over the field, with the proposals before this one.
        here_before_px, here_after_px: median uncertainty where the target would be.

    """

    view: Viewpoint
    words: str
    before: FieldUncertainty
    after: FieldUncertainty
    here_before_px: float
    here_after_px: float

    @property
    def gain(self) -> float:
        """Share of the median uncertainty over the field that it takes away."""
        return 1 - self.after.median_px / max(self.before.median_px, 1e-300)

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        rotation, translation = self.view.pose
        return {
            "words": self.words,
            "camera_from_world": {
                "rotation_vector": np.asarray(rotation).tolist(),
                "translation": np.asarray(translation).tolist(),
            },
            "corners": int(self.view.seen.visible.sum()),
            "distance": float(np.median(self.view.away)),
            "before": self.before.as_record(),
            "after": self.after.as_record(),
            "here_before_px": self.here_before_px,
            "here_after_px": self.here_after_px,
            "gain": self.gain,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Advice:
    """What to photograph next.

    Attributes:
        camera: the camera that it is about.
        target: the calibration target; None for pairs that came without one.
        pixel: (N, 2) corners so far.
        photos: how many there are.
        noise_px: standard deviation of a corner's coordinate, pixels; None where not worked out.
        goal_px: uncertainty that is wanted over the field.
        now: uncertainty; None where it cannot be worked out.
        grid: (G, 2) pixels in the field, and ``sigma`` (G,) the uncertainty there, pixels.
        sigma: see ``grid``.
        gaps: what photos so far do not show.
        enough: whether no more photos are needed.
        reasons: why it is not enough.
        photos_needed: how many more photos, as proposed here, reach the goal; None where more than
            :data:`MOST_PHOTOS` would not, or where that cannot be worked out.
        proposals: the next photos, in order.
        distances: how near and far they may be: half as near as photos so far, and twice as far;
            None where poses or the target are not known.
        notes: what cannot be said, or is to be kept in mind.

    """

    camera: CubicCamera
    target: Target | None
    pixel: FloatArray
    photos: int
    noise_px: float | None
    goal_px: float
    now: FieldUncertainty | None
    grid: FloatArray
    sigma: FloatArray
    gaps: Gaps
    enough: bool
    reasons: tuple[Finding, ...]
    photos_needed: int | None
    proposals: tuple[Proposal, ...]
    distances: Distances | None
    notes: tuple[Finding, ...]

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "enough": self.enough,
            "reasons": [reason.line for reason in self.reasons],
            "findings": [reason.as_record() for reason in self.reasons],
            "photos": self.photos,
            "photos_needed": self.photos_needed,
            "goal_px": self.goal_px,
            "noise_px": self.noise_px,
            "now": self.now.as_record() if self.now else None,
            "coverage": self.gaps.cells.coverage,
            "empty": [part.as_record() for part in self.gaps.parts],
            "tilts": list(self.gaps.tilts),
            "distances": list(self.gaps.distances),
            "proposals": [proposal.as_record() for proposal in self.proposals],
            "proposed_distances": [self.distances.near, self.distances.far]
            if self.distances
            else None,
            "notes": [note.line for note in self.notes],
            "remarks": [note.as_record() for note in self.notes],
        }


def default_goal(image_size: tuple[int, int]) -> float:
    """The uncertainty that is wanted where nobody says, pixels."""
    return GOAL_PX * max(1.0, max(image_size) / GOAL_SIDE)


def advise(
    camera: CubicCamera,
    fit: Mapping[str, Any],
    pairs: Observations,
    target: Target | None,
    *,
    goal_px: float | None = None,
    proposals: int = PROPOSALS,
    seed: int = 0,
) -> Advice:
    """Say what photos so far leave open and what to photograph next.

    Args:
        camera: a calibrated camera.
        fit: its record, as ``as_record`` of a calibration gives and camera.yaml keeps.
        pairs: the pairs that it was fitted to, world points those of the target as fitted.
        target: the calibration target as fitted; None for pairs that came without one.
        goal_px: uncertainty wanted over the field; by default :func:`default_goal`.
        proposals: how many photos to propose.
        seed: of the poses that are tried.

    Raises:
        FitError: pairs and camera do not belong together.

    """
    goal = goal_px or default_goal(camera.image_size)
    poses = recorded_poses(fit, pairs.images)
    gaps = find_gaps(camera, pairs, poses, target)
    notes: list[Finding] = []
    if poses is None:
        notes.append(Finding(code=Code.NO_POSES))
    knowledge = None if poses is None else know(camera, fit, pairs, poses, target)
    own = camera if knowledge is None else knowledge.camera
    field = _Field(camera=own, blind=gaps.cells.blind)
    sigma = np.full(len(field.grid), np.nan)
    now = None
    noise = knowledge.information.noise_px if knowledge else None
    if knowledge is not None:
        knowledge, now = _as_recorded(knowledge, fit, field)
        sigma = field.sigma_px(knowledge.information)
    reasons = why_not_enough(now, goal, gaps, len(pairs.images), camera)
    judged = verdict(fit, camera.image_size, camera.outline())
    if judged.level == "bad":
        first = judged.reasons[0]
        said = {"against": first.why, "mend": first.do}
        reasons.insert(0, Finding(code=Code.NOT_TRUSTED, severity=Severity.BAD, figures=said))
    notes += _beyond(camera)
    if field.blind:
        figures = {"blind_deg": float(np.degrees(field.blind))}
        notes.append(Finding(code=Code.MIDDLE_UNSEEN, figures=figures))
    within = None if poses is None or target is None else distances_within(pairs, poses)
    found: tuple[Proposal, ...] = ()
    needed: int | None = 0
    if reasons:
        needed = None
        views = _views(knowledge, target, within, notes, field, seed)
        if knowledge is not None and views:
            found, needed = _proposed(knowledge, views, gaps.cells, field, goal, proposals)
        short = _FEWEST_PHOTOS - len(pairs.images)
        needed = None if needed is None else max(needed, short, 1)
    return Advice(
        camera=camera,
        target=target,
        pixel=pairs.pixel,
        photos=len(pairs.images),
        noise_px=noise,
        goal_px=goal,
        now=now,
        grid=field.grid,
        sigma=sigma,
        gaps=gaps,
        enough=not reasons,
        reasons=tuple(reasons),
        photos_needed=needed,
        proposals=found,
        distances=within,
        notes=tuple(notes),
    )


def distances_within(pairs: Observations, poses: Poses) -> Distances:
    """From how near to how far photos may be proposed, by what photos so far show."""
    typical, nearest = photo_distances(pairs, poses)
    return Distances(
        near=_NEARER * float(typical.min()),
        far=_FARTHER * float(typical.max()),
        nearest=_NEARER * float(nearest.min()),
    )


def _as_recorded(
    knowledge: Knowledge, fit: Mapping[str, Any], field: _Field
) -> tuple[Knowledge, FieldUncertainty]:
    """The knowledge with the uncertainty that the record has, to the last digit, and that.

    Where the target was fitted too, a fit that begins at its end differs by a few percent.
    """
    own, known = field.summed(knowledge.information), recorded_uncertainty(fit)
    if known is None or not 1 / _SAME < known.median_px / own.median_px < _SAME:
        return knowledge, own
    noise_px = knowledge.information.noise_px * known.median_px / own.median_px
    scaled = replace(knowledge.information, noise_px=noise_px)
    return replace(knowledge, information=scaled), known


def why_not_enough(
    now: FieldUncertainty | None, goal: float, gaps: Gaps, photos: int, camera: CubicCamera
) -> list[Finding]:
    """Why photos so far are not enough; nothing where they are."""
    reasons = []
    care = partial(Finding, severity=Severity.CARE)
    if photos < _FEWEST_PHOTOS:
        reasons.append(care(code=Code.FEW_PHOTOS))
    if now is not None and now.p95_px > goal:
        figures = {"p95_px": now.p95_px, "goal_px": goal}
        reasons.append(care(code=Code.NOT_CERTAIN, figures=figures))
    if gaps.cells.coverage < _ENOUGH_COVERAGE:
        figures = {"share": gaps.cells.coverage}
        reasons.append(care(code=Code.LOW_COVERAGE, case="advice", figures=figures))
    if seen_share(camera) < _SEEN_SHARE:
        figures = {"known_deg": camera.max_angle_deg}
        reasons.append(care(code=Code.SMALL_FIELD, case="advice", figures=figures))
    return reasons


def seen_share(camera: CubicCamera) -> float:
    """Area of the trusted field over that of the largest circle in the picture."""
    x, y = camera.outline().T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    return float(area / (np.pi * (min(camera.image_size) / 2) ** 2))


def _beyond(camera: CubicCamera) -> list[Finding]:
    """A reminder where the lens may well show more than the trusted field."""
    if camera.max_angle_deg >= _WIDE_DEG and seen_share(camera) >= _SEEN_WELL:
        return []
    width, height = camera.image_size
    x, y = camera.outline().T
    inside = (x > 0.5) & (y > 0.5) & (x < width - 1.5) & (y < height - 1.5)
    if inside.mean() < 0.05:
        return []
    return [Finding(code=Code.RIM_UNKNOWN, figures={"known_deg": camera.max_angle_deg})]


@dataclass(frozen=True, eq=False)
class _Field:
    """The trusted field without where the camera sees itself: what uncertainty is told of.

    Attributes:
        camera: whose field it is.
        blind: how far from its axis the camera sees itself, radians.

    """

    camera: CubicCamera
    blind: float

    @cached_property
    def grid(self) -> FloatArray:
        """(G, 2) pixels over it, those that pictures show."""
        width, height = self.camera.image_size
        x, y = ((np.arange(n) + 0.5) / n for n in GRID)
        pixel = np.stack(np.meshgrid(x * width - 0.5, y * height - 0.5), axis=-1).reshape(-1, 2)
        seen = angle_from_axis(self.camera.unproject(pixel)) >= self.blind
        return np.asarray(pixel[seen])

    @cached_property
    def _rays(self) -> FloatArray:
        """(N, 3) rays over it, those that camera.yaml's figures are of."""
        rays = field_grid(self.camera, self.blind)[2].reshape(-1, 3)
        return np.asarray(rays[np.isfinite(rays[:, 0])])

    def sigma_px(self, known: Information) -> FloatArray:
        """(G,) the uncertainty at each pixel of the grid."""
        return known.uncertainty().sigma_px(self.camera.unproject(self.grid))

    def summed(self, known: Information) -> FieldUncertainty:
        """The uncertainty over all of it."""
        return summed(known.uncertainty().sigma_px(self._rays))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reach:
    """The radial reference as far as it may be asked where a target would be seen."""

    camera: RadialCamera
    limit: float
    blind: float

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        angle = angle_from_axis(points)
        seen = (angle >= self.blind) & (angle <= self.limit)
        return np.where(seen[..., None], self.camera.project(points), np.nan)

    def unproject(self, pixel: npt.ArrayLike, /) -> FloatArray:
        rays = self.camera.unproject(pixel)
        with np.errstate(invalid="ignore"):
            inside = rays[..., 2] >= np.cos(self.limit)
        return np.where(inside[..., None], rays, np.nan)


def reach_of(camera: CubicCamera, more_deg: float = 0.0, blind: float = 0.0) -> WholeLens:
    """A lens for where a target would be seen, somewhat beyond the trusted field too.

    Within ``blind`` radians of the axis nothing is.
    """
    limit = float(np.deg2rad(camera.max_angle_deg + _BEYOND_DEG + more_deg))
    return _Reach(camera=camera.radial, limit=min(limit, camera.radial.max_angle), blind=blind)


def rim_of(camera: CubicCamera, count: int = 180) -> FloatArray:
    """(count, 2) the rim of what :func:`reach_of` sees, within the photo or not, pixels."""
    limit = float(np.deg2rad(camera.max_angle_deg + _BEYOND_DEG))
    angle = min(limit, camera.radial.max_angle) - 1e-6
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    sine = np.sin(angle)
    rays = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(count, np.cos(angle))], -1)
    return camera.radial.project(rays)


def _views(
    knowledge: Knowledge | None,
    target: Target | None,
    within: Distances | None,
    notes: list[Finding],
    field: _Field,
    seed: int,
) -> list[Viewpoint]:
    """Poses to choose from; where there can be none, ``notes`` says why."""
    if target is None:
        notes.append(Finding(code=Code.NO_TARGET))
        return []
    if any(board.points is not None for board in target.boards):
        notes.append(Finding(code=Code.NO_SIDE))
        return []
    if knowledge is None:
        return []
    lens = reach_of(field.camera, blind=field.blind)
    views = sample_views(target, lens, field.camera.image_size, _VIEWS, seed=seed, within=within)
    if not views:
        where = f", {distances_words(within, target.units)}" if within else ""
        notes.append(Finding(code=Code.NO_VIEW, figures={"nearness": where}))
    return views


def _proposed(
    knowledge: Knowledge,
    views: Sequence[Viewpoint],
    cells: FieldCells,
    field: _Field,
    goal: float,
    proposals: int,
) -> tuple[tuple[Proposal, ...], int | None]:
    """The next photos, and how many of them reach the goal."""
    points = [knowledge.points(view) for view in views]
    filled = np.array([_filled(view, cells) for view in views])
    empty, squares = cells.empty, max(cells.field.sum(), 1)
    chosen: list[Viewpoint] = []
    # The same photo twice would say little that is new of a real lens and a real target.
    taken = np.zeros(len(views), bool)
    state = knowledge.information
    level = field.summed(state)
    needed = None
    while len(chosen) < MOST_PHOTOS and not taken.all():
        tried = [state.with_photo(own) for own in points]
        sums = [field.summed(one) for one in tried]
        fill = (filled & empty).sum(axis=(1, 2)) / squares
        left = np.array([_left(after, level) for after in sums])
        best = int(np.argmin(np.where(taken, np.inf, left - fill)))
        state, level = tried[best], sums[best]
        empty &= ~filled[best]
        taken[best] = True
        chosen.append(views[best])
        covered = 1 - empty.sum() / squares >= _ENOUGH_COVERAGE
        if needed is None and level.p95_px <= goal and covered:
            needed = len(chosen)
        if len(chosen) >= proposals and needed is not None:
            break
    return _told(knowledge, chosen[:proposals], field), needed


def _filled(view: Viewpoint, cells: FieldCells) -> BoolArray:
    """Which squares of the picture (rows, columns) a view puts corners into."""
    column, row = np.floor(view.pixel / cells.cell).astype(int).T
    inside = (row >= 0) & (column >= 0)
    inside &= (row < cells.field.shape[0]) & (column < cells.field.shape[1])
    filled = np.zeros_like(cells.field)
    filled[row[inside], column[inside]] = True
    return filled


def distances_words(within: Distances, units: str) -> str:
    """``8.0 cm to 60 cm away (...)``, with why."""
    return (
        f"{length_words(within.near, units)} to {length_words(within.far, units)} away (from half "
        "the nearest to twice the farthest of the photos so far)"
    )


def _left(after: FieldUncertainty, before: FieldUncertainty) -> float:
    """How much of the uncertainty is left, on the whole and where it is worst."""
    return (after.median_px / before.median_px + after.p95_px / before.p95_px) / 2


def _told(knowledge: Knowledge, chosen: Sequence[Viewpoint], field: _Field) -> tuple[Proposal, ...]:
    """The chosen views in words, with what they bring, the target being as free as in the fit."""
    units = knowledge.target.units if knowledge.target else ""
    near = _NEAR * min(field.camera.image_size)
    state: Information = knowledge.information
    before, level = field.sigma_px(state), field.summed(state)
    told = []
    for number, view in enumerate(chosen, start=1):
        state = knowledge.with_views(chosen[:number])
        after, next_level = field.sigma_px(state), field.summed(state)
        apart = np.linalg.norm(field.grid[:, None] - view.pixel, axis=-1).min(axis=1)
        here = apart <= near if (apart <= near).any() else apart <= apart.min()
        told.append(
            Proposal(
                view=view,
                words=f"the target {place_words(view.direction)}, its corners about "
                f"{length_words(float(np.median(view.away)), units)} away, "
                f"{tilt_words(view.front, view.direction)}",
                before=level,
                after=next_level,
                here_before_px=float(np.median(before[here])),
                here_after_px=float(np.median(after[here])),
            )
        )
        before, level = after, next_level
    return tuple(told)


HEED_FIRST = "heed the verdict first"
NOISE_ALONE = "heed the verdict first; by the uncertainty alone"
_PARTS = 2


def summary(camera: CubicCamera, fit: Mapping[str, Any], pairs: Observations) -> str:
    """Whether more photos are needed, and of which parts of the picture, in one line.

    Args:
        camera: a calibrated camera.
        fit: its record, as ``as_record`` of a calibration gives and camera.yaml keeps.
        pairs: the pairs that it was fitted to.

    """
    gaps = find_gaps(camera, pairs, None, None)
    now = recorded_uncertainty(fit)
    goal = default_goal(camera.image_size)
    reasons = why_not_enough(now, goal, gaps, len(pairs.images), camera)
    judged = verdict(fit, camera.image_size, camera.outline())
    if judged.level == "bad" and not (judged.asks_for_photos and gaps.parts):
        return f"{HEED_FIRST}: {judged.reasons[0].do}"
    if not reasons:
        known = f", and 95 % of it is certain to {now.p95_px:.3f} px" if now else ""
        wanted = f" (goal: {goal:g} px)" if now else ""
        # The corners' noise may ask for no more photos, and held-out errors for some all the same.
        begin = f"{NOISE_ALONE} photos are enough" if judged.asks_for_photos else "enough photos"
        return (
            f"{begin}: corners cover {100 * gaps.cells.coverage:.0f} % of the field{known}{wanted}"
        )
    where = "; ".join(part.words for part in gaps.parts[:_PARTS])
    next_ones = f"show the target next at: {where}" if where else f"more photos: {reasons[0]}"
    return f"{next_ones} ('cubicfish advise' says from where)"
