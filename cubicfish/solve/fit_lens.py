"""Lenses in least squares: free parameters, derivatives and prior.

The nearest lens of a model to given pixels of rays is found by one fit for all models.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, Self, TypeVar

import numpy as np

from cubicfish.errors import FitError
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.lens import Lens
from cubicfish.solve.descent import descended
from cubicfish.solve.normal_equations import gram
from cubicfish.types import FloatArray, IntArray

if TYPE_CHECKING:
    from cubicfish.solve.poses import Poses

L = TypeVar("L", bound=Lens)

# Error of a ray that a lens does not see: its cost rejects a step to such a lens.
_BLIND_PX = 1e4
_MOST_STEPS, _STEADY = 200, 1e-10


class FitLens:
    """A lens that least squares can adjust: one camera, each of whose photos is a shot of its own.

    A body that carries several cameras overrides how its photos are seen, since the poses of an
    adjustment are then the body's, one for each shot.
    """

    @property
    def parameters(self) -> FloatArray:
        """(K,) the free parameters; K may be 0."""
        raise NotImplementedError

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same lens with other parameters."""
        raise NotImplementedError

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d param (N, 2, K)."""
        raise NotImplementedError

    def separate_slopes(
        self, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, Sequence[FloatArray], IntArray]:
        """As :meth:`pixel_and_slopes`, with x and y apart: each need not depend on all parameters.

        Returns:
            Pixel (N, 2); d/d point (N, 2, 3); the derivatives of x and y by the parameters on which
            they depend, in parts one after the other, (2, ., N), or (1, ., N) where they are the
            same for both; and the indices (2, k) of these parameters.

        """
        pixel, by_point, by_parameter = self.pixel_and_slopes(points)
        columns = np.tile(np.arange(by_parameter.shape[2]), (2, 1))
        return pixel, by_point, [by_parameter.transpose(1, 2, 0)], columns

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixel (N, 2), not finite where there is none."""
        return self.pixel_and_slopes(points)[0]

    def pulls(self) -> FloatArray:
        """Gram matrix (K + 1, K + 1) of pseudo-observations.

        Products of their derivatives by the parameters and, last, of their residuals, pixels.
        """
        return np.zeros((len(self.parameters) + 1,) * 2)

    def views(self, shots: Poses) -> Poses:
        """camera_from_world of every photo, from the body's poses."""
        return shots

    def shot_of(self, photos: IntArray) -> IntArray:
        """(n,) the shots of some photos."""
        return photos

    def camera_of(self, photos: IntArray) -> IntArray:
        """(n,) which camera took them."""
        return np.zeros_like(photos)

    def lens_of(self, photo: int) -> FitLens:
        """The lens that a photo was taken through."""
        return self

    def by_body(
        self, photos: IntArray, shots: Poses, by_view: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Convert derivatives of n pairs by their camera's pose to those by the body.

        Args:
            photos: (n,) of one camera.
            shots: the body's poses.
            by_view: (n, 2, 6) by the turn and the shift of the photo's own pose.

        Returns:
            The indices (L + k,) of the lens's parameters and, behind them, of what else the body's
            photos share; (n, 2, k) by that; and (n, 2, 6) by the shot's pose.

        """
        return np.arange(len(self.parameters)), np.zeros((len(photos), 2, 0)), by_view


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedLens(FitLens):
    """A known lens, or one that was fitted: only poses are free."""

    camera: CubicCamera | Lens | FitLens

    @property
    def parameters(self) -> FloatArray:
        """(0,)."""
        return np.zeros(0)

    def with_parameters(self, parameters: FloatArray) -> Self:
        """Return the lens itself: nothing is free."""
        return self

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`FitLens`."""
        pixel, d_point, *_ = self.camera.pixel_and_slopes(points)
        return pixel, d_point, np.zeros((len(points), 2, 0))


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeLens(FitLens, Generic[L]):
    """A lens of which some parameters are free.

    Attributes:
        lens: as it is now.
        free: (F,) which of its parameters are free.
        units: (F,) what counts as 1 of each parameter.

    """

    lens: L
    free: IntArray
    units: FloatArray

    @classmethod
    def of(cls, lens: L, fixed: Collection[str] = ()) -> Self:
        """A lens whose parameters are all free, except those that its model or ``fixed`` names."""
        names, kept = lens.parameter_names, {*lens.fixed, *fixed}
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

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d free parameter (N, 2, F)."""
        pixel, by_point, by_parameter = self.lens.pixel_and_slopes(points)
        by_free = by_parameter.transpose(1, 2, 0)[:, self.free] * self.units[:, None]
        return pixel, by_point, by_free.transpose(2, 0, 1)

    def project(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) -> pixels (N, 2), not finite where the model has none."""
        return self.lens.pixels(points)


def nearest_lens(
    starts: Sequence[L],
    rays: FloatArray,
    pixel: FloatArray,
    *,
    fixed: Collection[str] = (),
) -> L:
    """The lens nearest to pixels: the best least squares fit from the given starts.

    Args:
        starts: lenses of one model.
        rays: (N, 3) unit rays.
        pixel: (N, 2) where they should be seen.
        fixed: names of parameters that keep their start values, beside those that the model fixes.

    Raises:
        FitError: no lens of the model is near.

    """
    fits = [_fit_least_squares(FreeLens.of(one, fixed), rays, pixel) for one in starts]
    found = min(fits, key=lambda fit: fit[0])[1]
    if not np.isfinite(found.parameters).all():
        raise FitError("no lens of this model is near the camera: choose another format")
    return found


def lens_beside(start: L, rays: FloatArray, pixel: FloatArray, *, fixed: Collection[str] = ()) -> L:
    """The lens nearest to pixels, from one that is near already and sees nearly the same.

    The arguments are those of :func:`nearest_lens`, which goes farther, and takes long to load.
    """

    def square_of(lens: FreeLens[L]) -> FloatArray:
        miss = (lens.project(rays) - pixel).reshape(-1)
        slope = lens.pixel_and_slopes(rays)[2].reshape(len(miss), -1)
        return gram(np.nan_to_num(slope), np.where(np.isfinite(miss), miss, _BLIND_PX))

    with np.errstate(all="ignore"):
        return descended(FreeLens.of(start, fixed), square_of, _STEADY, _MOST_STEPS)[0].lens


def _fit_least_squares(start: FreeLens[L], rays: FloatArray, pixel: FloatArray) -> tuple[float, L]:
    """Fit from one start: the cost, and the lens."""
    from scipy.optimize import least_squares  # slow to load, and seldom needed

    def residual(parameters: FloatArray) -> FloatArray:
        miss = start.with_parameters(parameters).project(rays) - pixel
        return np.where(np.isfinite(miss), miss, _BLIND_PX).reshape(-1)

    def slope(parameters: FloatArray) -> FloatArray:
        by_parameter = start.with_parameters(parameters).pixel_and_slopes(rays)[2]
        return np.nan_to_num(by_parameter).reshape(2 * len(rays), -1)

    with np.errstate(all="ignore"):
        found = least_squares(
            residual, start.parameters, jac=slope, method="lm", x_scale="jac", max_nfev=_MOST_STEPS
        )
    return float(found.cost), start.with_parameters(found.x).lens
