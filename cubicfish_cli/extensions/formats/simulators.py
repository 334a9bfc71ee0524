"""Lenses of simulators and of the data sets that they are compared with, each a JSON file.

- NVIDIA's f-theta, as ncore's ``FThetaCameraModelParameters`` reads it;
- Fisheye624 in the layout of Project Aria's calibrations;
- WoodScape's ``radial_poly``.

In all of them pixel (0, 0) is the middle of the first one, as here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from cubicfish import FloatArray
from cubicfish.models import FormulaLens, RadialCamera
from cubicfish_cli.extensions.formats.colmap_cameras import RadialPolyLens, RadTanThinPrismLens
from cubicfish_cli.foreign.file_contents import PlacedLens, json_text

_INVERTED = 400
_MARGIN = 1.001  # what lies at the field's end is within it
# Readers of Aria's files insist on a device of theirs, and on the frame that places count from.
_ARIA_BUILD, _ARIA_ORIGIN = "DVT-S", "camera-slam-left"


@dataclass(frozen=True, kw_only=True, eq=False)
class FThetaLens(RadialPolyLens):
    """NVIDIA's: all powers of θ up to the fifth, then [[c, d], [e, 1]]; fx is c fy.

    Attributes:
        k: (4,) its coefficients of θ² and on, over that of θ, which is fy.
        d, e: the linear term's.
        reach: the field's angle from the axis, radians.

    """

    name = "ftheta"
    label = "f-theta"

    d: float
    e: float
    reach: float = field(default=np.pi, metadata=FormulaLens.FIXED)

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Fit the polynomial to the radial lens's profile; it keeps how far the field reaches."""
        theta = np.linspace(0.02, covered, 200)
        rows, rest = theta[:, None] ** [2, 3, 4, 5], radial.profile(theta) - theta
        return (
            cls.near(
                radial,
                k=np.linalg.lstsq(rows, rest, rcond=None)[0],
                d=0.0,
                e=0.0,
                reach=_MARGIN * covered,
            ),
        )

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        middle, focal = np.array([self.cx, self.cy]), np.array([self.fx, self.fy])
        bent = super().pixels(points) - middle
        u, v = (bent / focal * self.fy).T
        return np.asarray(bent + np.stack([self.d * v, self.e * u], axis=-1) + middle, float)


def ftheta_text(one: PlacedLens) -> str:
    """Write an f-theta lens; the polynomial from angles is exact, its inverse is fitted."""
    lens: FThetaLens = one.lens
    forward = lens.fy * np.array([0.0, 1.0, *lens.k])
    theta = np.linspace(0, min(lens.max_angle, lens.reach), _INVERTED)
    radius = np.polynomial.polynomial.polyval(theta, forward)
    rows = (radius / radius[-1])[:, None] ** np.arange(1, 6)
    inverse = np.linalg.lstsq(rows, theta, rcond=None)[0] / radius[-1] ** np.arange(1, 6)
    return json_text(
        {
            "resolution": list(lens.image_size),
            "shutter_type": "GLOBAL",
            "external_distortion_parameters": None,
            "principal_point": [lens.cx, lens.cy],
            "reference_poly": "ANGLE_TO_PIXELDIST",
            "pixeldist_to_angle_poly": [0.0, *inverse.tolist()],
            "angle_to_pixeldist_poly": forward.tolist(),
            "max_angle": float(theta[-1]),
            "linear_cde": [lens.fx / lens.fy, lens.d, lens.e],
            "made_by": list(one.note),
        }
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Fisheye624Lens(FormulaLens):
    """Project Aria's: COLMAP's thin prism lens with one focal length.

    Attributes:
        f: the focal length, pixels.
        cx, cy: principal point, pixels.
        k, t, s: as :class:`RadTanThinPrismLens` has them.

    """

    name = "fisheye624"
    label = "Fisheye624"
    symmetric = False
    tilts = True

    f: float
    cx: float
    cy: float
    k: FloatArray
    t: FloatArray
    s: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the radial lens."""
        start = cls(
            image_size=radial.image_size,
            f=float(np.sqrt(radial.fx * radial.fy)),
            cx=radial.cx,
            cy=radial.cy,
            k=np.append(radial.k, [0.0, 0.0]),
            t=np.zeros(2),
            s=np.zeros(4),
        )
        return (start,)

    @property
    def units(self) -> FloatArray:
        """See :class:`Lens`: pixels count in focal lengths."""
        return np.where(np.isin(self.parameter_names, ("f", "cx", "cy")), self.f, 1.0)

    @property
    def of_two(self) -> RadTanThinPrismLens:
        """The same lens of two focal lengths."""
        shape = {key: getattr(self, key) for key in ("image_size", "cx", "cy", "k", "t", "s")}
        return RadTanThinPrismLens(fx=self.f, fy=self.f, **shape)

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        return self.of_two.pixels(points)


def fisheye624_text(one: PlacedLens) -> str:
    """Write a Fisheye624 lens as an Aria calibration of one camera."""
    lens: Fisheye624Lens = one.lens
    (width, height), numbers = lens.image_size, lens.parameters.tolist()
    camera: dict[str, Any] = {
        "Calibrated": True,
        "Label": one.name,
        "SerialNumber": one.name,
        "ConfigData": {
            "ImageWidth": width,
            "ImageHeight": height,
            "MaxSolidAngle": lens.of_two.max_angle,
        },
        "Projection": {
            "Name": "FisheyeRadTanThinPrism",
            "Description": "f, cx, cy, k_0..k_5, p_0, p_1, s_0..s_3",
            "Params": numbers,
        },
        "T_Device_Camera": {
            "Translation": [0.0, 0.0, 0.0],
            "UnitQuaternion": [1.0, [0.0, 0.0, 0.0]],
        },
    }
    return json_text(
        {
            "CameraCalibrations": [camera],
            "DeviceClassInfo": {"DeviceClass": "Aria", "BuildVersion": _ARIA_BUILD},
            "OriginSpecification": {"Type": "Custom", "ChildLabel": _ARIA_ORIGIN},
            "made_by": list(one.note),
        }
    )


def woodscape_text(one: PlacedLens) -> str:
    """Write a radial_poly lens as a calibration of WoodScape, in the camera's own frame."""
    lens: RadialPolyLens = one.lens
    width, height = lens.image_size
    powers = lens.fx * np.array([1.0, *lens.k])
    return json_text(
        {
            "extrinsic": {"quaternion": [0.0, 0.0, 0.0, 1.0], "translation": [0.0, 0.0, 0.0]},
            "intrinsic": {
                "model": "radial_poly",
                "poly_order": len(powers),
                "width": width,
                "height": height,
                "aspect_ratio": lens.fy / lens.fx,
                "cx_offset": lens.cx - (width - 1) / 2,
                "cy_offset": lens.cy - (height - 1) / 2,
                **{f"k{n}": value for n, value in enumerate(powers.tolist(), start=1)},
            },
            "name": one.name,
            "made_by": list(one.note),
        }
    )
