"""NVIDIA's rig.json (DriveWorks, NCore, Cosmos): f-theta lenses and where they stand, metres.

Frames are FLU: x forward, y to the left, z up; angles are degrees about fixed x, y and z. Pixel
(0, 0) is the middle of the first pixel, as here. The rig's frame is the first camera's.

The f-theta lens has the angle from the axis as a polynomial of the distance in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.polynomial import polynomial
from scipy.spatial.transform import Rotation

from cubicfish_cli.app.lenses.file_contents import LensRig, PlacedLens, json_text
from cubicfish_cli.app.lenses.foreign_lens import ForeignLens
from cubicfish_cli.core.angles import angle_from_axis
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

_ROUNDS = 30
_TOLERANCE = 1e-9  # radians


@dataclass(frozen=True, kw_only=True, eq=False)
class FThetaLens(ForeignLens):
    """A ray at r and azimuth φ is seen at (cx, cy) + [[c, d], [e, 1]] r (cos φ, sin φ).

    Attributes:
        cx, cy: the centre, pixels.
        polynomial: (6,) of θ = k0 + k1 r + ... + k5 r⁵, radians and pixels.
        linear: (3,) c, d, e.

    """

    name = "ftheta"
    label = "f-theta"
    fixed = ("polynomial1",)

    cx: float
    cy: float
    polynomial: FloatArray
    linear: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The equidistant lens."""
        k = np.array([0.0, 2 / (radial.fx + radial.fy), 0, 0, 0, 0])
        linear = np.array([radial.fx / radial.fy, 0.0, 0.0])
        centre = {"cx": radial.cx, "cy": radial.cy}
        return (cls(image_size=radial.image_size, **centre, polynomial=k, linear=linear),)

    @property
    def units(self) -> FloatArray:
        """See :class:`Lens`: radii count in focal lengths."""
        focal = 1 / self.polynomial[1]
        return np.array([focal, focal, *focal ** -np.arange(6.0), 1, 1, 1])

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        k, slope = self.polynomial, polynomial.polyder(self.polynomial)
        theta = angle_from_axis(points)
        r = (theta - k[0]) / k[1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for _ in range(_ROUNDS):  # Newton's, each step no longer than half the way
                step = (polynomial.polyval(r, k) - theta) / polynomial.polyval(r, slope)
                r = r - np.clip(step, -0.5 * r - 1, 0.5 * r + 1)
            found = np.abs(polynomial.polyval(r, k) - theta) < _TOLERANCE
            found &= (polynomial.polyval(r, slope) > 0) & (r > -1)
            across = np.hypot(points[:, 0], points[:, 1])
            way = np.where(across[:, None] > 0, points[:, :2] / across[:, None], 0.0)
        matrix = np.append(self.linear, 1.0).reshape(2, 2)
        pixel = (way * r[:, None]) @ matrix.T + [self.cx, self.cy]
        return np.where(found[:, None], pixel, np.nan)


_VERSION = 7
# x right, y down, z forward -> forward, left, up.
_FLU = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def nvidia_text(one: PlacedLens) -> str:
    """An f-theta lens as a rig.json of one camera."""
    return _text([_sensor(one, np.eye(3), np.zeros(3))])


def nvidia_rig_text(rig: LensRig) -> str:
    """f-theta lenses as a rig.json.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    sensors = []
    for number, one in enumerate(rig.lenses):
        turn, shift = rig.rig_from_lens(number)
        sensors.append(_sensor(one, turn, shift * rig.metres))
    return _text(sensors)


def _sensor(one: PlacedLens, turn: FloatArray, metres: FloatArray) -> dict[str, Any]:
    lens: FThetaLens = one.lens
    angles = Rotation.from_matrix(_FLU @ turn @ _FLU.T).as_euler("xyz", degrees=True)
    polynomial = " ".join(map(repr, lens.polynomial.tolist()))
    width, height = lens.image_size
    linear = zip("cde", lens.linear.tolist(), strict=True)
    return {
        "name": f"camera:{one.name}",
        "protocol": "camera.virtual",
        "parameter": "",
        "nominalSensor2Rig_FLU": {
            "roll-pitch-yaw": angles.tolist(),
            "t": (_FLU @ metres + 0.0).tolist(),
        },
        "properties": {
            "Model": "ftheta",
            "width": str(width),
            "height": str(height),
            "cx": repr(lens.cx),
            "cy": repr(lens.cy),
            "polynomial": polynomial,
            "polynomial-type": "pixeldistance-to-angle",
            "bw-poly": polynomial,
            **{f"linear-{key}": repr(value) for key, value in linear},
        },
        "made_by": list(one.note),
    }


def _text(sensors: list[dict[str, Any]]) -> str:
    rig = {"properties": {}, "sensors": sensors, "vehicle": {}}
    return json_text({"rig": rig, "version": _VERSION})
