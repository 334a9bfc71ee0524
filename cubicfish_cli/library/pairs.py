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
from cubicfish_cli.identification.photo_report import Detection
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
        target = target_of(corners, target)
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
    if len(world) != len(checked.pixel):
        raise CorrespondenceError(f"world has {len(world)} rows and pixel has {len(checked.pixel)}")
    if (np.diff(checked.image) < 0).any():
        raise CorrespondenceError("image must not decrease: sort the pairs by photo")
    return replace(checked, world=world)


def target_of(
    corners: Correspondences | Corners | Detection, target: Target | None
) -> Target | None:
    """The target that is given, or else the one that the corners carry; None where none is."""
    if isinstance(corners, Detection):
        corners = corners.corners
    if target is None and isinstance(corners, Corners):
        return corners.target
    return target


def _checked(rows: _Rows) -> _Rows:
    """The same corners or pairs, whose arrays are what they must be."""
    pixel = _REFUSAL.numbers(rows.pixel, "pixel", 2, limit=MAX_COORDINATE)
    least = 0 if rows.boards else -1
    return replace(
        rows,
        image_size=_REFUSAL.size(rows.image_size, "image_size", limit=MAX_SIDE),
        image=_index(rows.image, "image", len(pixel), 0, len(rows.images)),
        pixel=pixel,
        weight=_REFUSAL.weights(rows.weight, "weight", len(pixel), limit=MAX_COORDINATE),
        board=_index(rows.board, "board", len(pixel), least, len(rows.boards)),
        column=_index(rows.column, "column", len(pixel), 0),
        row=_index(rows.row, "row", len(pixel), 0),
        certain=_flags(rows.certain, "certain", len(pixel)),
    )


def _flags(value: npt.ArrayLike, name: str, rows: int) -> npt.NDArray[np.bool_]:
    flags = np.asarray(value)
    if flags.shape != (rows,) or flags.dtype != bool:
        raise CorrespondenceError(f"{name} must hold {rows} times True or False, as many as pixel")
    return flags.copy()


def _index(
    value: npt.ArrayLike, name: str, rows: int, least: int, count: int | None = None
) -> npt.NDArray[np.intp]:
    index = np.asarray(value)
    if index.shape != (rows,) or index.dtype.kind not in "iu":
        raise CorrespondenceError(
            f"{name} must hold {rows} whole numbers, one for each row of pixel"
        )
    if rows and (index.min() < least or (count is not None and index.max() >= count)):
        raise CorrespondenceError(
            f"{name} must count from 0, and within what it counts: it goes from {index.min()} to "
            f"{index.max()}"
        )
    return index.astype(np.intp)
