"""What the baseline lenses share: free parameters in one array, and central symmetry."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from cubicfish_cli.model.radial import RadialCamera

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class BaselineLens(ABC):
    """A lens of which every value is free; see :class:`cubicfish_cli.fitting.adjustment.FitLens`.

    Attributes:
        values: (K,) its parameters, in the order that the model's own module gives.
        units: (K,) what counts as 1 of each value in least squares. Derivatives of one size keep
            the normal equations well conditioned.

    """

    name: ClassVar[str]
    values: FloatArray
    units: FloatArray

    @classmethod
    @abstractmethod
    def starts(cls, camera: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Lenses roughly like ``camera``, from one of which least squares finds the nearest one.

        Args:
            camera: the radial reference.
            covered: angle from the axis up to which the two should agree, radians.

        """

    @property
    def parameters(self) -> FloatArray:
        """(K,) values in their units."""
        return self.values / self.units

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same lens with other parameters."""
        return replace(self, values=parameters * self.units)

    @abstractmethod
    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d value (N, 2, K).

        Pixels are inf where the model has none.
        """

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        pixel, d_point, d_values = self.pixel_and_slopes(points)
        return pixel, d_point, d_values * self.units

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixel (N, 2), inf where the model has none."""
        return self.pixel_and_slopes(points)[0]

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """None: few parameters hold these lenses."""
        return np.zeros(0), np.zeros((0, len(self.parameters)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Scale:
    """How far from the axis an axially symmetric lens puts a point: (x, y) = s · (X, Y).

    Attributes:
        value: (N,) s; inf where the lens sees nothing.
        d_across: (N,) (ds/dρ)/ρ with ρ = hypot(X, Y): finite on the axis too.
        d_along: (N,) ds/dZ.
        d_shape: (N, K) ds/d shape parameters.

    """

    value: FloatArray
    d_across: FloatArray
    d_along: FloatArray
    d_shape: FloatArray

    def point(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normalised pixel (N, 2), its d/d point (N, 2, 3) and its d/d shape (N, 2, K)."""
        across = points[:, :2]
        d_point = np.empty((len(points), 2, 3))
        d_point[:, :, :2] = (
            across[:, :, None] * across[:, None, :] * self.d_across[:, None, None]
            + np.eye(2) * self.value[:, None, None]
        )
        d_point[:, :, 2] = across * self.d_along[:, None]
        return (
            across * self.value[:, None],
            d_point,
            across[:, :, None] * self.d_shape[:, None, :],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SymmetricLens(BaselineLens):
    """An axially symmetric lens: values are fx, fy, cx, cy and the shape's parameters."""

    @classmethod
    def near(cls, camera: RadialCamera, shape: Sequence[float], stretch: float = 1.0) -> Self:
        """A lens about the camera's centre, with its focal lengths times ``stretch``."""
        fx, fy = stretch * camera.fx, stretch * camera.fy
        return cls(
            values=np.array([fx, fy, camera.cx, camera.cy, *shape]),
            units=np.array([fx, fx, fx, fx, *np.ones(len(shape))]),
        )

    @abstractmethod
    def scale(self, points: FloatArray) -> Scale:
        """The model itself: camera-frame points (N, 3) -> s and its derivatives."""

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`BaselineLens`."""
        focal, centre = self.values[:2], self.values[2:4]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = self.scale(points)
            xy, d_point, d_shape = scale.point(points)
        d_values = np.zeros((len(points), 2, len(self.values)))
        d_values[:, 0, 0] = xy[:, 0]
        d_values[:, 1, 1] = xy[:, 1]
        d_values[:, 0, 2] = 1
        d_values[:, 1, 3] = 1
        d_values[:, :, 4:] = focal[:, None] * d_shape
        pixel = focal * xy + centre
        seen = np.isfinite(scale.value)
        return (
            np.where(seen[:, None], pixel, np.inf),
            focal[:, None] * d_point,
            d_values,
        )
