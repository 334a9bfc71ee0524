"""Model selection: photos left out decide on the level of the target and on the prior of P."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

from cubicfish.fit.cubic_fit import NEAR_DECREASE, CameraFit, fit_cubic
from cubicfish.fit.folds import folds_of
from cubicfish.fit.held_out import held_out_error
from cubicfish.fit.orientation import oriented
from cubicfish.fit.prior import FIRMEST, RADIAL, Prior
from cubicfish.fit.refinement import refine_object
from cubicfish.solve.deformable_target import TARGET_MODELS, TargetModel
from cubicfish.types import IntArray

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
    "prior held out": ("other priors, held-out photos", 0.8),
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
    level: RefineTarget = "off" if fit.nominal.target is None else refine_target
    if hold_out and level in ("off", "auto"):
        fit = _measured(fit, partial(begin, progress, "held out"))
    if level == "auto" and fit.held_out is not None:
        fit = _refine_while_photos_gain(fit, progress)
    elif level in ("shape", "points"):
        fit = _refine_up_to(fit, level, hold_out, progress)
    central = replace(fit.prior, central=True)
    others = dict.fromkeys((central, replace(FIRMEST, central=True), RADIAL))
    return _with_best_prior(fit, list(others), partial(begin, progress, "prior held out"))


def _refine_up_to(
    fit: CameraFit, level: TargetModel, hold_out: bool, progress: Progress | None
) -> CameraFit:
    """Refine the target up to a level, whether photos gain by it or not."""
    groups = folds_of(fit.reference)
    for lower in TARGET_MODELS[1 : TARGET_MODELS.index(level)]:
        begin(progress, lower)
        # The prior of P matters where the selection ends.
        fit = refine_object(fit, lower, ())
    if hold_out:
        return _refine_judged(fit, level, groups, progress)
    begin(progress, level)
    return refine_object(_namings(fit, level)[-1], level, groups)


def _refine_while_photos_gain(fit: CameraFit, progress: Progress | None) -> CameraFit:
    """Refine the target as far as photos gain by it that were left out."""
    groups, current, judged = folds_of(fit.reference), fit, [fit]
    for level in TARGET_MODELS[1:]:
        current = _refine_judged(current, level, groups, progress)
        judged.append(current)
        # A flat board with true outlines may still have corners off their places.
        if _gains(current, fit):
            fit = current
    return replace(fit, other_levels=tuple(one for one in judged if one is not fit))


def _refine_judged(
    fit: CameraFit, level: TargetModel, groups: Sequence[IntArray], progress: Progress | None
) -> CameraFit:
    """Refine the target at the next level, and measure the held-out error."""
    begin(progress, level)
    report = partial(begin, progress, f"{level} held out")
    refined = [refine_object(start, level, groups) for start in _namings(fit, level)]
    return better_named([_measured(one, report) for one in refined])


def _namings(fit: CameraFit, level: TargetModel) -> list[CameraFit]:
    """Fits from which to start a level: as corners are named, and as they may be named better."""
    return oriented(fit) if level == "points" else [fit]


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


def _measured(fit: CameraFit, progress: Callable[[int, int], None]) -> CameraFit:
    """The fit with its held-out error, or the one under the firmest prior where that does better.

    From there a richer target goes on: a prior that is too loose for a poor one misleads it.
    """
    measured = replace(fit.without_equations(), held_out=held_out_error(fit, progress))
    return _with_best_prior(measured, [FIRMEST], progress)


def _with_best_prior(
    fit: CameraFit, others: Sequence[Prior], progress: Callable[[int, int], None]
) -> CameraFit:
    """The fit under its prior or another one: photos that were left out have the last word.

    The prior was chosen to first order. Others are tried where the cubic is worse than its
    reference on photos that were left out; the fit with the least held-out error is taken.
    """
    first = fit.held_out
    if first is None or first.rms_px <= first.radial_rms_px:
        return fit
    best, least_px = fit, first.rms_px
    for prior in others:
        firm = fit_cubic(fit.reference, prior, start=fit, relative_decrease=NEAR_DECREASE)
        measured = held_out_error(firm, progress)
        if measured is not None and measured.rms_px < least_px:
            runners_up = {fit.prior: measured.doubt(first)}
            if replace(prior, central=fit.prior.central) == fit.prior:
                # Weight and spread are as open as they were.
                for other, likely in fit.runners_up.items():
                    runners_up[replace(other, central=True)] = likely
            best = replace(
                firm.without_equations(),
                runners_up=runners_up,
                held_out=measured,
                other_levels=fit.other_levels,
            )
            least_px = measured.rms_px
    return best
