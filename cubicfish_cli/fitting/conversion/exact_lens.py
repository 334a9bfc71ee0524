"""A lens of another tool as it is, both ways: pixels of points, and rays of pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.fitting.conversion.from_lens import ImportedCamera, from_lens
from cubicfish_cli.fitting.conversion.lens_model import FloatArray
from cubicfish_cli.fitting.conversion.models import MODELS
from cubicfish_cli.model.lens_record import LensRecord

_ROUNDS = 8
_STEP = 1e-6
_TOLERANCE_PX = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class ExactLens:
    """A lens record, with rays found by Newton's rounds from the nearest cubic camera.

    Attributes:
        record: the lens.
        nearest: the cubic camera nearest to it; its field is the lens's here too.

    """

    record: LensRecord
    nearest: ImportedCamera

    @classmethod
    def of(cls, record: LensRecord) -> ExactLens:
        """The lens of a record.

        Raises:
            FitError: it sees nothing of its photo, or no cubic camera is near it.

        """
        return cls(record=record, nearest=from_lens(record))

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.record.image_size

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Points in the camera frame (..., 3) -> pixels (..., 2), NaN outside the field."""
        points = np.asarray(points, float)
        flat = points.reshape(-1, 3)
        pixel = MODELS[self.record.model].project(self.record, flat)
        limit = np.radians(self.nearest.camera.max_angle_deg)
        with np.errstate(invalid="ignore"):
            seen = angle_from_axis(flat) <= limit
        seen &= (flat != 0).any(axis=1)
        return np.where(seen[:, None], pixel, np.nan).reshape(*points.shape[:-1], 2)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays (..., 3), NaN outside the field."""
        pixel = np.asarray(pixel, float)
        wanted = pixel.reshape(-1, 2)
        rays = self.nearest.camera.unproject(wanted)
        index = np.flatnonzero(np.isfinite(rays[:, 0]))
        found = rays[index]
        model = MODELS[self.record.model]
        for _ in range(_ROUNDS):
            miss = model.project(self.record, found) - wanted[index]
            if not np.abs(np.nan_to_num(miss)).max(initial=0.0) > _TOLERANCE_PX / 10:
                break
            # Two directions across each ray, and how the pixel moves along them.
            side = np.cross(found, np.eye(3)[np.argmin(np.abs(found), axis=1)])
            side /= np.linalg.norm(side, axis=1, keepdims=True)
            across = np.stack([side, np.cross(found, side)], axis=1)
            slope = np.stack(
                [
                    (
                        model.project(self.record, found + _STEP * across[:, way])
                        - model.project(self.record, found - _STEP * across[:, way])
                    )
                    / (2 * _STEP)
                    for way in range(2)
                ],
                axis=-1,
            )
            step = np.linalg.solve(slope, miss[..., None])[..., 0]
            found = found - np.einsum("nw,nwc->nc", step, across)
            found /= np.linalg.norm(found, axis=1, keepdims=True)
        miss = np.abs(model.project(self.record, found) - wanted[index]).max(axis=1)
        good = (miss < _TOLERANCE_PX) & np.isfinite(self.project(found)[:, 0])
        rays[index] = np.where(good[:, None], found, np.nan)
        return rays.reshape(*pixel.shape[:-1], 3)
