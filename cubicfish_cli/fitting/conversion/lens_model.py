"""What a lens model of another tool must offer to be converted from and to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lens_record import LensRecord

FloatArray = npt.NDArray[np.float64]

# (record, camera-frame points (N, 3)) -> pixels (N, 2), NaN where the model has none.
Project = Callable[[LensRecord, FloatArray], FloatArray]
# (camera, unit rays (N, 3), their pixels (N, 2)) -> the lens nearest to the camera there, least
# squares in pixels.
Fit = Callable[[CubicCamera, FloatArray, FloatArray], LensRecord]


@dataclass(frozen=True, kw_only=True)
class LensModel:
    """One lens model.

    Attributes:
        name: as in :class:`~cubicfish_cli.model.lens_record.LensRecord`.
        project: where the lens sees points.
        fit: the model's lens nearest to a cubic camera; None for a model that is only read.
        also: other ways in which readers of the model's files find pixels, by what to call them.
            What they lose counts as much as what ``project`` loses.

    """

    name: str
    project: Project
    fit: Fit | None = None
    symmetric: bool = True
    also: Mapping[str, Project] = field(default_factory=dict)
