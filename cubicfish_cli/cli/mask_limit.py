"""``--mask``, and ``--mask-limit``: where the camera itself may be off by too much."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import FILE, option

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.map_formats import PixelMap
    from cubicfish_cli.undistortion.maps import UndistortMap

    Trusted = Callable[[UndistortMap | PixelMap], npt.NDArray[np.bool_]]

_PIXELS_A_BLOCK = 262_144  # bounds the memory that a large picture takes

mask_option = option(
    "--mask FILE", "Also write where the result may be trusted: 255, and 0 elsewhere.", FILE
)

mask_limit_option = option(
    "--mask-limit PX",
    "With --mask: 0 also where the camera's own uncertainty is above this, in pixels of the "
    "photo as calibrated.",
    FloatRange(0, min_open=True),
)


def check_mask_limit(limit: float | None, mask: Path | None) -> None:
    """Refuse a limit without a mask.

    Raises:
        click.UsageError: it has none, or is not a number.

    """
    if limit is None:
        return
    if math.isnan(limit):
        raise click.UsageError("--mask-limit must be a number of pixels above 0")
    if mask is None:
        raise click.UsageError("--mask-limit goes with --mask: name the mask's file")


def uncertainty_of(loaded: CameraFile | PointCameraFile, path: Path) -> dict[str, Any]:
    """The uncertainty over the photo that a camera file holds.

    Raises:
        CameraFileError: it holds none that can be used.

    """
    import numpy as np

    from cubicfish_cli.errors import CameraFileError
    from cubicfish_cli.formats.camera_yaml import PointCameraFile

    if isinstance(loaded, PointCameraFile):
        raise CameraFileError(
            f"{path} is of lift 'point', which has no uncertainty: leave out --mask-limit, or "
            "calibrate with --lift ray"
        )
    record = loaded.fit.get("uncertainty")
    if not isinstance(record, dict):
        raise CameraFileError(
            f"{path} does not hold the camera's uncertainty (fit.uncertainty): calibrate again "
            "with this version, or leave out --mask-limit"
        )
    try:
        x, y = (np.array(record[axis], float) for axis in "xy")
        sigma = np.array(record["sigma_px"], float)  # None becomes NaN
        usable = sigma.shape == (len(y), len(x)) and all(
            len(line) > 1 and bool((np.diff(line) > 0).all()) for line in (x, y)
        )
    except (KeyError, TypeError, ValueError):
        usable = False
    if not usable:
        raise CameraFileError(
            f"{path}: fit.uncertainty is not a grid of numbers: calibrate again with this version, "
            "or leave out --mask-limit"
        )
    return record


def trusted_within(
    limit: float,
    record: dict[str, Any],
    *,
    calibrated_size: tuple[int, int],
    size: tuple[int, int],
    crop: Crop | None,
) -> Trusted:
    """What says of each pixel of a map whether it may be trusted to so many pixels.

    Args:
        limit: the largest uncertainty, pixels of the photo as calibrated.
        record: what :func:`uncertainty_of` gave.
        calibrated_size: (width, height) of the photos that were calibrated.
        size: (width, height) of the photos that the map is for.
        crop: what part of the calibrated photo they show.

    Returns:
        map -> (H, W), true where the map is valid and the uncertainty is known and within.

    """
    import numpy as np

    from cubicfish_cli.assess.field_uncertainty import sigma_at
    from cubicfish_cli.undistortion.frames import calibrated_pixels

    def trusted(made: UndistortMap | PixelMap) -> npt.NDArray[np.bool_]:
        within = np.zeros_like(made.valid)
        rows_a_block = max(1, _PIXELS_A_BLOCK // made.valid.shape[1])
        for top in range(0, len(made.valid), rows_a_block):
            rows = slice(top, top + rows_a_block)
            valid = made.valid[rows]
            pixel = np.stack([made.map_x[rows][valid], made.map_y[rows][valid]], axis=-1)
            source = calibrated_pixels(pixel.astype(float), calibrated_size, size, crop)
            # A comparison with NaN, where nothing is known, is false.
            within[rows][valid] = sigma_at(record, source) <= limit
        return within

    return trusted
