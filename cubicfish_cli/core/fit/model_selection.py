"""How far the target is refined and how P is held: photos left out have the last word."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from cubicfish_cli.core.fit.cubic_fit import (
    FIRMEST,
    NEAR_DECREASE,
    RADIAL,
    CameraFit,
    fit_cubic,
)
from cubicfish_cli.core.fit.deformable_target import LEVELS, Level
from cubicfish_cli.core.fit.folds import folds_of
from cubicfish_cli.core.fit.held_out import HeldOut, held_out_error
from cubicfish_cli.core.fit.lenses import CubicFit
from cubicfish_cli.core.fit.orientation import oriented
from cubicfish_cli.core.fit.refinement import NominalTarget, refine_object
from cubicfish_cli.core.fit.rejection import without
from cubicfish_cli.core.types import BoolArray

Progress = Callable[[str, float], None]
# What each is called, and roughly what share of a fit is done when it begins.
_STAGES = {
    "start": ("poses and a radial lens", 0.0),
    "cubic": ("the cubic camera", 0.03),
    "held out": ("held-out photos", 0.2),
    "shape": ("boards' shapes", 0.33),
    "shape held out": ("boards' shapes, held-out photos", 0.41),
    "points": ("single corners", 0.61),
    "points held out": ("single corners, held-out photos", 0.7),
    "checks": ("what may be wrong", 0.9),
}
# A richer target must lower photos' held-out errors at least to this share of the poorer one's.
_WORTH = 0.99
RefineTarget = Literal["off", "shape", "points", "auto"]
Judged = tuple[CameraFit, HeldOut | None, NominalTarget]


def begin(progress: Progress | None, stage: str, done: int = 0, parts: int = 1) -> None:
    """Say that a stage of a fit begins, or that so many of its parts are done."""
    if progress is not None:
        words, share = _STAGES[stage]
        counted = f" ({done + 1} of {parts})" if parts > 1 else ""
        progress(words + counted, share)


@dataclass(frozen=True, kw_only=True, eq=False)
class SelectedModel:
    """A fit at the level of the target that was asked for, or that photos left out speak for.

    Attributes:
        fit: the fit.
        nominal: the target as drawn; its pairs have the fit's names.
        held_out: the held-out error at each level that was judged; None where photos are too few.
        refused: richer fits that did not lower the held-out error enough.

    """

    fit: CameraFit
    nominal: NominalTarget
    held_out: Mapping[Level, HeldOut | None]
    refused: tuple[CameraFit, ...] = ()

    def without(self, wrong: BoolArray) -> SelectedModel:
        """The same without some of the pairs: ``wrong`` (N,)."""
        held_out = {level: error and error.of(~wrong) for level, error in self.held_out.items()}
        nominal = replace(self.nominal, pairs=self.nominal.pairs.select(~wrong))
        return replace(self, fit=without(self.fit, wrong), nominal=nominal, held_out=held_out)

    @property
    def in_doubt(self) -> list[tuple[CubicFit, float]]:
        """The lens of the likeliest richer fit, and how likely it is the better one.

        A few photos may not show that a refined target predicts better, although boards are
        deformed.
        """
        mine = self.held_out.get(self.fit.level)
        others = ((fit, self.held_out.get(fit.level)) for fit in self.refused)
        found = [(fit.lens, mine.doubt(one)) for fit, one in others if mine and one]
        return sorted(found, key=lambda one: one[1])[-1:]


def select_model(
    fit: CameraFit,
    nominal: NominalTarget,
    refine_target: RefineTarget,
    hold_out: bool,
    progress: Progress | None,
) -> SelectedModel:
    """Refine the target up to the level asked for, or as far as held-out photos gain by it.

    Args:
        fit: the fit to the target as drawn.
        nominal: the target as drawn, with that fit's pairs.
        refine_target: how far.
        hold_out: whether the held-out error is measured, which ``auto`` goes by.
        progress: told of each step.

    Raises:
        FitError: no sound camera was found.

    """
    measured: dict[Level, HeldOut | None] = {}
    auto = refine_target == "auto"
    if nominal.target is None or (auto and not hold_out):
        refine_target = "off"
    if hold_out and (auto or refine_target == "off"):
        fit, measured["off"] = _judge(fit, partial(begin, progress, "held out"))
    if refine_target == "off" or (auto and measured["off"] is None):
        return SelectedModel(fit=fit, nominal=nominal, held_out=measured)
    groups = folds_of(fit.reference)
    reached, named = fit, nominal
    refused: list[CameraFit] = []
    for level in LEVELS[1:]:
        begin(progress, level)
        starts = oriented(reached, named) if level == "points" else [(reached, named)]
        # How P is held matters where the selection may end.
        may_end = auto or level == refine_target
        judge = hold_out and may_end
        found: list[Judged] = [
            (refine_object(start, own, level, groups if may_end else ()), None, own)
            for start, own in (starts if judge else starts[-1:])
        ]
        if judge:
            tell = partial(begin, progress, f"{level} held out")
            found = [(*_judge(one, tell), own) for one, _, own in found]
        reached, error, named = better_named(found)
        if judge:
            measured[level] = error
        # Corners may be off their places on a board that is flat and true in its outlines.
        if auto and not _gains(error, measured[fit.level]):
            refused.append(reached)
            continue
        fit, nominal, refused = reached, named, []
        if level == refine_target:
            break
    return SelectedModel(fit=fit, nominal=nominal, held_out=measured, refused=tuple(refused))


def _gains(richer: HeldOut | None, poorer: HeldOut | None) -> bool:
    """Whether photos that were left out gain by a richer target."""
    return richer is not None and poorer is not None and richer.times(poorer) <= _WORTH


def better_named(judged: Sequence[Judged]) -> Judged:
    """The fit with the likelier names where held-out photos agree, else with those given."""
    (*_, given, _), (*_, likelier, _) = judged[0], judged[-1]
    if given is None or likelier is None or likelier.times(given) > 1:
        return judged[0]
    return judged[-1]


def _judge(
    fit: CameraFit, progress: Callable[[int, int], None]
) -> tuple[CameraFit, HeldOut | None]:
    """The held-out error, which has the last word on how P is held.

    The prior was chosen to first order. Where the cubic is worse than its reference on photos that
    were left out, its pupil stands still, or it is held as firmly as can be, or both, or it is the
    cubic nearest to a radial lens, whichever has the least held-out error.
    """
    held_out = held_out_error(fit, progress)
    if held_out is None or held_out.rms_px <= held_out.companion_rms_px:
        return fit, held_out
    best, error = fit, held_out
    central = replace(fit.prior, central=True)
    for prior in (central, FIRMEST, replace(FIRMEST, central=True), RADIAL):
        firm = fit_cubic(
            fit.reference, prior, world=fit.world, start=fit, relative_decrease=NEAR_DECREASE
        )
        measured = held_out_error(firm, progress)
        if measured is not None and measured.rms_px < error.rms_px:
            runners_up = {fit.prior: measured.doubt(held_out)}
            if prior == central:  # how firmly and how symmetrically is as open as it was
                for other, likely in fit.runners_up.items():
                    runners_up[replace(other, central=True)] = likely
            best, error = replace(firm, runners_up=runners_up), measured
    return best, error
