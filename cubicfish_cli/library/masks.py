"""Where a rendered picture may be trusted, by the camera's own uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.assess.field_uncertainty import sigma_at
from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
from cubicfish_cli.undistortion.frames import Crop, calibrated_pixels
from cubicfish_cli.undistortion.maps import UndistortMap

_PIXELS_A_BLOCK = 262_144  # bounds the memory that a large picture takes


class TrustedWithin:
    """Says of each pixel of a map whether the camera may be trusted there to so many pixels."""

    def __init__(
        self, limit: float, loaded: CameraFile | PointCameraFile, path: Path, crop: Crop | None
    ) -> None:
        """Prepare for a camera.

        Args:
            limit: the largest uncertainty, pixels of the photo as calibrated.
            loaded: the camera's file.
            path: where that is, for messages.
            crop: what part of the calibrated photo photos show.

        Raises:
            CameraFileError: it holds no uncertainty that can be used.

        """
        self._limit, self._record, self._crop = limit, _uncertainty_of(loaded, path), crop
        self._size = loaded.camera.image_size

    def mask(self, made: UndistortMap, size: tuple[int, int]) -> npt.NDArray[np.bool_]:
        """Where the map is valid and the uncertainty is known and within, (H, W).

        Args:
            made: the map.
            size: (width, height) of the photos that it is for.

        """
        within = np.zeros_like(made.valid)
        rows_a_block = max(1, _PIXELS_A_BLOCK // made.valid.shape[1])
        for top in range(0, len(made.valid), rows_a_block):
            rows = slice(top, top + rows_a_block)
            valid = made.valid[rows]
            pixel = np.stack([made.map_x[rows][valid], made.map_y[rows][valid]], axis=-1)
            source = calibrated_pixels(pixel.astype(float), self._size, size, self._crop)
            # A comparison with NaN, where nothing is known, is false.
            within[rows][valid] = sigma_at(self._record, source) <= self._limit
        return within


def _uncertainty_of(loaded: CameraFile | PointCameraFile, path: Path) -> dict[str, Any]:
    """The uncertainty over the photo that a camera file holds."""
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
