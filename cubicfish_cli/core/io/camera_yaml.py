"""camera.yaml: a camera, and its fit's record, as plain YAML that ten lines of numpy can read.

A fit and its file give the same answers: both are a :class:`Calibrated`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from cubicfish_cli import __version__
from cubicfish_cli.core.assess.camera_facts import CameraFacts
from cubicfish_cli.core.assess.fit_record import ErrorStatistics, FitRecord, fit_record
from cubicfish_cli.core.errors import CameraFileError, CorrespondenceError
from cubicfish_cli.core.files import write_text
from cubicfish_cli.core.lenses.cubic import CubicCamera, pole_or_fold_deg
from cubicfish_cli.core.lenses.lift import SIZE
from cubicfish_cli.core.lenses.point import PointCamera
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import (
    mapping,
    parse_plain_yaml,
    plain_yaml_text,
    refuse_unknown,
    refuse_version,
)
from cubicfish_cli.core.reading import MAX_SIDE, read_text
from cubicfish_cli.core.types import FloatArray

FORMAT_VERSION = 1
# Enough for a calibration of some ten thousand photos; no camera file is larger.
_MAX_BYTES = 64 * 1024 * 1024
_RADIAL = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
_KEYS = (
    *("cubicfish", "image_size", "lift", "frame", "P", "max_angle_deg", "valid", "radial", "pupil"),
    *("fit", "made_by", "point_offset", "point_scale", "point_reach", "point_null"),
)
_NO_CAMERA = "name the camera.yaml that 'cubicfish calibrate'"


class CameraRecord(CameraFacts):
    """A camera of either lift, and the record of its fit, as camera.yaml keeps them."""

    @property
    def errors(self) -> ErrorStatistics:
        """Reprojection errors over the used pairs."""
        return self.fit

    def as_record(self) -> dict[str, Any]:
        """Plain data: ``fit`` of camera.yaml."""
        return self.fit.as_record()

    def text(self, made_by: Mapping[str, Any] | None = None) -> str:
        """The text of its camera.yaml.

        Args:
            made_by: plain data on where the camera comes from, beside what is known; the version is
                added.

        Raises:
            CameraFileError: ``made_by`` is not plain data.

        """
        origin = {"version": __version__, **self.made_by, **_copy_plain(made_by or {})}
        comment = replace(self, made_by=origin).line
        return camera_text(self.camera, fit=self.fit, made_by=origin, comment=comment)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        made_by: Mapping[str, Any] | None = None,
        overwrite: bool = False,
    ) -> None:
        """Write ``camera.yaml``, which every command reads.

        Args:
            path: the file.
            made_by: plain data on where the camera comes from; the version is added.
            overwrite: whether an existing file may be replaced.

        Raises:
            OutputError: the file exists and ``overwrite`` is false, or it cannot be written.
            CameraFileError: ``made_by`` is not plain data.

        """
        write_text(Path(path), self.text(made_by), overwrite=overwrite)

    def __str__(self) -> str:
        """The camera's key figures and the verdict."""
        return f"{self.line}\n{self.verdict.line}" if self.is_measured else self.line

    def __repr__(self) -> str:
        """The camera's key figures, no arrays."""
        return f"<{type(self).__name__}: {self.line}>"

    def _repr_html_(self) -> str:
        """The text of ``str()`` for a notebook."""
        return "<br>".join(map(escape, str(self).splitlines()))


class Calibrated(CameraRecord):
    """A camera with rays, and the record of its fit."""

    camera: CubicCamera

    def uncertainty(self, pixel: npt.ArrayLike) -> FloatArray:
        """How far the camera itself may be off: sqrt(var x + var y) of a distant point's pixel.

        That is how far the pixel would move if the same photos were taken again with other
        noise. It is interpolated on the grid over the photo that the fit left.

        Args:
            pixel: (..., 2) x, y.

        Returns:
            (...,) pixels; NaN outside the photo and the camera's field.

        Raises:
            CameraFileError: the file has no uncertainty.
            CorrespondenceError: ``pixel`` has another shape.

        """
        pixel = np.asarray(pixel, float)
        if not pixel.ndim or pixel.shape[-1] != 2:
            raise CorrespondenceError(f"pixel has the shape {pixel.shape}, not (..., 2)")
        flat = pixel.reshape(-1, 2)
        sides = np.array(self.camera.image_size)
        index = np.flatnonzero(((flat >= -0.5) & (flat <= sides - 0.5)).all(axis=1))
        seen = index[np.isfinite(self.camera.unproject(flat[index])[:, 0])]
        known, sigma = self.fit.uncertainty.at(flat[seen]), np.full(len(flat), np.nan)
        if known is None:
            raise CameraFileError(
                "this camera's file does not say how certain it is: calibrate again"
            )
        sigma[seen] = known
        return sigma.reshape(pixel.shape[:-1])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CameraFile(Calibrated):
    """The content of a camera.yaml, with the properties and methods of a fresh calibration."""

    camera: CubicCamera


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PointCameraFile(CameraRecord):
    """The content of a camera.yaml of the ``point`` lift; see :class:`CameraFile`."""

    camera: PointCamera


def camera_text(
    camera: CubicCamera | PointCamera,
    *,
    fit: FitRecord,
    made_by: Mapping[str, Any],
    comment: str = "",
) -> str:
    """The text of a camera.yaml; ``comment`` is a line for people at its top."""
    own: dict[str, Any]
    P = unit_norm(camera.P).tolist()
    if isinstance(camera, PointCamera):
        own = {
            "lift": "point",
            "frame": camera.frame,
            "P": P,
            "point_offset": camera.offset.tolist(),
            "point_scale": float(camera.scale),
            "point_reach": float(camera.reach),
            "point_null": camera.null.tolist(),
            "valid": np.round(camera.valid, 3).tolist(),
        }
    else:
        own = {
            "lift": "ray",
            "frame": "camera",
            "P": P,
            "max_angle_deg": float(camera.max_angle_deg),
            "valid": np.round(camera.outline(), 3).tolist(),
            "radial": dict(zip(_RADIAL, camera.radial.parameters.tolist(), strict=True)),
        }
        if camera.pupil_travel:
            own["pupil"] = {"travel": float(camera.pupil_travel), "units": camera.units}
    size = [int(side) for side in camera.image_size]
    record = {"cubicfish": FORMAT_VERSION, "image_size": size, **own}
    record |= {"fit": fit.as_record(), "made_by": dict(made_by)}
    return (f"# {comment}\n" if comment else "") + plain_yaml_text(record)


def unit_norm(P: FloatArray) -> FloatArray:
    """P with Frobenius norm 1; unchanged to the last bit when it has that norm already."""
    norm = np.linalg.norm(P)
    if abs(norm - 1) < 1e-12:
        return P
    P = P / np.abs(P).max()  # squares of tiny numbers vanish
    return np.asarray(P / np.linalg.norm(P))


def _copy_plain(made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Copy plain data, which YAML can hold.

    Raises:
        CameraFileError: ``made_by`` holds other data.

    """
    try:
        return dict(json.loads(json.dumps(made_by, allow_nan=False)))
    except (TypeError, ValueError, RecursionError) as problem:
        raise CameraFileError(
            f"made_by may hold text, finite numbers, lists and mappings: {problem}"
        ) from problem


def load_camera(path: Path | str) -> CameraFile:
    """Read camera.yaml of a central camera (the ``ray`` lift).

    The camera is ``.camera``; what its fit said, in pixels, is ``.fit``.

    Raises:
        CameraFileError: the file is missing, malformed, of a version that is not known, or of
            the ``point`` lift; one line that names the file and the key.

    """
    loaded = load_any_camera(Path(path))
    if isinstance(loaded, PointCameraFile):
        raise CameraFileError(
            f"{path} is of lift 'point', which has no rays: it serves 'project' and 'undistort "
            "--view plane:BOARD' alone; calibrate with --lift ray for this"
        )
    return loaded


def load_any_camera(path: Path | str) -> CameraFile | PointCameraFile:
    """Read camera.yaml of either lift, the paper's literal ``point`` too, as ``project`` does.

    Raises:
        CameraFileError: the file is missing, malformed, or of a version or a lift that is not
            known; one line that names the file and the key.

    """
    path = Path(path)
    path = path / "camera.yaml" if path.is_dir() else path
    file = Keys(path, _read(path))
    lift, frame = file.data.get("lift"), file.data.get("frame")
    if (lift, frame) not in (("ray", "camera"), ("point", "world"), ("point", "camera")):
        file.refuse(
            "lift and frame must be 'ray' and 'camera', or 'point' and either 'world' or "
            "'camera': calibrate again"
        )
    size = file.numbers("image_size", 2)
    if not all(side == int(side) and 0 < side <= MAX_SIDE for side in size):
        file.refuse("image_size must be two whole numbers above 0")
    image_size = (int(size[0]), int(size[1]))
    P = file.numbers("P", 3, SIZE)
    if not P.any():
        file.refuse("P is all zeros: calibrate again")
    fit, made_by = fit_record(file.inner("fit").data), file.inner("made_by").data
    if lift == "point":
        point = PointCamera(
            image_size=image_size,
            P=unit_norm(P),
            frame="world" if frame == "world" else "camera",
            offset=file.numbers("point_offset", 3),
            scale=file.above_zero("point_scale"),
            null=file.rows("point_null", SIZE),
            reach=file.above_zero("point_reach"),
            valid=file.rows("valid", 2),
        )
        return PointCameraFile(camera=point, fit=fit, made_by=made_by)
    camera = _make_ray_camera(file, image_size, P)
    _refuse_contradictions(file, image_size, fit)
    return CameraFile(camera=camera, fit=fit, made_by=made_by)


def _read(path: Path) -> dict[str, Any]:
    """The keys and values of a camera file of this version; an error says what else it is."""
    text = read_text(path, max_bytes=_MAX_BYTES, error=CameraFileError)
    parsed: Any = None
    if not text.startswith("%"):  # OpenCV's files, which are not quite YAML
        parsed = parse_plain_yaml(path, text, error=CameraFileError, if_empty=f"{_NO_CAMERA} wrote")
    record: dict[str, Any] = parsed if isinstance(parsed, dict) else {}
    if "cubicfish" in record:
        refuse_version(path, record["cubicfish"], FORMAT_VERSION)
        refuse_unknown(path, record, _KEYS)
        return record
    if "boards" in record:
        raise CameraFileError(f"{path} is a calibration target, not a camera: {_NO_CAMERA} wrote")
    other = next((key for key in record if key.startswith("cubicfish_")), "").partition("_")[2]
    if other:  # of several cameras on one body, or of two turned into rows
        raise CameraFileError(f"{path} is of a {other}, not of one camera: {_NO_CAMERA} wrote")
    raise CameraFileError(
        f"{path} is not a camera file (it has no key 'cubicfish'): {_NO_CAMERA} wrote, or read "
        "another tool's with 'cubicfish import'"
    )


def _make_ray_camera(file: Keys, image_size: tuple[int, int], P: FloatArray) -> CubicCamera:
    max_angle_deg = float(file.numbers("max_angle_deg"))
    if not 0 < max_angle_deg < 180:
        file.refuse("max_angle_deg must be between 0 and 180")
    radial, travel, units = file.inner("radial"), 0.0, None
    focal = [radial.above_zero(key) for key in _RADIAL[:2]]
    others = [float(radial.numbers(key)) for key in _RADIAL[2:]]
    if "pupil" in file.data:
        pupil = file.inner("pupil")
        travel, units = float(pupil.numbers("travel")), pupil.data.get("units")
        if not isinstance(units, str | None):
            file.refuse("pupil.units must be a word, as in target.yaml")
    camera = CubicCamera(
        image_size=image_size,
        P=unit_norm(P),
        max_angle_deg=max_angle_deg,
        radial=RadialCamera.from_parameters(np.array([*focal, *others]), image_size),
        pupil_travel=travel,
        units=units,
    )
    fault_deg = pole_or_fold_deg(camera.P, max_angle_deg)
    if fault_deg is not None:
        file.refuse(
            f"P has a pole or a fold at {fault_deg:.1f}° from the axis, "
            f"inside its max_angle_deg of {max_angle_deg:.1f}: the file was changed or cut, "
            "calibrate again"
        )
    return camera


def _refuse_contradictions(file: Keys, image_size: tuple[int, int], fit: FitRecord) -> None:
    """Refuse figures that another program, or a hand, has changed without the others."""
    sigma, wrong = fit.uncertainty, ""
    figures = (sigma.noise_px, sigma.median_px, sigma.p95_px, sigma.max_px, *sigma.focal_px)
    pixels = [one for row in (sigma.principal_point_px, *sigma.sigma_px) for one in row]
    outline = file.rows("valid", 2) if "valid" in file.data else np.zeros((0, 2))
    grid = zip((sigma.x, sigma.y), image_size, strict=True)
    if bool((outline > image_size).any()):
        wrong = "the outline of 'valid' reaches beyond the photo of image_size"
    elif any(side and abs(side[-1] - (size - 1)) > 1 for side, size in grid):
        wrong = "image_size is not that of the grid of fit.uncertainty"
    elif any(one < 0 for one in (*figures, *pixels)):
        wrong = "a standard deviation of fit.uncertainty is below 0"
    if wrong:
        file.refuse(f"{wrong}: the file was changed by hand, calibrate again")


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


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e100
