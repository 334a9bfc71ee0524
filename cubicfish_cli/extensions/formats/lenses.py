"""Lens models that several formats hold.

- ``pinhole``: OpenCV's, with its rational, tangential and thin-prism distortion. Its numbers stand
  in OpenCV's order (calib3d's documentation): k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, τx,
  τy;
- ``unified`` (Mei & Rives 2007), with radial-tangential distortion, as cv2.omnidir;
- ``double_sphere`` (Usenko, Demmel & Cremers 2018), which descends from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from cubicfish import CameraFileError, FloatArray
from cubicfish.models import FocalLens, Lens, RadialCamera

PINHOLE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "τx", "τy")
"""OpenCV's order of a pinhole lens's distortion."""
# Names in files of the numbers in a lens's arrays.
_NAMES: Mapping[str, tuple[str, ...]] = {
    "d": PINHOLE,
    "k": ("k1", "k2", "k3", "k4", "k5", "k6"),
    "t": ("t1", "t2"),
    "s": ("s1", "s2", "s3", "s4"),
}
# The fewest numbers that an array of a lens has; those that a file lacks are 0.
_FEWEST = {"k": 4, "t": 2, "s": 4}


def named_numbers(lens: Lens) -> dict[str, float]:
    """Return the parameters of a lens by the names that files have for them."""
    named: dict[str, float] = {}
    for one in fields(lens):
        value = getattr(lens, one.name)
        if one.name in _NAMES:
            named.update(zip(_NAMES[one.name], value.tolist(), strict=False))
        elif one.name != "image_size":
            named[one.name] = float(value)
    return named


def named_lens(
    where: Path, model: type[Lens], image_size: tuple[int, int], named: Mapping[str, float]
) -> Lens:
    """Make a lens of a model from named parameters.

    Raises:
        CameraFileError: a focal length is not above 0, or another parameter lies outside what tools
            accept; ``where`` begins the line.

    """
    if not (named["fx"] > 0 and named["fy"] > 0):
        why = "this camera was not calibrated" if named["fx"] == 0 else "is it a camera's file?"
        raise CameraFileError(f"{where}: focal lengths must be above 0: {why}")
    for name, (least, most) in model.limits.items():
        if not least <= named[name] <= most:
            raise CameraFileError(f"{where}: {name} must be from {least:g} to {most:g}")
    own: dict[str, float | FloatArray] = {}
    for one in fields(model):
        if one.name in _NAMES:
            names = _NAMES[one.name]
            last = max((names.index(name) + 1 for name in names if name in named), default=0)
            there = names[: max(last, _FEWEST.get(one.name, 0))]
            own[one.name] = np.array([named.get(name, 0.0) for name in there], float)
        elif one.name in named:
            own[one.name] = named[one.name]
    return model(image_size=image_size, **own)


def matrix_rows(lens: FocalLens | RadialCamera) -> list[list[float]]:
    """Return the camera matrix K of a lens, row by row."""
    return [[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]]


def named_in_matrix(values: FloatArray) -> dict[str, float]:
    """Return names and numbers of a camera matrix (9,), given row by row."""
    return dict(zip(("fx", "fy", "cx", "cy"), values[[0, 4, 2, 5]].tolist(), strict=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class PinholeLens(FocalLens):
    """OpenCV's lens.

    Attributes:
        d: (N,) 0, 4, 5, 8, 12 or 14 numbers in OpenCV's order.

    """

    name = "pinhole"
    label = "pinhole"

    d: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the one without distortion: near around the axis only."""
        return (cls.near(radial, d=np.zeros(8)),)

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`; not finite behind the camera."""
        d = np.zeros(len(PINHOLE))
        d[: len(self.d)] = self.d
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = d
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, y = (points[:, :2] / points[:, 2:]).T
            r2 = x * x + y * y
            radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            more_x, more_y = self.decentring(x, y, p1, p2)
            bent = np.stack(
                [
                    x * radial + more_x + r2 * (s1 + r2 * s2),
                    y * radial + more_y + r2 * (s3 + r2 * s4),
                ],
                axis=-1,
            )
            if tau_x or tau_y:
                tilted = np.column_stack([bent, np.ones(len(bent))]) @ _compute_tilt(tau_x, tau_y).T
                bent = tilted[:, :2] / tilted[:, 2:]
        pixel = bent * [self.fx, self.fy] + [self.cx, self.cy]
        good = (points[:, 2] > 0) & np.isfinite(pixel).all(axis=1)
        return np.where(good[:, None], pixel, np.nan)


def _compute_tilt(tau_x: float, tau_y: float) -> FloatArray:
    """OpenCV's matrix of a sensor turned by τx about x, then by τy about y (Scheimpflug)."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    turn = about_y @ about_x
    keep = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
    return np.asarray(keep @ turn, float)


@dataclass(frozen=True, kw_only=True, eq=False)
class UnifiedLens(FocalLens):
    """Projection onto the unit sphere, seen from ξ behind its middle, distorted, then through K.

    Attributes:
        skew: pixels, as cv2.omnidir has it; other tools have none.
        xi: ξ.
        d: (4,) k1, k2, p1, p2 of radial-tangential distortion.

    """

    name = "unified"
    label = "unified (Mei)"
    unwritten = ("skew",)
    # Kalibr reads a ξ above 0.
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {"xi": (1e-6, 1e6)}

    skew: float = 0.0
    xi: float
    d: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return lenses of several ξ: ξ and k1, k2 are correlated, with several minima.

        Without distortion ξ = 1 is the stereographic lens.
        """
        return tuple(
            cls.near(radial, stretch=1 + xi, xi=xi, d=np.zeros(4)) for xi in (1.0, 2.0, 4.0)
        )

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`: to the sphere, to the plane, bent, then K."""
        k1, k2, p1, p2 = self.d
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            bottom = points[:, 2] + self.xi * np.linalg.norm(points, axis=1)
            x, y = (points[:, :2] / np.where(bottom > 0, bottom, np.nan)[:, None]).T
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * k2)
            more_x, more_y = self.decentring(x, y, p1, p2)
            x, y = x * radial + more_x, y * radial + more_y
            pixel = np.stack([self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy], -1)
        return np.where(np.isfinite(pixel), pixel, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class DoubleSphereLens(FocalLens):
    """The shape's parameters ``xi`` and ``alpha`` are ξ and α."""

    name = "double_sphere"
    # Other programs read an α from 0 on and below 1.
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (0.0, 0.9999)}
    label = "double sphere"

    xi: float
    alpha: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the stereographic lens, ξ = 0 and α = 1/2, and some of flatter profiles."""
        return tuple(
            cls.near(radial, stretch=1 + xi, xi=xi, alpha=alpha)
            for xi, alpha in ((0.0, 0.5), (-0.2, 0.6), (0.3, 0.6), (0.8, 0.5))
        )

    def pixels(self, points: FloatArray) -> FloatArray:
        """Project as the paper does: (x, y) = s (X, Y), not finite where the lens sees nothing.

        s = 1 / (α d2 + (1 − α)(ξ d1 + Z)), d1 = |X|, d2 = hypot(ρ, ξ d1 + Z).
        """
        shifted = self.xi * np.linalg.norm(points, axis=1) + points[:, 2]
        d2 = np.sqrt(np.sum(points[:, :2] ** 2, axis=1) + shifted * shifted)
        bottom = self.alpha * d2 + (1 - self.alpha) * shifted
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = np.where(bottom > 0, 1 / bottom, np.inf)[:, None]
            pixel = points[:, :2] * scale * [self.fx, self.fy] + [self.cx, self.cy]
        return np.where(np.isfinite(scale), pixel, np.inf)
