"""Model selection: photos left out decide on the level of the target and on the prior of P."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

from cubicfish.fit.cubic_fit import (
    FIRMEST,
    NEAR_DECREASE,
    RADIAL,
    CameraFit,
    fit_cubic,
)
from cubicfish.fit.folds import folds_of
from cubicfish.fit.held_out import held_out_error
from cubicfish.fit.orientation import oriented
from cubicfish.fit.refinement import refine_object
from cubicfish.solve.deformable_target import LEVELS

Progress = Callable[[str, float], None]
# For each stage its name, and roughly the share of a fit that is done when it begins.
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
_GAIN_SHARE = 0.99
RefineTarget = Literal["off", "shape", "points", "auto"]


def begin(progress: Progress | None, stage: str, done: int = 0, parts: int = 1) -> None:
    """Report that a stage of a fit begins, or that so many of its parts are done."""
    if progress is not None:
        words, share = _STAGES[stage]
        counted = f" ({done + 1} of {parts})" if parts > 1 else ""
        progress(words + counted, share)


def select_model(
    fit: CameraFit, refine_target: RefineTarget, hold_out: bool, progress: Progress | None
) -> CameraFit:
    """Refine the target up to the given level, or as far as held-out photos gain by it.

    Args:
        fit: the fit to the nominal target.
        refine_target: the level.
        hold_out: whether to measure the held-out error, which ``auto`` needs.
        progress: called at each step.

    Raises:
        FitError: no sound camera was found.

    """
    auto = refine_target == "auto"
    if fit.nominal.target is None or (auto and not hold_out):
        refine_target = "off"
    if hold_out and (auto or refine_target == "off"):
        fit = _judge(fit, partial(begin, progress, "held out"))
    if refine_target == "off" or (auto and fit.held_out is None):
        return fit
    groups, current, judged = folds_of(fit.reference), fit, [fit]
    for level in LEVELS[1:]:
        begin(progress, level)
        starts = oriented(current) if level == "points" else [current]
        # The prior of P matters where the selection may end.
        may_end = auto or level == refine_target
        if hold_out and may_end:
            report = partial(begin, progress, f"{level} held out")
            refined = [refine_object(start, level, groups) for start in starts]
            current = better_named([_judge(one, report) for one in refined])
        else:
            current = refine_object(starts[-1], level, groups if may_end else ())
        judged.append(current)
        # A flat board with true outlines may still have corners off their places.
        if not auto or _gains(current, fit):
            fit = current
        if level == refine_target:
            break
    return replace(fit, other_levels=tuple(one for one in judged if one is not fit))


def _gains(richer: CameraFit, poorer: CameraFit) -> bool:
    """Whether a richer target predicts photos that were left out better."""
    more, less = richer.held_out, poorer.held_out
    return more is not None and less is not None and more.times(less) <= _GAIN_SHARE


def better_named(fits: Sequence[CameraFit]) -> CameraFit:
    """The fit with the likelier names where held-out photos agree, else with the given ones."""
    given, likelier = fits[0].held_out, fits[-1].held_out
    if given is None or likelier is None or likelier.times(given) > 1:
        return fits[0]
    return fits[-1]


def _judge(fit: CameraFit, progress: Callable[[int, int], None]) -> CameraFit:
    """The fit with its held-out error, which has the last word on the prior.

    The prior was chosen to first order. Where the cubic is worse than its reference on photos that
    were left out, four other priors are tried: without travel of the pupil, the firmest, both, and
    the one of the cubic nearest to a radial lens. The fit with the least held-out error is taken.
    """
    first = held_out_error(fit, progress)
    best = replace(fit.without_equations(), held_out=first)
    if first is None or first.rms_px <= first.companion_rms_px:
        return best
    least_px = first.rms_px
    central = replace(fit.prior, central=True)
    for prior in (central, FIRMEST, replace(FIRMEST, central=True), RADIAL):
        firm = fit_cubic(fit.reference, prior, start=fit, relative_decrease=NEAR_DECREASE)
        measured = held_out_error(firm, progress)
        if measured is not None and measured.rms_px < least_px:
            runners_up = {fit.prior: measured.doubt(first)}
            if prior == central:  # weight and spread are as open as they were
                for other, likely in fit.runners_up.items():
                    runners_up[replace(other, central=True)] = likely
            best = replace(firm, runners_up=runners_up, held_out=measured)
            least_px = measured.rms_px
    return best
