"""Lenses that are given by a formula, as other tools' models are.

A model is a frozen dataclass whose fields, beside the photo's size, are its parameters; fields
marked by :attr:`FormulaLens.FIXED` are carried along and never fitted. A model has a ``name``, a
``label``, :meth:`FormulaLens.starts` and its formula, :meth:`Lens.pixels`. Everything else,
derivatives too, follows from these.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from cubicfish.angles import angle_from_axis, unit_rays
from cubicfish.geometry import decentring
from cubicfish.models.cubic import UNPROJECT_TOLERANCE_PX
from cubicfish.models.lens import Lens
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import (
    PixelAndSlope,
    cone_rays,
    ray_at,
    rays_of_pixels,
    tangent_basis,
)
from cubicfish.types import FloatArray

_SEEDS = 6000
# Pixels at a time: their intermediate arrays then stay in the processor's cache.
_BLOCK = 8192
_STEP = 1e-6
_PROBE_STEP_DEG = 0.5
_LARGEST_PROBE_DEG = 175.0
_PIXELS = ("fx", "fy", "cx", "cy", "skew")


@dataclass(frozen=True, kw_only=True, eq=False)
class FormulaLens(Lens):
    """A lens whose fields are its parameters.

    Attributes:
        FIXED: the metadata of a field that is no parameter of a fit (of the class).

    """

    FIXED: ClassVar[Mapping[str, Any]] = MappingProxyType({"fixed": True})

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`: by differences."""
        by_parameter = []
        parameters = self.parameters
        for index, unit in enumerate(self.units):
            step = np.zeros(len(parameters))
            step[index] = _STEP * unit
            ahead, behind = (self.with_parameters(parameters + way) for way in (step, -step))
            with np.errstate(invalid="ignore"):  # beyond the lens's end
                apart = ahead.pixels(points) - behind.pixels(points)
            by_parameter.append(apart / (2 * step[index]))
        return *self.pixel_and_slope(points), np.stack(by_parameter, axis=-1)

    def pixel_and_slope(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """:meth:`pixel_and_slopes` without the parameters, of which a model may have hundreds."""
        length = np.linalg.norm(points, axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):
            by_point = [
                (self.pixels(points + step) - self.pixels(points - step)) / (2 * _STEP * length)
                for step in (_STEP * length * axis for axis in np.eye(3))
            ]
        return self.pixels(points), np.stack(by_point, axis=-1)

    def sees(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Return whether the model's pixels of points (N, 3) are meant, (N,) bool."""
        return np.ones(len(points), bool)

    @classmethod
    def _list_keys(cls) -> list[str]:
        """Return names of the fields that are parameters."""
        return [one.name for one in fields(cls) if one.name != "image_size" and not one.metadata]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """See :class:`Lens`."""
        names: list[str] = []
        for key in self._list_keys():
            value = getattr(self, key)
            numbers = range(1, np.size(value) + 1) if np.ndim(value) else [""]
            names += [f"{key}{number}" for number in numbers]
        return tuple(names)

    @property
    def parameters(self) -> FloatArray:
        """See :class:`Lens`."""
        return np.concatenate([np.ravel(getattr(self, key)) for key in self._list_keys()])

    def with_parameters(self, parameters: FloatArray) -> Self:
        """See :class:`Lens`."""
        changes: dict[str, Any] = {}
        start = 0
        for key in self._list_keys():
            shape = np.shape(getattr(self, key))
            end = start + int(np.prod(shape))
            part = parameters[start:end]
            changes[key] = part.reshape(shape).copy() if shape else float(part[0])
            start = end
        return replace(self, **changes)

    @cached_property
    def max_angle(self) -> float:
        """How far from its axis the lens is a camera, radians: no pole, fold or mirroring."""
        return float(np.deg2rad(usable_angle_deg(self.pixel_and_slope)))

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """See :class:`Lens`."""
        points = np.asarray(points, float)
        flat = points.reshape(-1, 3)
        with np.errstate(all="ignore"):
            pixel = self.pixels(flat)
        seen = np.isfinite(pixel).all(axis=1) & self.sees(flat)
        seen &= (flat[:, :2] != 0).any(axis=1) | (flat[:, 2] > 0)
        return np.where(seen[:, None], pixel, np.nan).reshape(*points.shape[:-1], 2)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Turn pixels (..., 2) into unit rays (..., 3), NaN beyond :attr:`max_angle`.

        Newton's method on the sphere, from the ray of a few thousand that is seen next to it.
        """
        from scipy.spatial import KDTree

        pixel = np.asarray(pixel, float)
        flat = pixel.reshape(-1, 2)
        rays = np.full((len(flat), 3), np.nan)
        seeds = cone_rays(self.max_angle, _SEEDS)
        seen = self.project(seeds)
        there = np.isfinite(seen[:, 0])
        tree = KDTree(seen[there])
        index = np.flatnonzero(np.isfinite(flat).all(axis=1) & there.any())
        for block in np.array_split(index, len(index) // _BLOCK + 1):
            _, near = tree.query(flat[block])
            start = seeds[there][near]
            rays[block] = rays_of_pixels(
                flat[block], start, self.pixel_and_slope, UNPROJECT_TOLERANCE_PX
            )
        rays = unit_rays(rays)
        with np.errstate(invalid="ignore"):
            inside = angle_from_axis(rays) <= self.max_angle
        return np.where(inside[:, None], rays, np.nan).reshape(*pixel.shape[:-1], 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class FocalLens(FormulaLens):
    """A lens of focal lengths and a principal point, and other parameters after them.

    Attributes:
        fx, fy: focal lengths, pixels.
        cx, cy: principal point, pixels.

    """

    fx: float
    fy: float
    cx: float
    cy: float

    @staticmethod
    def decentring(
        x: FloatArray, y: FloatArray, p1: float, p2: float
    ) -> tuple[FloatArray, FloatArray]:
        """The shift of offsets x, y (N,), in focal lengths, by Brown's decentring."""
        return decentring(x, y, p1, p2)

    @classmethod
    def near(cls, radial: RadialCamera, stretch: float = 1.0, **others: Any) -> Self:
        """Return a lens about a radial one's centre, with its focal lengths times ``stretch``."""
        return cls(
            image_size=radial.image_size,
            fx=stretch * radial.fx,
            fy=stretch * radial.fy,
            cx=radial.cx,
            cy=radial.cy,
            **others,
        )

    @property
    def units(self) -> FloatArray:
        """See :class:`Lens`: pixels count in focal lengths."""
        return np.where(np.isin(self.parameter_names, _PIXELS), self.fx, 1.0)


def usable_angle_deg(pixel_and_slope: PixelAndSlope) -> float:
    """Return how far from its axis a lens is a camera: pixels finite, no fold, no mirroring."""
    theta = np.deg2rad(np.arange(_PROBE_STEP_DEG, _LARGEST_PROBE_DEG, _PROBE_STEP_DEG))
    azimuth = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    rays = ray_at(*np.broadcast_arrays(theta[:, None], azimuth)).reshape(-1, 3)
    with np.errstate(all="ignore"):
        pixel, slope = pixel_and_slope(rays)
        # The basis has the sense of (d, first, second): at the axis that is the pixels' own.
        across = slope @ tangent_basis(rays)
        sense = across[:, 0, 0] * across[:, 1, 1] - across[:, 0, 1] * across[:, 1, 0]
        good = np.isfinite(pixel).all(axis=1) & (sense > 0)
    bad = np.flatnonzero(~good.reshape(len(theta), -1).all(axis=1))
    last = len(theta) if not bad.size else int(bad[0])
    return float(np.rad2deg(theta[last - 1])) if last else 0.0
