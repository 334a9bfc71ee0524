"""COLMAP's cameras.txt and cameras.bin, and the rig_config.json of a rig.

The binary file is little-endian: the number of cameras (uint64), then of each its CAMERA_ID
(uint32), the model's number (int32), width and height (uint64) and the parameters (float64).

Its pixel (0, 0) is the top-left CORNER of the first pixel: centres are half a pixel more than here.
"""

import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from cubicfish import CameraFileError, FloatArray, quoted
from cubicfish.files import read_bytes, read_text
from cubicfish.models import FocalLens, Lens, RadialCamera, angle_from_axis
from cubicfish_cli.extensions.formats.lenses import PinholeLens, named_lens, named_numbers
from cubicfish_cli.foreign.file_contents import (
    LensRig,
    PlacedLens,
    chosen_camera,
    json_text,
    numbers,
    size,
)

# Profiles are searched for a fold in such steps.
_STEP_RAD = np.deg2rad(0.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class ThetaLens(FocalLens):
    """A fisheye lens whose radius is θ (1 + k1 θⁿ + k2 θ²ⁿ + ...), θ the angle from its axis.

    It sees as far as that grows.

    Attributes:
        step: n (of the class).
        k: (K,) k1, k2, ...

    """

    step: ClassVar[int] = 2

    k: FloatArray

    @cached_property
    def max_angle(self) -> float:
        """See :class:`Lens`: at most where the radial part stops growing."""
        return min(super().max_angle, _find_fold_rad(self.k, self.step))

    def sees(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """See :class:`Lens`: as far as the radial part grows."""
        return angle_from_axis(points) <= _find_fold_rad(self.k, self.step)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialPolyLens(ThetaLens):
    """WoodScape's ``radial_poly``: all powers of θ; fx is its k1, and k its k2, k3, k4 over k1."""

    name = "radial_poly"
    label = "polynomial of the angle"
    step = 1

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Fit the polynomial to the radial lens's profile."""
        theta = np.linspace(0.02, covered, 200)
        rows, rest = theta[:, None] ** [2, 3, 4], radial.profile(theta) - theta
        return (cls.near(radial, k=np.linalg.lstsq(rows, rest, rcond=None)[0]),)

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        uv = _project_fisheye(points)
        powers = np.hypot(*uv.T)[:, None] ** np.arange(1, len(self.k) + 1)
        bent = uv * (1 + powers @ self.k)[:, None]
        return np.asarray(bent * [self.fx, self.fy] + [self.cx, self.cy], float)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadTanThinPrismLens(ThetaLens):
    """COLMAP's fisheye lens with tangential and thin-prism terms (sensor/models.h).

    COLMAP calls it RAD_TAN_THIN_PRISM_FISHEYE, Project Aria Fisheye624. A point at the angle θ from
    the axis is first (u, v), θ along its azimuth. With (a, b) = (1 + k1 θ² + ... + k6 θ¹²) (u, v),
    ρ² = a² + b² and

        T(a, b) = (t1 (ρ² + 2a²) + 2 t2 a b + s1 ρ² + s2 ρ⁴,
                   t2 (ρ² + 2b²) + 2 t1 a b + s3 ρ² + s4 ρ⁴),

    the pixel is f · ((a, b) + T) + c.

    T follows a tilted axis too: the lens is fitted together with its frame.

    Attributes:
        shifts_bent: whether T is of (a, b), and not of (u, v) (of the class).
        skew: pixels; none here.
        k: (6,) of the radial part.
        t: (2,) t1, t2, tangential.
        s: (4,) s1..s4, of thin prisms.

    """

    name = "rad_tan_thin_prism_fisheye"
    label = "radial, tangential, thin prism fisheye"
    symmetric = False
    tilts = True
    shifts_bent: ClassVar[bool] = True
    skew: ClassVar[float] = 0.0

    t: FloatArray
    s: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the radial lens."""
        k = np.append(radial.k, [0.0, 0.0])
        return (cls.near(radial, k=k, t=np.zeros(2), s=np.zeros(4)),)

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        uv = _project_fisheye(points)
        powers = (uv**2).sum(axis=1)[:, None] ** np.arange(1, len(self.k) + 1)
        ab = uv * (1 + powers @ self.k)[:, None]
        (t1, t2), (s1, s2, s3, s4) = self.t, self.s
        at_a, at_b = (ab if self.shifts_bent else uv).T
        square = at_a * at_a + at_b * at_b
        more_a, more_b = self.decentring(at_a, at_b, t2, t1)
        u = ab[:, 0] + more_a + square * (s1 + square * s2)
        v = ab[:, 1] + more_b + square * (s3 + square * s4)
        return np.stack([self.fx * u + self.skew * v + self.cx, self.fy * v + self.cy], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class ThinPrismLens(RadTanThinPrismLens):
    """COLMAP's THIN_PRISM_FISHEYE: T is of (u, v), so that 1 + k1 θ² + ... does not bend it.

    With a skew it is Metashape's fisheye too, and without T that of cv2.fisheye, whose calibration
    finds a skew unless told not to.

    Attributes:
        k: (4,) of the radial part.
        skew: pixels.

    """

    name = "thin_prism_fisheye"
    label = "thin prism fisheye"
    unwritten = ("skew",)
    shifts_bent = False

    skew: float = 0.0  # type: ignore[misc]

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the radial lens."""
        return (cls.near(radial, k=radial.k, t=np.zeros(2), s=np.zeros(4)),)


def _project_fisheye(points: FloatArray) -> FloatArray:
    """Return (u, v) (N, 2) of camera-frame points; NaN straight behind, where it is undefined."""
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0).copy()
    rho = np.hypot(x, y)
    theta = np.arctan2(rho, z)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(rho > 0, theta / rho, np.where(z > 0, 0.0, np.nan))
        return np.asarray(points[:, :2] * scale[:, None])


def _find_fold_rad(k: FloatArray, step: int) -> float:
    """Return the angle up to which the radial part grows, at most π."""
    theta = np.arange(0, np.pi, _STEP_RAD)
    slope = np.ones_like(theta)
    for index, value in enumerate(k, start=1):
        slope += (step * index + 1) * value * theta ** (step * index)
    falls = np.flatnonzero(slope <= 0)
    return float(theta[max(falls[0] - 1, 0)]) if falls.size else float(np.pi)


HALF = 0.5
MAX_BYTES = 16_000_000
_HEAD = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
_LINE = re.compile(r"^[^\S\n]*[0-9]+\s+[A-Z][A-Z_]+\s+[0-9]+\s+[0-9]+\s+[-+.0-9]", re.MULTILINE)


class ColmapModel(NamedTuple):
    """One of COLMAP's camera models.

    Attributes:
        number: of the model in ``cameras.bin``.
        lens: the same lens here.
        named: its parameters in COLMAP's order; f stands for fx and fy.

    """

    number: int
    lens: type[Lens]
    named: str

    @property
    def parameters(self) -> list[str]:
        """Names of the parameters."""
        return self.named.split()


MODELS = {
    "SIMPLE_PINHOLE": ColmapModel(0, PinholeLens, "f cx cy"),
    "PINHOLE": ColmapModel(1, PinholeLens, "fx fy cx cy"),
    "SIMPLE_RADIAL": ColmapModel(2, PinholeLens, "f cx cy k1"),
    "RADIAL": ColmapModel(3, PinholeLens, "f cx cy k1 k2"),
    "OPENCV": ColmapModel(4, PinholeLens, "fx fy cx cy k1 k2 p1 p2"),
    "OPENCV_FISHEYE": ColmapModel(5, RadialCamera, "fx fy cx cy k1 k2 k3 k4"),
    "FULL_OPENCV": ColmapModel(6, PinholeLens, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    "SIMPLE_RADIAL_FISHEYE": ColmapModel(8, RadialCamera, "f cx cy k1"),
    "RADIAL_FISHEYE": ColmapModel(9, RadialCamera, "f cx cy k1 k2"),
    "THIN_PRISM_FISHEYE": ColmapModel(10, ThinPrismLens, "fx fy cx cy k1 k2 t2 t1 k3 k4 s1 s3"),
    "RAD_TAN_THIN_PRISM_FISHEYE": ColmapModel(
        11, RadTanThinPrismLens, "fx fy cx cy k1 k2 k3 k4 k5 k6 t1 t2 s1 s2 s3 s4"
    ),
    "SIMPLE_FISHEYE": ColmapModel(14, RadialCamera, "f cx cy"),
    "FISHEYE": ColmapModel(15, RadialCamera, "fx fy cx cy"),
}
"""COLMAP's name -> the model, of the models that can be read."""
_WRITTEN_AS = {MODELS[name].lens: name for name in ("OPENCV_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE")}


def parameters_of(lens: Lens) -> tuple[str, list[float]]:
    """Return the COLMAP name and parameters of a lens."""
    name, named = _WRITTEN_AS[type(lens)], named_numbers(lens)
    named["cx"], named["cy"] = named["cx"] + HALF, named["cy"] + HALF
    return name, [named[parameter] for parameter in MODELS[name].parameters]


def colmap_text(one: PlacedLens) -> str:
    """Write a lens as a cameras.txt of one camera."""
    name, parameters = parameters_of(one.lens)
    width, height = one.lens.image_size
    return "\n".join(
        [
            "# Camera list with one line of data per camera:",
            "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
            "# Number of cameras: 1",
            *(f"# {line}" for line in one.note),
            f"1 {name} {width} {height} " + " ".join(map(repr, parameters)),
            "",
        ]
    )


def colmap_rig_text(rig: LensRig) -> str:
    """Write lenses as a rig_config.json, with their cameras.

    The photos of each camera are in a folder of its name; lengths are the rig's own.
    """
    cameras = []
    for number, one in enumerate(rig.lenses):
        name, parameters = parameters_of(one.lens)
        camera: dict[str, Any] = {
            "image_prefix": f"{one.name}/",
            "camera_model_name": name,
            "camera_params": parameters,
        }
        if number:
            turn, shift = rig.between(number, 0)
            x, y, z, w = Rotation.from_matrix(turn).as_quat().tolist()
            camera["cam_from_rig_rotation"] = [w, x, y, z]
            camera["cam_from_rig_translation"] = shift.tolist()
        else:
            camera["ref_sensor"] = True
        cameras.append({**camera, "made_by": list(one.note)})
    return json_text([{"cameras": cameras}])


def looks_like_cameras_txt(text: str) -> bool:
    """Return whether a line of the text is one of cameras.txt."""
    return _LINE.search(text) is not None


def looks_like_cameras_bin(data: bytes) -> bool:
    """Return whether a file begins as a cameras.bin does: text never has so many zeros there."""
    if len(data) < _HEAD.size + _CAMERA.size:
        return False
    (count,) = _HEAD.unpack_from(data)
    _, model, width, height = _CAMERA.unpack_from(data, _HEAD.size)
    return 0 < count < 2**32 and 0 <= model < 256 and max(width, height) < 2**32


def read_colmap(path: Path, *, camera: str | None = None) -> Lens:
    """Read one camera of a cameras.txt or a cameras.bin.

    Args:
        path: the file.
        camera: its CAMERA_ID; not needed where there is one.

    Raises:
        CameraFileError: the file is neither, or holds no such camera; one line.

    """
    data = read_bytes(path, max_bytes=MAX_BYTES, error=CameraFileError)
    if looks_like_cameras_bin(data):
        cameras = _read_binary(path, data)
    else:
        cameras = _read_text(path, read_text(path, max_bytes=MAX_BYTES, error=CameraFileError))
    there: dict[str, tuple[Path, str, Sequence[Any]]] = {}
    for number, where, name, values in cameras:
        if number in there:
            raise CameraFileError(f"{where}: camera {quoted(number)} is there twice")
        there[number] = where, name, values
    where, name, values = there[chosen_camera(path, list(there), camera)]
    if name not in MODELS:
        raise CameraFileError(
            f"{where}: the lens of COLMAP's {quoted(name)} is not known here: known: "
            + ", ".join(MODELS)
        )
    try:
        width, height, *given = map(float, values)
    except ValueError as problem:
        raise CameraFileError(
            f"{where}: WIDTH, HEIGHT and numbers must follow the model"
        ) from problem
    model = MODELS[name]
    parameters = numbers(where, given, f"PARAMS of {name}", (len(model.parameters),))
    named = dict(zip(model.parameters, parameters.tolist(), strict=True))
    if "f" in named:
        named["fx"] = named["fy"] = named["f"]
    named["cx"], named["cy"] = named["cx"] - HALF, named["cy"] - HALF
    return named_lens(where, model.lens, size(where, width, height, "WIDTH and HEIGHT"), named)


Found = Iterator[tuple[str, Path, str, Sequence[Any]]]
"""CAMERA_ID, place in the file, model, and WIDTH, HEIGHT and PARAMS of each camera."""


def _read_text(path: Path, text: str) -> Found:
    for number, line in enumerate(text.splitlines(), start=1):
        camera, *cells = line.split() or ["#"]
        if not camera.startswith("#"):
            name, *values = cells or ["nothing"]
            yield camera, Path(f"{path}, line {number}"), name, values


def _read_binary(path: Path, data: bytes) -> Found:
    (count,), at = _HEAD.unpack_from(data), _HEAD.size
    names = {model.number: name for name, model in MODELS.items()}
    try:
        for _ in range(count):
            camera, model, *values = _CAMERA.unpack_from(data, at)
            if model not in names:
                raise CameraFileError(
                    f"{path}: camera {camera} is of model number {model}, which is not known "
                    f"here: known: {', '.join(MODELS)}"
                )
            name, at = names[model], at + _CAMERA.size
            parameters = struct.Struct(f"<{len(MODELS[name].parameters)}d")
            yield str(camera), path, name, [*values, *parameters.unpack_from(data, at)]
            at += parameters.size
    except struct.error as problem:
        raise CameraFileError(
            f"{path} ends before all of its {count} cameras: was it copied whole?"
        ) from problem
    if at != len(data):
        raise CameraFileError(f"{path}: there is more behind its {count} cameras: is it damaged?")
