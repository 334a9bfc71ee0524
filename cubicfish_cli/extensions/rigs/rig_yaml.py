"""rig.yaml: several cameras on one body, each with its camera.yaml beside it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from cubicfish_cli.core.errors import CameraFileError, CubicfishError
from cubicfish_cli.core.io.camera_format import mapping, numbers, refuse_unknown, refuse_version
from cubicfish_cli.core.io.camera_yaml import CameraFile, load_camera
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.plain_yaml import load_plain_yaml, plain_yaml_text
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.wording import did_you_mean, quoted

KEY = "cubicfish_rig"
FORMAT_VERSION = 1
MAX_BYTES = 64 * 1024 * 1024
MAX_CAMERAS = 100
_KEYS = (KEY, "units", "cameras", "pairs", "fit", "made_by")
_CAMERA_KEYS = (
    "name",
    "camera",
    "camera_from_rig",
    "position",
    "covariance",
    "turn_sigma_deg",
    "shift_sigma",
    "fit",
)
# Rotations that are written by hand may be rounded so much.
_ORTHONORMAL = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFileCamera:
    """One camera of a rig.yaml.

    Attributes:
        name: of the camera.
        path: of its camera.yaml, as the rig's file has it.
        file: what that holds.
        rotation: (3, 3) of camera_from_rig.
        translation: (3,) of camera_from_rig, in the rig's units.
        covariance: (6, 6) of turn (radians, camera frame) and translation; None where not known.
        fit: its errors, plain data.

    """

    name: str
    path: str
    file: CameraFile
    rotation: FloatArray
    translation: FloatArray
    covariance: FloatArray | None
    fit: Mapping[str, Any]

    @property
    def camera(self) -> CubicCamera:
        """The camera itself."""
        return self.file.camera

    @property
    def position(self) -> FloatArray:
        """(3,) where it stands in the rig."""
        return np.asarray(-self.rotation.T @ self.translation)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFile:
    """What a rig.yaml holds.

    Attributes:
        units: of lengths; None where not known.
        cameras: the cameras; the first one's frame is the rig's.
        pairs: a plain record for every two cameras: cameras, shots, rms_px.
        fit: how well it fits, plain data.
        made_by: version, date, options and hashes, plain data.

    """

    units: str | None
    cameras: tuple[RigFileCamera, ...]
    pairs: Sequence[Mapping[str, Any]]
    fit: Mapping[str, Any]
    made_by: Mapping[str, Any]

    def camera(self, name: str) -> RigFileCamera:
        """The camera of a name.

        Raises:
            CameraFileError: there is none.

        """
        return named_camera(self.cameras, name, CameraFileError)


class KnownCamera(Protocol):
    """A camera of a rig that is known."""

    @property
    def name(self) -> str:
        """Of the camera."""

    @property
    def camera(self) -> CubicCamera:
        """Its lens."""

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) of camera_from_rig."""

    @property
    def translation(self) -> FloatArray:
        """(3,) of camera_from_rig."""


_Camera = TypeVar("_Camera", bound=KnownCamera)


def named_camera(cameras: Sequence[_Camera], name: str, error: type[CubicfishError]) -> _Camera:
    """The one of a rig's cameras that has a name.

    Raises:
        CubicfishError: there is none; of the class ``error``.

    """
    there = {one.name: one for one in cameras}
    if name not in there:
        raise error(f"the rig has no camera {quoted(name)}: {did_you_mean(name, list(there))}")
    return there[name]


def rig_text(record: Mapping[str, Any]) -> str:
    """The text of a rig.yaml from its plain data, without the version."""
    return plain_yaml_text({KEY: FORMAT_VERSION, **record})


def rig_file(given: str | os.PathLike[str]) -> Path:
    """The file of a rig that is meant: a folder stands for the rig.yaml in it.

    Raises:
        CameraFileError: it is not there.

    """
    path = Path(given)
    path = path / "rig.yaml" if path.is_dir() else path
    if not path.exists():
        raise CameraFileError(
            f"there is no {path}: name the rig.yaml that 'cubicfish rig calibrate' wrote"
        )
    return path


def load_rig(given: str | os.PathLike[str]) -> RigFile:
    """Read rig.yaml, or that of a folder, and the camera.yaml of each of its cameras.

    Raises:
        CameraFileError: a file is missing, malformed or of a version that is not known; one line
            that names the file and the key.

    """
    path = rig_file(given)
    record = load_plain_yaml(
        path,
        error=CameraFileError,
        max_bytes=MAX_BYTES,
        if_empty="name the rig.yaml that 'cubicfish rig calibrate' wrote",
    )
    if not isinstance(record, dict) or KEY not in record:
        raise CameraFileError(
            f"{path} is not a rig file (it has no key {KEY!r}): name the rig.yaml that 'cubicfish "
            "rig calibrate' wrote"
        )
    refuse_version(path, record[KEY], FORMAT_VERSION)
    refuse_unknown(path, record, _KEYS)
    units, cameras = record.get("units"), record.get("cameras")
    if not (units is None or isinstance(units, str)):
        raise CameraFileError(f"{path}: units must be text, such as mm")
    if not isinstance(cameras, list) or not 1 <= len(cameras) <= MAX_CAMERAS:
        raise CameraFileError(f"{path}: cameras must be a list of 1 to {MAX_CAMERAS} records")
    found = [_camera(path, one, f"cameras[{index}]") for index, one in enumerate(cameras)]
    names = [one.name for one in found]
    if len(set(names)) < len(names):
        raise CameraFileError(f"{path}: two cameras have the same name: give each one of its own")
    pairs = record.get("pairs", [])
    if not isinstance(pairs, list) or not all(isinstance(one, dict) for one in pairs):
        raise CameraFileError(f"{path}: pairs must be a list of records")
    return RigFile(
        units=units,
        cameras=tuple(found),
        pairs=pairs,
        fit=mapping(path, record.get("fit", {}), "fit"),
        made_by=mapping(path, record.get("made_by", {}), "made_by"),
    )


def _camera(path: Path, record: Any, where: str) -> RigFileCamera:
    record = mapping(path, record, where)
    refuse_unknown(path, record, _CAMERA_KEYS)
    for key in ("name", "camera", "camera_from_rig"):
        if key not in record:
            raise CameraFileError(f"{path}: {where} has no key {key!r}: calibrate again")
    name, own = record["name"], record["camera"]
    if not isinstance(name, str) or not name or not isinstance(own, str):
        raise CameraFileError(f"{path}: {where}.name and .camera must be text")
    if os.path.isabs(own) or ".." in Path(own).parts:
        raise CameraFileError(
            f"{path}: {where}.camera must be a file in the rig's folder or below it"
        )
    place = mapping(path, record["camera_from_rig"], f"{where}.camera_from_rig")
    rotation = _rows(path, place.get("rotation"), f"{where}.camera_from_rig.rotation", 3)
    if (
        np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHONORMAL
        or np.linalg.det(rotation) < 0
    ):
        raise CameraFileError(
            f"{path}: {where}.camera_from_rig.rotation must be a rotation: three rows of length 1 "
            "at right angles"
        )
    covariance = record.get("covariance")
    return RigFileCamera(
        name=name,
        path=own,
        file=load_camera(path.parent / own),
        rotation=rotation,
        translation=numbers(
            path, place.get("translation"), f"{where}.camera_from_rig.translation", (3,)
        ),
        covariance=None
        if covariance is None
        else _rows(path, covariance, f"{where}.covariance", 6),
        fit=mapping(path, record.get("fit", {}), f"{where}.fit"),
    )


def _rows(path: Path, value: Any, key: str, count: int) -> FloatArray:
    if not isinstance(value, list) or len(value) != count:
        raise CameraFileError(f"{path}: {key} must hold {count} rows of {count} numbers")
    return np.array([numbers(path, row, key, (count,)) for row in value])
