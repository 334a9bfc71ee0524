"""camera.yaml: a camera as plain YAML that ten lines of numpy can read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.core.assess.fit_record import FitRecord, fit_record
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.io.calibrated import (
    FORMAT_VERSION,
    RADIAL_KEYS,
    Calibrated,
    CameraRecord,
    unit_norm,
)
from cubicfish_cli.core.lenses.cubic import CubicCamera, check_validity
from cubicfish_cli.core.lenses.lift import SIZE
from cubicfish_cli.core.lenses.point import Frame, PointCamera
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import mapping, parse_plain_yaml, refuse_unknown, refuse_version
from cubicfish_cli.core.reading import read_text
from cubicfish_cli.core.types import FloatArray

# A calibration of some ten thousand photos; nobody's camera file is larger.
MAX_BYTES = 64 * 1024 * 1024
MAX_SIDE = 100_000
_KEYS = (
    "cubicfish",
    "image_size",
    "lift",
    "frame",
    "P",
    "max_angle_deg",
    "valid",
    "radial",
    "pupil",
    "fit",
    "made_by",
    "point_offset",
    "point_scale",
    "point_reach",
    "point_null",
)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CameraFile(Calibrated):
    """What a camera.yaml holds; it answers what the fit answered.

    Attributes:
        camera: the camera.
        fit: how well it fits.
        made_by: version, date, options and hashes, plain data.

    """

    camera: CubicCamera
    fit: FitRecord
    made_by: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PointCameraFile(CameraRecord):
    """What a camera.yaml of the ``point`` lift holds; see :class:`CameraFile`."""

    camera: PointCamera
    fit: FitRecord
    made_by: Mapping[str, Any]


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
            "--plane' alone; calibrate with --lift ray for this"
        )
    return loaded


_NO_CAMERA = "name the camera.yaml that 'cubicfish calibrate'"


def load_any_camera(path: Path | str) -> CameraFile | PointCameraFile:
    """Read camera.yaml of either lift, the paper's literal ``point`` too, as ``project`` does.

    Raises:
        CameraFileError: the file is missing, malformed, or of a version or a lift that is not
            known; one line that names the file and the key.

    """
    path = Path(path)
    path = path / "camera.yaml" if path.is_dir() else path
    text = read_text(path, max_bytes=MAX_BYTES, error=CameraFileError)
    none = CameraFileError(
        f"{path} is not a camera file (it has no key 'cubicfish'): {_NO_CAMERA} wrote, or read "
        "another tool's with 'cubicfish import'"
    )
    if text.startswith("%"):  # OpenCV's files, which are not quite YAML
        raise none
    record = parse_plain_yaml(path, text, error=CameraFileError, if_empty=f"{_NO_CAMERA} wrote")
    if not isinstance(record, dict) or "cubicfish" not in record:
        if isinstance(record, dict) and "boards" in record:
            raise CameraFileError(
                f"{path} is a calibration target, not a camera: {_NO_CAMERA} wrote"
            )
        keys = map(str, record if isinstance(record, dict) else ())
        other = next((key for key in keys if key.startswith("cubicfish_")), "").partition("_")[2]
        if other:  # of several cameras on one body, or of two turned into rows
            raise CameraFileError(f"{path} is of a {other}, not of one camera: {_NO_CAMERA} wrote")
        raise none
    refuse_version(path, record["cubicfish"], FORMAT_VERSION)
    refuse_unknown(path, record, _KEYS)
    kind = (record.get("lift"), record.get("frame"))
    if kind not in (("ray", "camera"), ("point", "world"), ("point", "camera")):
        raise CameraFileError(
            f"{path}: lift and frame must be 'ray' and 'camera', or 'point' and either 'world' or "
            "'camera': calibrate again"
        )
    image_size = _image_size(path, record)
    P = _numbers(path, record, "P", (3, SIZE))
    if not P.any():
        raise CameraFileError(f"{path}: P is all zeros: calibrate again")
    known, made_by = (mapping(path, record.get(key, {}), key) for key in ("fit", "made_by"))
    fit = fit_record(known)
    if kind[0] == "point":
        frame: Frame = "world" if kind[1] == "world" else "camera"
        point = _point_camera(path, record, image_size, P, frame)
        return PointCameraFile(camera=point, fit=fit, made_by=made_by)
    camera = _ray_camera(path, record, image_size, P)
    _refuse_contradictions(path, record, camera, fit)
    return CameraFile(camera=camera, fit=fit, made_by=made_by)


def _image_size(path: Path, record: dict[str, Any]) -> tuple[int, int]:
    size = _numbers(path, record, "image_size", (2,))
    if not all(side == int(side) and 0 < side <= MAX_SIDE for side in size):
        raise CameraFileError(f"{path}: image_size must be two whole numbers above 0")
    return int(size[0]), int(size[1])


def _point_camera(
    path: Path, record: dict[str, Any], image_size: tuple[int, int], P: FloatArray, frame: Frame
) -> PointCamera:
    scale = float(_numbers(path, record, "point_scale", ()))
    reach = float(_numbers(path, record, "point_reach", ()))
    if scale <= 0 or reach <= 0:
        raise CameraFileError(f"{path}: point_scale and point_reach must be above 0")
    return PointCamera(
        image_size=image_size,
        P=unit_norm(P),
        frame=frame,
        offset=_numbers(path, record, "point_offset", (3,)),
        scale=scale,
        null=_rows(path, record, "point_null", SIZE),
        reach=reach,
        valid=_rows(path, record, "valid", 2),
    )


def _rows(path: Path, record: dict[str, Any], key: str, columns: int) -> FloatArray:
    """The rows of numbers under a key, however many."""
    rows = record.get(key)
    count = len(rows) if isinstance(rows, list) else 1
    return _numbers(path, record, key, (count, columns)) if count else np.zeros((0, columns))


def _ray_camera(
    path: Path, record: dict[str, Any], image_size: tuple[int, int], P: FloatArray
) -> CubicCamera:
    max_angle_deg = float(_numbers(path, record, "max_angle_deg", ()))
    if not 0 < max_angle_deg < 180:
        raise CameraFileError(f"{path}: max_angle_deg must be between 0 and 180")
    pupil = mapping(path, record.get("pupil", {"travel": 0.0}), "pupil")
    units = pupil.get("units")
    if not isinstance(units, str | None):
        raise CameraFileError(f"{path}: pupil.units must be a word, as in target.yaml")
    camera = CubicCamera(
        image_size=image_size,
        P=unit_norm(P),
        max_angle_deg=max_angle_deg,
        radial=_radial(path, record, image_size),
        pupil_travel=float(_numbers(path, pupil, "travel", (), "pupil.")),
        units=units,
    )
    validity = check_validity(camera.P, max_angle_deg)
    if not validity.valid:
        raise CameraFileError(
            f"{path}: P has a pole or a fold at {validity.valid_to_deg:.1f}° from the axis, "
            f"inside its max_angle_deg of {max_angle_deg:.1f}: the file was changed or cut, "
            "calibrate again"
        )
    return camera


def _refuse_contradictions(
    path: Path, record: dict[str, Any], camera: CubicCamera, fit: FitRecord
) -> None:
    """Refuse figures that another program, or a hand, has changed without the others."""
    width, height = camera.image_size
    sigma = fit.uncertainty
    if "valid" in record:
        outline = _rows(path, record, "valid", 2)
        if len(outline) and bool((outline.max(axis=0) > [width, height]).any()):
            raise CameraFileError(
                f"{path}: the outline of 'valid' reaches beyond the photo of image_size: the file "
                "was changed by hand, calibrate again"
            )
    grid = [(sigma.x, width), (sigma.y, height)]
    if any(side and abs(side[-1] - (size - 1)) > 1 for side, size in grid):
        raise CameraFileError(
            f"{path}: image_size is not that of the grid of fit.uncertainty: the file was changed "
            "by hand, calibrate again"
        )
    figures = [sigma.noise_px, sigma.median_px, sigma.p95_px, sigma.max_px]
    figures += [*sigma.focal_px, *sigma.principal_point_px, *chain.from_iterable(sigma.sigma_px)]
    if any(one < 0 for one in figures):
        raise CameraFileError(
            f"{path}: a standard deviation of fit.uncertainty is below 0: the file was changed by "
            "hand, calibrate again"
        )


def _radial(path: Path, record: dict[str, Any], image_size: tuple[int, int]) -> RadialCamera:
    reference = mapping(path, record.get("radial", {}), "radial")
    missing = [key for key in RADIAL_KEYS if key not in reference]
    if missing:
        raise CameraFileError(f"{path}: radial has no key {missing[0]!r}: calibrate again")
    values = np.array(
        [_numbers(path, reference, key, (), "radial.") for key in RADIAL_KEYS], dtype=float
    )
    if values[0] <= 0 or values[1] <= 0:
        raise CameraFileError(f"{path}: radial.fx and radial.fy must be above 0")
    return RadialCamera.from_parameters(values, image_size)


def _numbers(
    path: Path, record: dict[str, Any], key: str, shape: tuple[int, ...], prefix: str = ""
) -> FloatArray:
    """The numbers under a key, all finite, in the shape that the format has there."""
    if key not in record:
        raise CameraFileError(f"{path} has no key {prefix + key!r}: calibrate again")
    wanted = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
    problem = CameraFileError(f"{path}: {prefix + key} must be {wanted}, all finite")
    if not _is_numeric(record[key], len(shape)):
        raise problem
    try:
        value = np.array(record[key], dtype=float)
    except (ValueError, OverflowError) as error:
        raise problem from error
    if value.shape != shape or not np.isfinite(value).all() or np.abs(value).max() > 1e100:
        raise problem
    return value


def _is_numeric(value: Any, depth: int) -> bool:
    if depth == 0:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(value, list) and all(_is_numeric(item, depth - 1) for item in value)
