"""The lens of a model that is nearest to given pixels of rays: one fit for all models."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Literal, TypeVar

import numpy as np
from scipy.optimize import least_squares

from cubicfish_cli.errors import FitError
from cubicfish_cli.lenses.free_lens import FreeLens
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.types import FloatArray

L = TypeVar("L", bound=Lens)
Method = Literal["trf", "lm"]

# What a ray that a lens does not see counts for: a step to such a lens is turned down by its cost.
_BLIND_PX = 1e4


def nearest_lens(
    starts: Sequence[L],
    rays: FloatArray,
    pixel: FloatArray,
    *,
    held: Collection[str] = (),
    method: Method = "trf",
    most_steps: int = 200,
) -> L:
    """The lens nearest to pixels, least squares over its parameters, from the best of its starts.

    Args:
        starts: lenses of one model.
        rays: (N, 3) unit rays.
        pixel: (N, 2) where they should be seen.
        held: names of parameters that stay as they start, beside those that the model fixes.
        method: of scipy's least_squares.
        most_steps: how often the pixels are evaluated.

    Raises:
        FitError: no lens of the model is near.

    """
    free = [FreeLens.of(one, held) for one in starts]
    fits = [_least_squares(one, rays, pixel, method, most_steps) for one in free]
    found = min(fits, key=lambda fit: fit[0])[1]
    if not np.isfinite(found.parameters).all():
        raise FitError("no lens of this model is near the camera: choose another format")
    return found


def nearest_accepted(
    starts: Sequence[L], rays: FloatArray, pixel: FloatArray, *, held: Collection[str] = ()
) -> L:
    """:func:`nearest_lens`, of those whose parameters other tools accept."""
    found = nearest_lens(starts, rays, pixel, held=held)
    for name, (least, most) in found.limits.items():
        index = found.parameter_names.index(name)
        moved = found.parameters
        moved[index] = np.clip(moved[index], least, most)
        if moved[index] != found.parameters[index]:
            held = (*held, name)
            start = replace(FreeLens.of(starts[0], held), lens=found.with_parameters(moved))
            found = _least_squares(start, rays, pixel)[1]
    return found


def _least_squares(
    start: FreeLens[L],
    rays: FloatArray,
    pixel: FloatArray,
    method: Method = "trf",
    most_steps: int = 200,
) -> tuple[float, L]:
    """Cost, and the lens."""

    def residual(parameters: FloatArray) -> FloatArray:
        miss = start.with_parameters(parameters).project(rays) - pixel
        return np.where(np.isfinite(miss), miss, _BLIND_PX).reshape(-1)

    def slope(parameters: FloatArray) -> FloatArray:
        by_parameter = start.with_parameters(parameters).project_jacobian(rays)[2]
        return np.nan_to_num(by_parameter).reshape(2 * len(rays), -1)

    with np.errstate(all="ignore"):
        found = least_squares(
            residual,
            start.parameters,
            jac=slope,
            method=method,
            x_scale="jac" if method == "trf" else 1.0,
            max_nfev=most_steps,
        )
    return float(found.cost), start.with_parameters(found.x).lens
