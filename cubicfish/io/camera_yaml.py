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
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from cubicfish import __version__
from cubicfish.errors import CameraFileError, CorrespondenceError
from cubicfish.files.plain_yaml import parse_plain_yaml, plain_yaml_text
from cubicfish.files.whole_files import write_files
from cubicfish.io.camera_keys import (
    FORMAT_VERSION,
    RADIAL_KEYS,
    Keys,
    make_ray_camera,
    read_keys,
    refuse_point,
    unit_norm,
)
from cubicfish.judge.camera_facts import CameraFacts
from cubicfish.judge.fit_record import ErrorStatistics, FitRecord
from cubicfish.judge.uncertainty import UncertaintyGrid
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.lift import SIZE
from cubicfish.types import FloatArray
from cubicfish.wording import shown

if TYPE_CHECKING:
    from cubicfish.models.point import PointCamera


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
        origin = {"version": __version__, **self.made_by, **copy_plain(made_by or {})}
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
        write_files({Path(path): self.text(made_by)}, overwrite=overwrite)

    def __str__(self) -> str:
        """The camera's key figures and the verdict."""
        return f"{self.line}\n{self.verdict}" if self.is_measured else self.line

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
    if not isinstance(camera, CubicCamera):
        own = {
            "lift": "point",
            "frame": camera.frame,
            "P": P,
            "point_offset": camera.offset.tolist(),
            "point_scale": float(camera.scale),
            "point_reach": float(camera.extent),
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
            "radial": dict(zip(RADIAL_KEYS, camera.radial.parameters.tolist(), strict=True)),
        }
        if camera.pupil_travel:
            own["pupil"] = {"travel": float(camera.pupil_travel), "units": camera.units}
    size = [int(side) for side in camera.image_size]
    record = {"cubicfish": FORMAT_VERSION, "image_size": size, **own}
    record |= {"fit": fit.as_record(), "made_by": dict(made_by)}
    return (f"# {shown(comment)}\n" if comment else "") + plain_yaml_text(record)


def copy_plain(made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Copy plain data that a file can hold and is read again.

    Raises:
        CameraFileError: ``made_by`` holds other data.

    """
    try:
        plain = dict(json.loads(json.dumps(made_by, allow_nan=False)))
        text = plain_yaml_text({"made_by": plain})
        text.encode()
        parse_plain_yaml(Path("made_by"), text, error=CameraFileError)
        return plain
    except (TypeError, ValueError, RecursionError) as problem:
        raise CameraFileError(
            f"made_by may hold text, finite numbers, lists and mappings: {problem}"
        ) from problem


@overload
def load_camera(path: Path | str) -> CameraFile: ...
@overload
def load_camera(path: Path | str, *, any_lift: Literal[True]) -> CameraFile | PointCameraFile: ...
def load_camera(path: Path | str, *, any_lift: bool = False) -> CameraFile | PointCameraFile:
    """Read camera.yaml: the camera is ``.camera``; what its fit said, in pixels, is ``.fit``.

    Args:
        path: the file, or its folder.
        any_lift: whether the file may be of the paper's literal ``point`` lift too, whose camera
            takes world points and has no rays, as ``cubicfish project`` reads it.

    Raises:
        CameraFileError: the file is missing, malformed, or of a version or a lift that is not
            known or wanted; one line that names the file and the key.

    """
    path = Path(path)
    path = path / "camera.yaml" if path.is_dir() else path
    file = read_keys(path)
    camera = _make_point_camera(file) if file.data["lift"] == "point" else make_ray_camera(file)
    fit, made_by = FitRecord.of(file.inner("fit").data), file.inner("made_by").data
    if not isinstance(camera, CubicCamera):
        if not any_lift:
            refuse_point(path)
        return PointCameraFile(camera=camera, fit=fit, made_by=made_by)
    _refuse_negative(file, fit.uncertainty)
    return CameraFile(camera=camera, fit=fit, made_by=made_by)


def _make_point_camera(file: Keys) -> PointCamera:
    from cubicfish.models.point import PointCamera  # of few cameras

    return PointCamera(
        image_size=file.image_size(),
        P=file.cubics(),
        frame=file.data["frame"],
        offset=file.numbers("point_offset", 3),
        scale=file.above_zero("point_scale"),
        null=file.rows("point_null", SIZE),
        extent=file.above_zero("point_reach"),
        valid=file.rows("valid", 2),
    )


def _refuse_negative(file: Keys, sigma: UncertaintyGrid) -> None:
    """Refuse standard deviations that another program, or a hand, has changed."""
    figures = (sigma.noise_px, sigma.median_px, sigma.p95_px, sigma.max_px, *sigma.focal_px)
    pixels = [one for row in (sigma.principal_point_px, *sigma.sigma_px) for one in row]
    if any(one < 0 for one in (*figures, *pixels)):
        file.refuse_change("a standard deviation of fit.uncertainty is below 0")
