"""A rig: several cameras on one body. One record, from the fit to rig.yaml, verdict and page.

rig.yaml is read and written here; each camera's camera.yaml is beside it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cubicfish import __version__
from cubicfish.errors import CameraFileError, CubicfishError
from cubicfish.files.plain_yaml import (
    load_plain_yaml,
    mapping,
    plain_yaml_text,
    refuse_unknown,
    refuse_version,
)
from cubicfish.files.whole_files import Content, write_files
from cubicfish.geometry import camera_centre
from cubicfish.io.camera_keys import Keys
from cubicfish.io.camera_yaml import Calibrated, camera_text, copy_plain, load_camera
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import (
    NAN,
    ErrorStatistics,
    FitRecord,
    Origin,
    PoseRecord,
)
from cubicfish.judge.records import LEFT_OUT_IF_EMPTY, plain_record, read_record
from cubicfish.judge.verdict import Verdict
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.target.target import Target
from cubicfish.types import FloatArray
from cubicfish.units import explain_unknown
from cubicfish.views.fields import sees
from cubicfish.wording import did_you_mean, quoted, shown

KEY = "cubicfish_rig"
REFINED = "target.refined.yaml"
"""What the target is called, beside rig.yaml, where it was fitted too."""
FORMAT_VERSION = 1
MAX_BYTES = 64 * 1024 * 1024
MAX_CAMERAS = 100
_MAX_NAME = 100
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
# What is written by hand may be rounded so much.
_ROUNDED = 1e-3
_OVERLAP_RAYS = 2000


@dataclass(frozen=True, kw_only=True)
class ErrorsInRig(ErrorStatistics):
    """How a camera's corners fit the rig.

    Attributes:
        images: how many photos were used.
        held_out_rms_px: RMS on shots that were left out.
        alone_rms_px: RMS of the same corners with each photo's pose free, the lens as it is.
        late_ms: by how much its photos are later than the first camera's, which was taken out.
        late_sigma_ms: its standard deviation.

    """

    images: int = 0
    held_out_rms_px: float = NAN
    alone_rms_px: float = NAN
    late_ms: float = NAN
    late_sigma_ms: float = NAN


@dataclass(frozen=True, kw_only=True)
class CameraPair:
    """Two cameras and what connects them.

    Attributes:
        cameras: their names.
        shots: in how many shots both see the target.
        rms_px: RMS of the corners of both in these shots.

    """

    cameras: tuple[str, ...] = ()
    shots: int = 0
    rms_px: float = NAN


@dataclass(frozen=True, kw_only=True)
class ShotErrors:
    """A shot: its RMS, how many corners it has, the cameras that saw it, and where the rig was."""

    shot: str = ""
    rms_px: float = NAN
    corners: int = 0
    cameras: tuple[str, ...] = ()
    rig_from_world: PoseRecord | None = field(default=None, metadata=LEFT_OUT_IF_EMPTY)


@dataclass(frozen=True, kw_only=True)
class RigFit(ErrorStatistics):
    """What the fit of a rig says of itself, beside the errors over all corners.

    Attributes:
        held_out_rms_px: RMS on shots that were left out.
        shots: how many shots took part.
        refine_target: what of the target was fitted.
        held_lenses: whether the lenses stayed as they were.
        findings: what is likely wrong with the set-up.
        per_shot: each shot.

    """

    held_out_rms_px: float = NAN
    shots: int = 0
    refine_target: Literal["off", "shape", "points"] | None = None
    held_lenses: bool = False
    findings: tuple[Finding, ...] = ()
    per_shot: tuple[ShotErrors, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RigCamera(Calibrated):
    """A camera of a rig: a calibrated camera that has a name and a place.

    Attributes:
        name: of the camera.
        camera: its lens.
        path: of its camera.yaml, from the rig's folder.
        rotation: (3, 3) of camera_from_rig.
        translation: (3,) of camera_from_rig, in the rig's units.
        covariance: (6, 6) of camera_from_rig: a turn in the camera's frame (radians), then the
            translation; zero for the first camera, whose frame is the rig's; None where not known.
        in_rig: its errors in the rig's fit.

    """

    name: str
    camera: CubicCamera
    path: str = ""
    rotation: FloatArray
    translation: FloatArray
    covariance: FloatArray | None = None
    in_rig: ErrorsInRig = field(default_factory=ErrorsInRig)

    @property
    def position(self) -> FloatArray:
        """(3,) the camera's centre in the rig's frame, in the rig's units."""
        return camera_centre(self.rotation, self.translation)

    @property
    def turned_deg(self) -> float:
        """By how much it is turned against the rig's frame, degrees."""
        cosine = (np.trace(self.rotation) - 1) / 2
        return float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))

    @property
    def turn_sigma_deg(self) -> float:
        """Standard deviation of the turn: root of the sum over its axes; 0 where not known."""
        return 0.0 if self.covariance is None else sigmas_of(self.covariance)[0]

    @property
    def shift_sigma(self) -> float:
        """Standard deviation of the translation, likewise, in the rig's units."""
        return 0.0 if self.covariance is None else sigmas_of(self.covariance)[1]

    @property
    def half_field_deg(self) -> float:
        """How far from the axis corners reach, or, where that is not known, it is trusted."""
        return half_field_deg(self.fit, self.camera)

    def beside(self, other: RigCamera) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and translation (3,) from another camera's frame to this one's."""
        rotation = self.rotation @ other.rotation.T
        return rotation, self.translation - rotation @ other.translation

    def overlaps(self, other: RigCamera) -> bool:
        """Whether another camera sees some of the far things that this one sees."""
        rays = cone_rays(np.deg2rad(self.camera.max_angle_deg), _OVERLAP_RAYS)
        own = rays[sees(self.camera, rays)]
        return bool(sees(other.camera, own @ self.rotation @ other.rotation.T).any())

    @staticmethod
    def refuse_name(name: object, what: str, error: type[CubicfishError]) -> None:
        """Refuse a name of a camera that cannot be that of a folder or a file.

        Raises:
            CubicfishError: it cannot; of the class ``error``, with ``what`` it is the name of.

        """
        if (
            not isinstance(name, str)
            or name.strip() in ("", ".", "..")
            or len(name) > _MAX_NAME
            or not name.isprintable()
            or set(name) & {"/", "\\"}
        ):
            raise error(
                f"{what} {quoted(str(name))}: a name must be text of 1 to {_MAX_NAME} letters "
                "without / and \\ and line breaks, since files are called after it"
            )

    @staticmethod
    def refuse_same(names: Sequence[str], where: str, error: type[CubicfishError]) -> None:
        """Refuse names of a rig's cameras of which files would be called the same.

        Raises:
            CubicfishError: two are the same to a folder that does not tell A from a.

        """
        if len({name.casefold() for name in names}) < len(names):
            raise error(
                f"{where}: cameras are called {', '.join(map(shown, names))}: give each a name of "
                "its own, and not a and A, which some folders do not tell apart"
            )

    def place_record(self) -> dict[str, Any]:
        """Plain data: what rig.yaml has of the camera."""
        return {
            "name": self.name,
            "camera": self.path,
            "camera_from_rig": {
                "rotation": self.rotation.tolist(),
                "translation": self.translation.tolist(),
            },
            "position": self.position.tolist(),
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "turn_sigma_deg": self.turn_sigma_deg,
            "shift_sigma": self.shift_sigma,
            "fit": self.in_rig.as_record(),
        }


def half_field_deg(fit: FitRecord, camera: CubicCamera) -> float:
    """How far from the axis a camera's corners reach, or, where not known, it is trusted."""
    return fit.covered_deg if 0 < fit.covered_deg < 180 else camera.max_angle_deg


def sigmas_of(covariance: FloatArray) -> tuple[float, float]:
    """Standard deviations of a turn, degrees, and of a shift, by their covariance (6, 6)."""
    return float(np.rad2deg(_compute_total_sigma(covariance[:3, :3]))), _compute_total_sigma(
        covariance[3:, 3:]
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Rig:
    """Several cameras on one body, fresh from the fit or from rig.yaml.

    Attributes:
        units: of lengths: the target's; None where not known.
        cameras: the cameras; the first one's frame is the rig's.
        pairs: every two cameras.
        fit: how well it fits.
        made_by: version, date, options and hashes, plain data.
        target: the target as fitted, of a rig that was fitted just now and changed it.
        files: what it was read from, rig.yaml first; none of a rig that was fitted just now.

    """

    units: str | None
    cameras: tuple[RigCamera, ...]
    pairs: tuple[CameraPair, ...] = ()
    fit: RigFit = field(default_factory=RigFit)
    made_by: Mapping[str, Any] = field(default_factory=dict)
    target: Target | None = None
    files: tuple[Path, ...] = ()

    @property
    def origin(self) -> Origin:
        """Where the rig comes from, as far as ``made_by`` says it."""
        return Origin.of(self.made_by)

    def camera(self, name: str) -> RigCamera:
        """The camera of a name.

        Raises:
            CameraFileError: there is none.

        """
        there = {one.name: one for one in self.cameras}
        if name not in there:
            raise CameraFileError(
                f"the rig has no camera {quoted(name)}: {did_you_mean(name, list(there))}"
            )
        return there[name]

    @cached_property
    def verdict(self) -> Verdict:
        """What the rig is worth, and why."""
        from cubicfish.rigs.rig_verdict import rig_verdict

        return rig_verdict(self)

    def as_record(self) -> dict[str, Any]:
        """Plain data: what rig.yaml holds but for version and provenance."""
        return {
            "units": self.units,
            "cameras": [one.place_record() for one in self.cameras],
            "pairs": plain_record(self.pairs),
            "fit": self.fit.as_record(),
        }

    def texts(self) -> dict[str, str]:
        """Its files, by where they are in the rig's folder: rig.yaml, cameras, refined target."""
        origin = {"version": __version__, **self.made_by}
        record = {KEY: FORMAT_VERSION, **self.as_record(), "made_by": origin}
        texts = {"rig.yaml": plain_yaml_text(record)}
        for one in self.cameras:
            titled = {"title": one.name, **origin}
            texts[one.path] = camera_text(one.camera, fit=one.fit, made_by=titled)
        if self.target is not None:
            texts[REFINED] = self.target.text()
        return texts


def save_rig(
    folder: str | os.PathLike[str],
    rig: Rig,
    *,
    made_by: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write ``rig.yaml``, each camera's ``camera.yaml`` in a folder of its name, and the target.

    Args:
        folder: where.
        rig: the rig.
        made_by: plain data on where it comes from, beside what is known; the version is added.
        overwrite: whether existing files may be replaced.

    Returns:
        The files, all written together or none; ``target.refined.yaml`` where it was fitted.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or it cannot be written.
        CameraFileError: ``made_by`` is not plain data.

    """
    place, rig = Path(folder), replace(rig, made_by={**rig.made_by, **copy_plain(made_by or {})})
    texts: dict[Path, Content] = {place / name: text for name, text in rig.texts().items()}
    return write_files(texts, overwrite=overwrite, folder=place)


def _find_rig_file(given: str | os.PathLike[str]) -> Path:
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


def load_rig(given: str | os.PathLike[str]) -> Rig:
    """Read rig.yaml, or that of a folder, and the camera.yaml of each of its cameras.

    Raises:
        CameraFileError: a file is missing, malformed, of a version that is not known, or says two
            things of one; one line that names the file and the key.

    """
    path = _find_rig_file(given)
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
    file, units, cameras = Keys(path, record), record.get("units"), record.get("cameras")
    if not isinstance(units, str | None):
        file.refuse("units must be text, such as mm")
    if units is not None and (unknown := explain_unknown(units)):
        file.refuse(f"units {unknown}")
    if not isinstance(cameras, list) or not 2 <= len(cameras) <= MAX_CAMERAS:
        file.refuse(f"cameras must be a list of 2 to {MAX_CAMERAS} records: one alone is no rig")
    found = [_read_camera(path, one, f"cameras[{index}]") for index, one in enumerate(cameras)]
    RigCamera.refuse_same([one.name for one in found], str(path), CameraFileError)
    known = read_record(_Record, record) or _Record()
    return Rig(
        units=units,
        cameras=tuple(found),
        pairs=known.pairs,
        fit=known.fit,
        made_by=file.inner("made_by").data,
        files=(path, *(path.parent / one.path for one in found)),
    )


@dataclass(frozen=True, kw_only=True)
class _Record:
    """What rig.yaml holds beside its cameras, as far as it says."""

    pairs: tuple[CameraPair, ...] = ()
    fit: RigFit = field(default_factory=RigFit)


def _read_camera(path: Path, given: Any, where: str) -> RigCamera:
    record = mapping(path, given, where)
    refuse_unknown(path, record, _CAMERA_KEYS)
    keys, own = Keys(path, record, f"{where}."), record.get("camera")
    RigCamera.refuse_name(record.get("name"), f"{path}: {where}.name", CameraFileError)
    if not isinstance(own, str) or os.path.isabs(own) or ".." in Path(own).parts:
        keys.refuse(f"{where}.camera must be a file in the rig's folder or below it")
    place = keys.inner("camera_from_rig")
    rotation, translation = place.numbers("rotation", 3, 3), place.numbers("translation", 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ROUNDED or np.linalg.det(rotation) < 0:
        keys.refuse(
            f"{place.above}rotation must be a rotation: three rows of length 1 at right angles"
        )
    file, covariance = load_camera(path.parent / own), None
    if record.get("covariance") is not None:
        covariance = keys.numbers("covariance", 6, 6)
        if not _is_covariance(covariance):
            keys.refuse(
                f"{where}.covariance is none: it must be symmetric, and no variance or eigenvalue "
                "negative"
            )
    camera = RigCamera(
        name=record["name"],
        camera=file.camera,
        fit=file.fit,
        made_by=file.made_by,
        path=own,
        rotation=rotation,
        translation=translation,
        covariance=covariance,
        in_rig=read_record(ErrorsInRig, record.get("fit")) or ErrorsInRig(),
    )
    if record.get("position") is not None:
        off = np.abs(keys.numbers("position", 3) - camera.position).max()
        if off > 2 * _ROUNDED * np.linalg.norm(translation) + 1e-9:
            keys.refuse(
                f"{where}.position is not where camera_from_rig says: correct one of them, or "
                "leave position out"
            )
    return camera


def _is_covariance(matrix: FloatArray) -> bool:
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    scale[scale == 0] = 1.0
    alike = matrix / scale / scale[:, None]
    symmetric = np.abs(alike - alike.T).max() <= _ROUNDED
    return bool(symmetric and np.linalg.eigvalsh(alike).min() >= -_ROUNDED)


def _compute_total_sigma(covariance: FloatArray) -> float:
    """Standard deviation of a vector: the root of the sum over its axes."""
    return float(np.sqrt(max(np.trace(covariance), 0.0)))
