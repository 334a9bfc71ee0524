"""A lens model of another tool with its values: what foreign files hold instead of P."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, kw_only=True, eq=False)
class LensRecord:
    """A lens as another tool states it, in this tool's conventions.

    Pixel (0, 0) is the centre of the top-left pixel and z points forward: readers and writers of
    formats with other conventions convert.

    Attributes:
        model: the name in :data:`cubicfish_cli.fitting.conversion.models.MODELS`.
        values: each of the model's values by name, finite; scalars and arrays.
        image_size: (width, height), pixels.

    """

    model: str
    values: Mapping[str, float | npt.NDArray[np.float64]]
    image_size: tuple[int, int]
