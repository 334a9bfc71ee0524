"""What a fit, or its failure, knows of a set-up: whoever diagnoses one is handed this."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cubicfish_cli.core.assess.uncertainty import UncertaintyGrid
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.refinement import NominalTarget, TargetFit
from cubicfish_cli.core.fit.subset import select_photos, world_scale
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What hypotheses are judged by: each kind has attributes of its own.

    Attributes:
        known: what was found before, and comes first.

    """

    known: Sequence[Finding] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerEvidence(Evidence):
    """Named corners.

    Attributes:
        pairs: all pairs, in the target's units.
        target: the drawing; None for pairs that came without one.

    """

    pairs: Observations
    target: Target | None


@dataclass(frozen=True, kw_only=True, eq=False)
class FailedFit(CornerEvidence):
    """Corners of which there is no fit.

    Attributes:
        fits: whether they do fit one lens and the drawing, so that neither is to blame.

    """

    fits: bool = False

    @cached_property
    def scaled(self) -> tuple[Observations, float]:
        """The pairs in a unit in which the target is of order 1, and that in the target's."""
        scale = world_scale(self.pairs)
        pairs = self.pairs.with_world(self.pairs.world / scale)
        return select_photos(pairs, np.arange(len(pairs.images))), scale


@dataclass(frozen=True, kw_only=True, eq=False)
class FitEvidence(CornerEvidence):
    """Corners with their fit.

    Attributes:
        nominal_fit: the fit to the target as drawn.
        fit: the final fit.
        nominal: the target as drawn.
        dropped: photo and board of each corner that was left out as grossly wrong.
        uncertainty: what is stated of the camera.

    """

    nominal_fit: TargetFit
    fit: TargetFit
    nominal: NominalTarget
    dropped: Sequence[tuple[str, str | None]]
    uncertainty: UncertaintyGrid


Diagnose = Callable[[Evidence], Sequence[Finding]]
"""Tells what is likely wrong with a set-up; the likeliest first where there is no fit."""
