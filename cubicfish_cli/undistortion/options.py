"""The options of a board's plane, which are known before a photo or a camera is."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from cubicfish import Target


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """The plane of a board in each photo, seen from its front, with a square around its corners.

    Attributes:
        board: the name of one of the target's boards.
        target: the target, or the path of its file.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.

    """

    checked_fields: ClassVar = True

    board: str
    target: Target | str | os.PathLike[str]
    pixels_per_unit: float | None = None
