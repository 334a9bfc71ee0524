"""The lens of a model that is nearest to given pixels of rays: one fit for all models."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Self, TypeVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.lenses.lens import Lens
from cubicfish_cli.core.types import FloatArray

L = TypeVar("L", bound=Lens)

# What a ray that a lens does not see counts for: a step to such a lens is turned down by its cost.
_BLIND_PX = 1e4
_MOST_STEPS = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeLens(Generic[L]):
    """A lens of which some parameters are free, as a :class:`FitLens` has them.

    Attributes:
        lens: as it is now.
        free: (F,) which of its parameters are free.
        units: (F,) what counts as 1 of each.

    """

    lens: L
    free: npt.NDArray[np.intp]
    units: FloatArray

    @classmethod
    def of(cls, lens: L, held: Collection[str] = ()) -> Self:
        """A lens of which everything is free but what its model or ``held`` names."""
        names, kept = lens.parameter_names, {*lens.fixed, *held}
        free = np.array([i for i, name in enumerate(names) if name not in kept], np.intp)
        return cls(lens=lens, free=free, units=lens.units[free])

    @property
    def parameters(self) -> FloatArray:
        """(F,) the free parameters in their units."""
        return np.asarray(self.lens.parameters[self.free] / self.units)

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same lens with other free parameters (F,)."""
        every = self.lens.parameters
        every[self.free] = parameters * self.units
        return replace(self, lens=self.lens.with_parameters(every))

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d free parameter (N, 2, F)."""
        pixel, by_point, by_parameter = self.lens.pixel_and_slopes(points)
        return pixel, by_point, by_parameter[:, :, self.free] * self.units

    def project(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) -> pixels (N, 2), not finite where the model has none."""
        return self.lens.pixels(points)

    def prior(self) -> FloatArray:
        """Nothing: few parameters hold these lenses."""
        return np.zeros((len(self.free) + 1,) * 2)


def nearest_lens(
    starts: Sequence[L],
    rays: FloatArray,
    pixel: FloatArray,
    *,
    held: Collection[str] = (),
) -> L:
    """The lens nearest to pixels, least squares over its parameters, from the best of its starts.

    Args:
        starts: lenses of one model.
        rays: (N, 3) unit rays.
        pixel: (N, 2) where they should be seen.
        held: names of parameters that stay as they start, beside those that the model fixes.

    Raises:
        FitError: no lens of the model is near.

    """
    fits = [_least_squares(FreeLens.of(one, held), rays, pixel) for one in starts]
    found = min(fits, key=lambda fit: fit[0])[1]
    if not np.isfinite(found.parameters).all():
        raise FitError("no lens of this model is near the camera: choose another format")
    return found


def _least_squares(start: FreeLens[L], rays: FloatArray, pixel: FloatArray) -> tuple[float, L]:
    """Cost, and the lens."""
    from scipy.optimize import least_squares  # it takes long to load, and is seldom asked

    def residual(parameters: FloatArray) -> FloatArray:
        miss = start.with_parameters(parameters).project(rays) - pixel
        return np.where(np.isfinite(miss), miss, _BLIND_PX).reshape(-1)

    def slope(parameters: FloatArray) -> FloatArray:
        by_parameter = start.with_parameters(parameters).project_jacobian(rays)[2]
        return np.nan_to_num(by_parameter).reshape(2 * len(rays), -1)

    with np.errstate(all="ignore"):
        found = least_squares(
            residual, start.parameters, jac=slope, method="lm", x_scale="jac", max_nfev=_MOST_STEPS
        )
    return float(found.cost), start.with_parameters(found.x).lens
