"""The camera in camera.yaml: its keys, each checked when it is read.

What its fit says of itself is read by `camera_yaml.py`, for those who ask.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

import numpy as np

from cubicfish.errors import CameraFileError
from cubicfish.files.plain_yaml import mapping, parse_plain_yaml, refuse_unknown, refuse_version
from cubicfish.files.reading import MAX_SIDE, read_text
from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.models.lift import SIZE
from cubicfish.models.radial import RadialCamera
from cubicfish.types import FloatArray

FORMAT_VERSION = 1
RADIAL_KEYS = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
# Enough for a calibration of some ten thousand photos; no camera file is larger.
_MAX_BYTES = 64 * 1024 * 1024
_KEYS = (
    *("cubicfish", "image_size", "lift", "frame", "P", "max_angle_deg", "valid", "radial", "pupil"),
    *("fit", "made_by", "point_offset", "point_scale", "point_reach", "point_null"),
)
_NO_CAMERA = "name the camera.yaml that 'cubicfish calibrate'"


def read_camera(path: Path | str) -> CubicCamera:
    """Read the camera alone from a camera.yaml of the ``ray`` lift.

    Raises:
        CameraFileError: as :func:`~cubicfish.io.camera_yaml.load_camera`, but for what is
            wrong with the fit's record alone.

    """
    file = read_keys(Path(path))
    if file.data["lift"] == "point":
        refuse_point(Path(path))
    return make_ray_camera(file)


def read_keys(path: Path) -> Keys:
    """Read the keys and values of a camera file of this version and of a lift that is known.

    Raises:
        CameraFileError: it is no such file; the text says what else it is.

    """
    text = read_text(path, max_bytes=_MAX_BYTES, error=CameraFileError)
    parsed: Any = None
    if not text.startswith("%"):  # OpenCV's files, which are not quite YAML
        parsed = parse_plain_yaml(path, text, error=CameraFileError, if_empty=f"{_NO_CAMERA} wrote")
    record: dict[str, Any] = parsed if isinstance(parsed, dict) else {}
    if "cubicfish" in record:
        refuse_version(path, record["cubicfish"], FORMAT_VERSION)
        refuse_unknown(path, record, _KEYS)
        lift = record.get("lift"), record.get("frame")
        if lift not in (("ray", "camera"), ("point", "world"), ("point", "camera")):
            raise CameraFileError(
                f"{path}: lift and frame must be 'ray' and 'camera', or 'point' and either 'world' "
                "or 'camera': calibrate again"
            )
        return Keys(path, record)
    if "boards" in record:
        raise CameraFileError(f"{path} is a calibration target, not a camera: {_NO_CAMERA} wrote")
    other = next((key for key in record if key.startswith("cubicfish_")), "").partition("_")[2]
    if other:  # of several cameras on one body, or of two turned into rows
        raise CameraFileError(f"{path} is of a {other}, not of one camera: {_NO_CAMERA} wrote")
    raise CameraFileError(
        f"{path} is not a camera file (it has no key 'cubicfish'): {_NO_CAMERA} wrote, or read "
        "another tool's with 'cubicfish import'"
    )


def refuse_point(path: Path) -> NoReturn:
    """Refuse a file of the ``point`` lift.

    Raises:
        CameraFileError: always.

    """
    raise CameraFileError(
        "is of lift 'point', which has no rays",
        do="it serves 'project' and {plane} alone; calibrate with {lift} for this",
        about=str(path),
        arguments={"plane": "PlaneOptions", "lift": "lift='ray'"},
    )


def make_ray_camera(file: Keys) -> CubicCamera:
    """Make the camera of a file of the ``ray`` lift.

    Raises:
        CameraFileError: a key is missing or unusable, or keys contradict each other.

    """
    image_size, P = file.image_size(), file.cubics()
    max_angle_deg = float(file.numbers("max_angle_deg"))
    if not 0 < max_angle_deg < 180:
        file.refuse("max_angle_deg must be between 0 and 180")
    radial, travel, units = file.inner("radial"), 0.0, None
    focal = [radial.above_zero(key) for key in RADIAL_KEYS[:2]]
    others = [float(radial.numbers(key)) for key in RADIAL_KEYS[2:]]
    if "pupil" in file.data:
        pupil = file.inner("pupil")
        travel, units = float(pupil.numbers("travel")), pupil.data.get("units")
        if not isinstance(units, str | None):
            file.refuse("pupil.units must be a word, as in target.yaml")
    camera = CubicCamera(
        image_size=image_size,
        P=P,
        max_angle_deg=max_angle_deg,
        radial=RadialCamera.from_parameters(np.array([*focal, *others]), image_size),
        pupil_travel=travel,
        units=units,
    )
    fault_deg = pole_or_fold_deg(P, max_angle_deg)
    if fault_deg is not None:
        file.refuse(
            f"P has a pole or a fold at {fault_deg:.1f}° from the axis, "
            f"inside its max_angle_deg of {max_angle_deg:.1f}: the file was changed or cut, "
            "calibrate again"
        )
    _refuse_other_size(file, image_size)
    return camera


def _refuse_other_size(file: Keys, image_size: tuple[int, int]) -> None:
    """Refuse an image size that another program, or a hand, has changed without the rest."""
    outline = file.rows("valid", 2) if "valid" in file.data else np.zeros((0, 2))
    if bool((outline > image_size).any()):
        file.refuse_change("the outline of 'valid' reaches beyond the photo of image_size")
    grid = file.inner("fit").inner("uncertainty").data
    for places, side in zip((grid.get("x"), grid.get("y")), image_size, strict=True):
        last = places[-1] if isinstance(places, list) and places else None
        if _is_finite(last) and abs(last - (side - 1)) > 1:
            file.refuse_change("image_size is not that of the grid of fit.uncertainty")


@dataclass(frozen=True)
class Keys:
    """Keys and values of a camera or rig file, each checked when it is read."""

    path: Path
    data: dict[str, Any]
    above: str = ""

    def refuse(self, what: str) -> NoReturn:
        """Refuse the file.

        Raises:
            CameraFileError: always.

        """
        raise CameraFileError(f"{self.path}: {what}")

    def refuse_change(self, what: str) -> NoReturn:
        """Refuse a file that contradicts itself.

        Raises:
            CameraFileError: always.

        """
        self.refuse(f"{what}: the file was changed by hand, calibrate again")

    def inner(self, key: str) -> Keys:
        """What is under a key."""
        name = self.above + key
        return Keys(self.path, mapping(self.path, self.data.get(key, {}), name), f"{name}.")

    def numbers(self, key: str, *shape: int) -> FloatArray:
        """The numbers under a key, all finite, in the shape that the format has there."""
        name = self.above + key
        if key not in self.data:
            raise CameraFileError(f"{self.path} has no key {name!r}: calibrate again")
        value = np.array(self.data[key], object)
        if value.shape != shape or not all(map(_is_finite, value.flat)):
            wanted = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
            self.refuse(f"{name} must be {wanted}, all finite")
        return np.array(value, float)

    def rows(self, key: str, columns: int) -> FloatArray:
        """The rows of numbers under a key, however many."""
        rows = self.data.get(key)
        count = len(rows) if isinstance(rows, list) else 1
        return self.numbers(key, count, columns) if count else np.zeros((0, columns))

    def above_zero(self, key: str) -> float:
        """A number above 0."""
        value = float(self.numbers(key))
        if value <= 0:
            self.refuse(f"{self.above}{key} must be above 0")
        return value

    def image_size(self) -> tuple[int, int]:
        """(width, height) of the photos."""
        size = self.numbers("image_size", 2)
        if not all(side == int(side) and 0 < side <= MAX_SIDE for side in size):
            self.refuse("image_size must be two whole numbers above 0")
        return int(size[0]), int(size[1])

    def cubics(self) -> FloatArray:
        """P, (3, 20) with Frobenius norm 1."""
        P = self.numbers("P", 3, SIZE)
        if not P.any():
            self.refuse("P is all zeros: calibrate again")
        return unit_norm(P)


def unit_norm(P: FloatArray) -> FloatArray:
    """P with Frobenius norm 1; unchanged to the last bit when it has that norm already."""
    norm = np.linalg.norm(P)
    if abs(norm - 1) < 1e-12:
        return P
    P = P / np.abs(P).max()  # squares of tiny numbers vanish
    return np.asarray(P / np.linalg.norm(P))


def _is_finite(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e100
