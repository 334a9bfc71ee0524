"""A lens as least squares sees it: free parameters in one array."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Generic, Self, TypeVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.types import FloatArray

L = TypeVar("L", bound=Lens)


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeLens(Generic[L]):
    """A lens of which some parameters are free: a :class:`~cubicfish_cli.fitting.fit_lens.FitLens`.

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

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """None: few parameters hold these lenses."""
        return np.zeros(0), np.zeros((0, len(self.free)))
