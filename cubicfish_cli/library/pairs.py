"""What a caller may fit a camera to: found corners, named corners or pairs -> checked pairs."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.correspondences import (
    MAX_COORDINATE,
    MAX_SIDE,
    Corners,
    Correspondences,
    pair,
)
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.naming.detect import Detection
from cubicfish_cli.target import Target

_REFUSAL = Refusal(error=CorrespondenceError)

_Rows = TypeVar("_Rows", Corners, Correspondences)


def pairs_of(
    corners: Correspondences | Corners | Detection, target: Target | None
) -> Correspondences:
    """2D-3D pairs of what the caller has.

    Raises:
        CorrespondenceError: corners come without their target, do not fit it, or hold arrays
            that cannot be; one line that says which.

    """
    if isinstance(corners, Detection):
        corners = corners.corners
    if isinstance(corners, Corners):
        if target is None:
            raise CorrespondenceError("corners need the target that they are of: pass it as well")
        return pair(_checked(corners), target)
    if not isinstance(corners, Correspondences):
        raise CorrespondenceError(
            f"{type(corners).__name__} is neither Correspondences, Corners nor a Detection: "
            "Correspondences.from_arrays makes pairs of arrays"
        )
    if target is not None and corners.boards != target.board_names:
        raise CorrespondenceError(
            "these pairs do not say which corners of the target they are: leave the target out, "
            "or pass Corners"
        )
    checked = _checked(corners)
    world = _REFUSAL.numbers(corners.world, "world", 3, limit=MAX_COORDINATE)
    _refuse_other_length(world, "world", len(checked.pixel))
    if (np.diff(checked.image) < 0).any():
        raise CorrespondenceError("image must not decrease: sort the pairs by photo")
    return replace(checked, world=world)


def _checked(rows: _Rows) -> _Rows:
    """The same corners or pairs, whose arrays are what they must be."""
    size = _REFUSAL.size(rows.image_size, "image_size", limit=MAX_SIDE)
    pixel = _REFUSAL.numbers(rows.pixel, "pixel", 2, limit=MAX_COORDINATE)
    weight = _REFUSAL.weights(rows.weight, "weight", len(pixel), limit=MAX_COORDINATE)
    image = _index(rows.image, "image", len(pixel), len(rows.images))
    for name in ("board", "column", "row"):
        _refuse_other_length(getattr(rows, name), name, len(pixel))
    if isinstance(rows, Corners):
        _index(rows.board, "board", len(pixel), len(rows.boards))
    return replace(rows, image_size=size, pixel=pixel, weight=weight, image=image)


def _index(value: npt.NDArray[np.intp], name: str, rows: int, count: int) -> npt.NDArray[np.intp]:
    index = _REFUSAL.places(np.reshape(value, (-1, 1)), name, 1)[:, 0]
    _refuse_other_length(index, name, rows)
    if (index >= count).any():
        raise CorrespondenceError(f"{name} goes up to {index.max()}, but there are {count} of them")
    return index


def _refuse_other_length(value: npt.NDArray[np.generic], name: str, rows: int) -> None:
    if len(np.atleast_1d(value)) != rows:
        raise CorrespondenceError(f"{name} has {len(value)} rows and pixel has {rows}")
