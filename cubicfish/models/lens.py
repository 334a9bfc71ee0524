"""The interface of a lens model with parameters, as fits need it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray

if TYPE_CHECKING:
    from cubicfish.models.cubic import CubicCamera
    from cubicfish.models.radial import RadialCamera


@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """A central lens in this tool's conventions: pixel (0, 0) is the middle of the first pixel.

    The radial reference is one, and so are the lenses of other tools.

    Attributes:
        image_size: (width, height), pixels.

    """

    name: ClassVar[str]
    """Name in files and in records."""
    label: ClassVar[str]
    """Name for people."""
    symmetric: ClassVar[bool] = True
    """Whether it is symmetric about its own axis, up to an affine map of its picture."""
    tilts: ClassVar[bool] = False
    """Whether it follows a tilted axis a little by parameters of its own: frame and lens are then
    fitted together."""
    fixed: ClassVar[tuple[str, ...]] = ()
    """Parameters that no fit changes."""
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Range in which tools accept a parameter, the ends included."""
    unwritten: ClassVar[tuple[str, ...]] = ()
    """Parameters that other tools' files lack: the lens nearest to a camera keeps them as they are
    at its start."""

    image_size: tuple[int, int]

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> Sequence[Self]:
        """Lenses roughly like a radial one, from which least squares finds the nearest.

        Args:
            radial: a radial lens.
            covered: angle from the axis up to which the two should agree, radians.

        """
        raise NotImplementedError

    @classmethod
    def nearest_to(cls, camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> Self | None:
        """The lens nearest to a camera, where the model has a way of its own to find it.

        By default it has none: least squares from :meth:`starts` finds the lens.

        Args:
            camera: the camera.
            rays: (N, 3) unit rays of its field, in the lens's frame.
            pixel: (N, 2) where the camera sees them.

        """
        return None

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(K,) a name for each parameter; entries of arrays are numbered from 1."""
        raise NotImplementedError

    @property
    def parameters(self) -> FloatArray:
        """(K,) all parameters in the order of :attr:`parameter_names`."""
        raise NotImplementedError

    @property
    def units(self) -> FloatArray:
        """(K,) what counts as 1 of each parameter in least squares.

        Derivatives of one size keep the normal equations well conditioned.
        """
        return np.ones(len(self.parameters))

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same lens with other parameters (K,)."""
        raise NotImplementedError

    def pixels(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixels (N, 2), not finite where the model has none."""
        return self.pixel_and_slopes(points)[0]

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d parameter (N, 2, K).

        Pixels are not finite where the model has none.
        """
        raise NotImplementedError

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Camera-frame points (..., 3), any length -> pixels (..., 2).

        NaN where the model has no pixel, and straight behind, where it has no single one.
        """
        raise NotImplementedError

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays (..., 3); NaN beyond the lens's field."""
        raise NotImplementedError

    @property
    def also(self) -> Mapping[str, Callable[[FloatArray], FloatArray]]:
        """Other ways in which readers of the model's files find pixels, by their names."""
        return {}

    @property
    def outline(self) -> FloatArray:
        """(K, 2) pixels around the valid field of the lens; no rows where nothing is known."""
        return np.zeros((0, 2))
