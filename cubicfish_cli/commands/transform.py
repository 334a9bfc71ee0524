"""``cubicfish transform``: a camera for photos that are cropped or scaled, exactly."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run, UsageError, ViewError
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, Parsed, as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_wrote, result

if TYPE_CHECKING:
    from cubicfish import CameraFile

# Pixels: a scale is written with some digits, and photos have whole sizes.
_WHOLE_PX = 0.01


@dataclass(frozen=True)
class Crop:
    """A crop of a photo: its first pixel (x, y), and its size."""

    x: int
    y: int
    width: int
    height: int

    def __str__(self) -> str:
        """Return the crop as --crop takes it."""
        return f"{self.x},{self.y},{self.width}x{self.height}"


def _read_crop(text: str) -> Crop:
    found = re.fullmatch(r"([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6})x([0-9]{1,6})", text)
    if found is None:
        raise ViewError("write X,Y,WIDTHxHEIGHT in whole pixels, such as 320,180,1280x720")
    return Crop(*map(int, found.groups()))


@record
class TransformOptions:
    """Options of :func:`transform_files`.

    Attributes:
        camera: the file or folder of the camera.
        output: the file of the new camera.
        crop: the part of the photo that is kept; None for all.
        scale: the scale of that part.

    """

    camera: StrPath = parameters.camera_options
    output: StrPath = parameters.output_option("Where the camera goes.", default="camera.yaml")
    crop: Crop | None = option(
        "--crop X,Y,WIDTHxHEIGHT",
        "What is left of the photo: its first pixel, and its size. [default: all]",
        Parsed("X,Y,WIDTHxHEIGHT", _read_crop),
    )
    scale: float = option(
        "--scale S",
        "By how much what is left is scaled: 0.5 halves it, as binning by two does.",
        FloatRange(min=0, min_open=True, max=100),
        1.0,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class TransformedFile:
    """The camera that was written, and where."""

    file: Path
    camera: CameraFile

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish transform --json`` prints.

        Keys:
            model: the camera file
            image_size: [width, height] of the other photos
            rms_px: the RMS of the calibration, in the other photos' pixels

        """
        size, rms_px = self.camera.camera.image_size, self.camera.fit.rms_px
        return {"model": self.file, "image_size": size, "rms_px": rms_px}


def transform_camera(camera: CameraFile, *, crop: Crop | None, scale: float) -> CameraFile:
    """Return the camera for another mode of the same sensor and lens, with the record of its fit.

    A pixel (x, y) of the photo becomes ((x - X + 0.5) s - 0.5, (y - Y + 0.5) s - 0.5): pixel (0, 0)
    is the middle of the first one. P3 stays, and a multiple of it is added to P1 and P2, so that
    nothing is fitted; the field and its cone stay too. Figures in pixels are scaled: errors, and
    the standard deviations, whose grid is laid over the new photo.

    Args:
        camera: the camera, with the record of its fit.
        crop: the part of the photo that is kept, before scaling; None for all.
        scale: the scale of that part.

    Raises:
        UsageError: the crop reaches beyond the photo, or the size is not one of whole pixels.

    """
    import numpy as np

    from cubicfish import CameraFile
    from cubicfish.judge import FitRecord

    old = camera.camera
    left = crop or Crop(0, 0, *old.image_size)
    width, height = left.width, left.height
    ends = left.x + width <= old.image_size[0] and left.y + height <= old.image_size[1]
    if min(width, height) < 1 or not ends:
        raise UsageError(
            f"--crop {left} is not within the photo of {old.image_size[0]}x{old.image_size[1]} "
            "pixels: choose a part of it"
        )
    size = round(width * scale), round(height * scale)
    if min(size) < 1 or np.abs(np.multiply((width, height), scale) - size).max() > _WHOLE_PX:
        raise UsageError(
            f"{width}x{height} pixels times {scale:g} are not whole ones: choose --crop and "
            "--scale so that width and height are, as the mode's own photos have them"
        )
    first, factor = np.array([left.x, left.y]), np.divide(size, (width, height))
    shift = (0.5 - first) * factor - 0.5
    P = old.P.copy()
    P[:2] = factor[:, None] * P[:2] + shift[:, None] * P[2]
    radial = old.radial
    fx, fy = factor * [radial.fx, radial.fy]
    cx, cy = factor * [radial.cx, radial.cy] + shift
    moved = replace(
        old,
        image_size=size,
        P=P,
        radial=replace(radial, image_size=size, fx=fx, fy=fy, cx=cx, cy=cy),
    )
    pixels = math.sqrt(float(factor.prod()))
    fit = FitRecord.of(_scale_record(camera.fit.as_record(), pixels))
    grid = fit.uncertainty
    if grid.has_grid:
        across, down = (
            np.linspace(0, side - 1, len(places))
            for side, places in zip(size, (grid.x, grid.y), strict=True)
        )
        places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        sigma = grid.at((places - shift) / factor)
        assert sigma is not None
        seen = np.isfinite(moved.unproject(places)[:, 0])
        sigma = np.where(seen, sigma, np.nan)
        rows = sigma.reshape(len(down), len(across))
        other = replace(
            grid,
            x=tuple(across.tolist()),
            y=tuple(down.tolist()),
            sigma_px=tuple(map(tuple, rows.tolist())),
        )
        known = sigma[np.isfinite(sigma)]
        if len(known):
            median, p95, most = map(float, np.percentile(known, [50, 95, 100]))
            other = replace(other, median_px=median, p95_px=p95, max_px=most)
        fit = replace(fit, uncertainty=other)
    return CameraFile(camera=moved, fit=fit, made_by=camera.made_by)


def _scale_record(value: Any, factor: float, key: str = "") -> Any:
    """Return a fit's plain record with all figures in pixels scaled."""
    if isinstance(value, Mapping):
        own = key == "held_out_by_level"
        return {
            name: _scale_record(one, factor, "_px" if own else name) for name, one in value.items()
        }
    if isinstance(value, list | tuple):
        return [_scale_record(one, factor, key) for one in value]
    counts = key.endswith("_px") and isinstance(value, float)
    return value * factor if counts else value


def transform_files(options: TransformOptions, *, run: Run = Run()) -> TransformedFile:
    """Write a camera for another mode of its sensor, as ``cubicfish transform`` does.

    Raises:
        UsageError: as :func:`transform_camera`.
        CubicfishError: the camera cannot be read, or its file exists and may not be replaced.

    """
    from cubicfish import load_camera
    from cubicfish.files import Fingerprint

    path, goal = in_folder(Path(options.camera)), Path(options.output)
    Plan(run).reads(path).writes(goal)
    source, loaded = Fingerprint.of(path), load_camera(path)
    made = transform_camera(loaded, crop=options.crop, scale=options.scale)
    given = {"crop": None if options.crop is None else str(options.crop), "scale": options.scale}
    origin = run.made_by(given, files=[source])
    made = replace(made, made_by={**loaded.made_by, **origin})
    made.save(goal, overwrite=run.overwrite)
    return TransformedFile(file=goal, camera=made)


@as_command(
    "transform",
    "Adapt the camera to cropped or scaled photos.",
    "cubicfish transform --crop 320,180,1280x720 -o cropped.yaml",
    "cubicfish transform lens_a/ --scale 0.5 -o binned.yaml",
    do=transform_files,
    how=("overwrite", "as_json"),
)
def command(made: TransformedFile, given: TransformOptions, how: How) -> None:
    """Write the camera in FOLDER (by default: calibration) for another mode of its sensor.

    Photos of that mode show what the calibrated ones do, cropped first and then scaled. Nothing is
    fitted: the new camera sees the same rays to the last digits and keeps its field, and its errors
    and uncertainty are in the new pixels.
    """
    if how.print(made):
        return
    print_wrote([made.file])
    result(made.camera.line)
