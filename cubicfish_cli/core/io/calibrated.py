"""A camera with what is known of its fit: the same answers from a fit and from its file.

And its camera.yaml.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli import __version__
from cubicfish_cli.core.assess.camera_facts import CameraFacts, camera_facts
from cubicfish_cli.core.assess.fit_record import ErrorStatistics, FitRecord
from cubicfish_cli.core.assess.verdict import Verdict, verdict
from cubicfish_cli.core.errors import CameraFileError, CorrespondenceError
from cubicfish_cli.core.files import write_text
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.point import PointCamera
from cubicfish_cli.core.plain_yaml import plain_yaml_text
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.wording import quoted

FORMAT_VERSION = 1
RADIAL_KEYS = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
_MAX_DEPTH = 8  # the reader takes no more than a few levels


def camera_text(
    camera: CubicCamera | PointCamera,
    *,
    fit: FitRecord,
    made_by: Mapping[str, Any],
    comment: str = "",
) -> str:
    """The text of a camera.yaml; ``comment`` is a line for people at its top."""
    is_point = isinstance(camera, PointCamera)
    record = {
        "cubicfish": FORMAT_VERSION,
        "image_size": [int(side) for side in camera.image_size],
        "lift": "point" if is_point else "ray",
        **(_point_record(camera) if isinstance(camera, PointCamera) else _ray_record(camera)),
        "fit": fit.as_record(),
        "made_by": dict(made_by),
    }
    return (f"# {comment}\n" if comment else "") + plain_yaml_text(record)


def _ray_record(camera: CubicCamera) -> dict[str, Any]:
    return {
        "frame": "camera",
        "P": unit_norm(camera.P).tolist(),
        "max_angle_deg": float(camera.max_angle_deg),
        "valid": np.round(camera.outline(), 3).tolist(),
        "radial": dict(zip(RADIAL_KEYS, camera.radial.parameters.tolist(), strict=True)),
        **({"pupil": _pupil_record(camera)} if camera.pupil_travel else {}),
    }


def _pupil_record(camera: CubicCamera) -> dict[str, Any]:
    return {"travel": float(camera.pupil_travel), "units": camera.units}


def _point_record(camera: PointCamera) -> dict[str, Any]:
    return {
        "frame": camera.frame,
        "P": unit_norm(camera.P).tolist(),
        "point_offset": camera.offset.tolist(),
        "point_scale": float(camera.scale),
        "point_reach": float(camera.reach),
        "point_null": camera.null.tolist(),
        "valid": np.round(camera.valid, 3).tolist(),
    }


def unit_norm(P: FloatArray) -> FloatArray:
    """P with Frobenius norm 1; left to the last bit when it has that already."""
    norm = np.linalg.norm(P)
    if abs(norm - 1) < 1e-12:
        return P
    P = P / np.abs(P).max()  # squares of tiny numbers vanish
    return np.asarray(P / np.linalg.norm(P))


class CameraRecord:
    """A camera of either lift, and the record of its fit.

    Attributes:
        camera: the camera.
        fit: how well it fits.
        made_by: where it comes from, plain data; empty where nothing is known.

    """

    camera: CubicCamera | PointCamera
    fit: FitRecord
    made_by: Mapping[str, Any]

    @property
    def errors(self) -> ErrorStatistics:
        """Reprojection errors over the used pairs."""
        return self.fit

    def as_record(self) -> dict[str, Any]:
        """Plain data: ``fit`` of camera.yaml."""
        return self.fit.as_record()

    @cached_property
    def verdict(self) -> Verdict:
        """What the calibration is worth, and why: what ``cubicfish calibrate`` prints."""
        known = self.facts.verdict
        if known is not None:
            return known
        return verdict(self.fit, self.camera.image_size, self.camera.outline())

    @cached_property
    def facts(self) -> CameraFacts:
        """The camera in the figures that people ask for first."""
        return camera_facts(self.camera, self.fit, self.made_by)

    def text(self, made_by: Mapping[str, Any] | None = None) -> str:
        """The text of its camera.yaml.

        Args:
            made_by: plain data on where it comes from, beside what is known already; the version
                is added.

        Raises:
            CameraFileError: ``made_by`` is not plain data.

        """
        origin = {"version": __version__, **self.made_by, **plain(made_by or {})}
        facts = camera_facts(self.camera, self.fit, origin) if made_by else self.facts
        return camera_text(self.camera, fit=self.fit, made_by=origin, comment=facts.line)

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
            made_by: plain data on where it comes from; the version is added.
            overwrite: whether an existing file may be replaced.

        Raises:
            OutputError: the file exists and ``overwrite`` is false, or it cannot be written.
            CameraFileError: ``made_by`` is not plain data.

        """
        write_text(Path(path), self.text(made_by), overwrite=overwrite)

    def __str__(self) -> str:
        """The camera's figures, and what it is worth."""
        facts = self.facts
        return f"{facts.line}\n{facts.verdict.line}" if facts.verdict else facts.line

    def __repr__(self) -> str:
        """The camera's figures, no arrays."""
        return f"<{type(self).__name__}: {self.facts.line}>"

    def _repr_html_(self) -> str:
        """The same for a notebook."""
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
            CameraFileError: the file does not say.
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


def plain(value: Any, depth: int = 0) -> Any:
    """Data that YAML holds without more ado.

    Raises:
        CameraFileError: they are of another kind.

    """
    if depth < _MAX_DEPTH:
        if value is None or isinstance(value, str | bool | int):
            return value
        if isinstance(value, float) and math.isfinite(value):
            return float(value)
        if isinstance(value, list | tuple):
            return [plain(part, depth + 1) for part in value]
        if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            return {key: plain(part, depth + 1) for key, part in value.items()}
    raise CameraFileError(
        f"made_by holds {quoted(value)}: it may hold text, finite numbers, lists and mappings"
    )
