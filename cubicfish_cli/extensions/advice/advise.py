"""What photos so far leave open, what to photograph next, and whether that is needed."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish import Calibration, CameraFile, CubicCamera, Finding, Observations, Target
from cubicfish.judge import Code, FieldUncertainty
from cubicfish.scene import Distances, Scene, Viewpoint
from cubicfish.solve import Poses
from cubicfish.sufficiency import CoverageGaps, Goal, Knowledge
from cubicfish.threads import one_blas_thread
from cubicfish_cli.extensions.advice.limited_lens import LimitedLens, limited_lens
from cubicfish_cli.extensions.advice.proposals import Proposal, proposed
from cubicfish_cli.words.sentences import record_of, render
from cubicfish_cli.words.sufficiency import gap_words

PROPOSALS = 3
# Photos so far show where this camera is in focus and the target is in view: proposals lie between
# half their nearest distance and twice their farthest.
_NEARER, _FARTHER = 0.5, 2.0
_VIEWS = 90


@dataclass(frozen=True, kw_only=True, eq=False)
class Advice:
    """What to photograph next.

    Attributes:
        camera: the camera.
        target: the calibration target; None for pairs that came without one.
        pairs: the corners so far.
        noise_px: standard deviation of a corner's coordinate, pixels; None if it is not known.
        goal_px: uncertainty that proposals aim at over the field.
        now: uncertainty; None if it is not known.
        gaps: what photos so far do not show.
        reasons: why these are not enough.
        photos_needed: how many more photos, as proposed here, reach the goal; None if
            :data:`MOST_PHOTOS` do not reach it, or if that is not known or was not wanted.
        proposals: the next photos, in order.
        notes: remarks: what is not known and why, or what to keep in mind.
        knowledge: what the photos so far say; None if the poses are not known.

    """

    camera: CubicCamera
    target: Target | None
    pairs: Observations
    noise_px: float | None
    goal_px: float
    now: FieldUncertainty | None
    gaps: CoverageGaps
    reasons: tuple[Finding, ...]
    photos_needed: int | None
    proposals: tuple[Proposal, ...]
    notes: tuple[Finding, ...]
    knowledge: Knowledge | None

    @property
    def enough(self) -> bool:
        """Whether no more photos are needed."""
        return not self.reasons

    def as_record(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "enough": self.enough,
            "reasons": [render(reason).line for reason in self.reasons],
            "findings": [record_of(reason) for reason in self.reasons],
            "photos": len(self.pairs.images),
            "photos_needed": self.photos_needed,
            "goal_px": self.goal_px,
            "noise_px": self.noise_px,
            "now": self.now.as_record() if self.now else None,
            "coverage": self.gaps.cells.coverage,
            "empty": [
                {**part.as_record(), "words": words}
                for part, words in zip(self.gaps.parts, gap_words(self.gaps), strict=True)
            ],
            "proposals": [proposal.as_record() for proposal in self.proposals],
            "notes": [render(note).line for note in self.notes],
            "remarks": [record_of(note) for note in self.notes],
        }


@one_blas_thread()
def advise(
    known: Calibration | CameraFile,
    pairs: Observations,
    target: Target | None,
    *,
    goal_px: float | None = None,
    proposals: int = PROPOSALS,
    count: bool = True,
    seed: int = 0,
) -> Advice:
    """Say what photos so far leave open and what to photograph next.

    Args:
        known: a calibrated camera, and the record of its fit.
        pairs: the pairs that it was fitted to, world points those of the target as fitted.
        target: the calibration target as fitted; None for pairs that came without one.
        goal_px: uncertainty wanted over 95 % of the field: more than that is not enough, whatever
            the verdict. By default photos are enough where the verdict asks for none, and
            proposals aim at :class:`Goal`.
        proposals: how many photos to propose.
        count: whether to find how many photos are needed, where that is more than are proposed.
        seed: of the poses that they are chosen from.

    Raises:
        FitError: pairs and camera do not belong together.

    """
    camera, fit = known.camera, known.fit
    goal = Goal.of(fit, camera.image_size, goal_px)
    poses, gaps = Poses.of_photos(fit.poses, pairs.images), CoverageGaps.of(camera, pairs)
    notes: list[Finding] = []
    if poses is None:
        notes.append(Finding(code=Code.NO_POSES))
    knowledge = None if poses is None else Knowledge.of(camera, fit, pairs, poses, target)
    noise = None if knowledge is None else knowledge.noise_px
    own, blind, now = camera, gaps.cells.blind, None
    if knowledge is not None:
        own, rays = knowledge.camera, knowledge.field_rays(blind)
        knowledge, now = knowledge.as_recorded(fit, rays)
    reasons = goal.explain_unmet(known.verdict, now)
    if blind:
        figures = {"blind_deg": float(np.degrees(blind))}
        notes.append(Finding(code=Code.MIDDLE_UNSEEN, figures=figures))
    within = None if poses is None or target is None else distances_within(pairs, poses)
    found: tuple[Proposal, ...] = ()
    needed: int | None = 0
    if reasons:
        needed = None
        views = _sample_views(
            knowledge, target, within, notes, limited_lens(own, blind=blind), seed
        )
        if knowledge is not None and views:
            found, needed = proposed(knowledge, views, gaps, rays, goal, proposals, count=count)
        short = goal.photos - len(pairs.images)
        needed = None if needed is None else max(needed, short, 1)
    return Advice(
        camera=camera,
        target=target,
        pairs=pairs,
        noise_px=noise,
        goal_px=goal.p95_px,
        now=now,
        gaps=gaps,
        reasons=tuple(reasons),
        photos_needed=needed,
        proposals=found,
        notes=tuple(notes),
        knowledge=knowledge,
    )


def distances_within(pairs: Observations, poses: Poses) -> Distances:
    """Return the range of distances for proposals, by the distances of photos so far."""
    away = np.linalg.norm(poses.apply(pairs.image, pairs.world), axis=-1)
    # The middle of the corners would not do: inside a box it is where the camera is.
    typical = [float(np.median(away[pairs.image == photo])) for photo in np.unique(pairs.image)]
    return Distances(
        near=_NEARER * min(typical),
        far=_FARTHER * max(typical),
        nearest=_NEARER * float(away.min()),
    )


def _sample_views(
    knowledge: Knowledge | None,
    target: Target | None,
    within: Distances | None,
    notes: list[Finding],
    lens: LimitedLens,
    seed: int,
) -> list[Viewpoint]:
    """Return poses to choose from; if there are none, add the reason to ``notes``."""
    if target is None:
        notes.append(Finding(code=Code.NO_TARGET))
        return []
    if any(board.points is not None for board in target.boards):
        notes.append(Finding(code=Code.NO_SIDE))
        return []
    if knowledge is None:
        return []
    size = knowledge.camera.image_size
    scene = Scene(target=target, lens=lens, image_size=size)
    views = scene.views(_VIEWS, seed=seed, within=within)
    if not views:
        notes.append(Finding(code=Code.NO_VIEW))
    return views
