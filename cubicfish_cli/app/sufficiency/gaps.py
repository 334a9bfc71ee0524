"""Which parts of the picture photos so far leave empty, and a photographer's words for places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish_cli.core.angles import angle_from_axis, azimuth
from cubicfish_cli.core.fit.findings import FieldCells, field_cells
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# The middle, which has no sides, reaches so far; of the rest the outer ring has this share.
_MIDDLE_FIELD_DEG = 20.0
_OUTER_RING = 0.4
# A part counts as empty when so many of its squares hold no corner.
_EMPTY_SHARE = 0.6


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the picture without corners.

    Attributes:
        sides: indices of SIDES; all eight is a ring, none the middle.
        from_deg, to_deg: angles from the axis.
        share: of the field's squares that are empty there, of all squares of the field.

    """

    sides: tuple[int, ...]
    from_deg: float
    to_deg: float
    share: float

    @property
    def words(self) -> str:
        """``upper left, 60–80° from the axis``."""
        reach = f"{self.from_deg:.0f}–{self.to_deg:.0f}° from the axis"
        if not self.sides:
            return f"the middle, up to {self.to_deg:.0f}° from the axis"
        if len(self.sides) == 8:
            return f"all around, {reach}"
        return f"{listed([SIDES[side] for side in self.sides])}, {reach}"

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "sides": [SIDES[side] for side in self.sides],
            "from_deg": self.from_deg,
            "to_deg": self.to_deg,
            "share": self.share,
            "words": self.words,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Gaps:
    """What photos so far do not show.

    Attributes:
        parts: empty parts of the field, the largest first.
        cells: the field in squares, and which hold corners.

    """

    parts: tuple[Part, ...]
    cells: FieldCells


def find_gaps(camera: CubicCamera, pairs: Observations) -> Gaps:
    """Look for parts of the field without corners: of the middle, and of two rings around it.

    Args:
        camera: the camera.
        pairs: the corners that it was fitted to.

    """
    cells = field_cells(camera, pairs.pixel)
    row, column = np.nonzero(cells.field)
    rays = camera.unproject((np.stack([column, row], axis=-1) + 0.5) * cells.cell - 0.5)
    seen = np.isfinite(rays[:, 0])
    rays, gone = rays[seen], cells.empty[row, column][seen]
    angle, side = np.degrees(angle_from_axis(rays)), side_of(rays[:, :2])
    rim = max(camera.max_angle_deg, _MIDDLE_FIELD_DEG)
    outer = rim - _OUTER_RING * (rim - _MIDDLE_FIELD_DEG)
    parts = []
    for low, high in ((0.0, _MIDDLE_FIELD_DEG), (_MIDDLE_FIELD_DEG, outer), (outer, rim)):
        ring = (angle >= low) & (angle < high)
        ways = [ring] if not low else [ring & (side == way) for way in range(len(SIDES))]
        lost = [
            way for way, own in enumerate(ways) if own.any() and gone[own].mean() >= _EMPTY_SHARE
        ]
        if lost:
            share = sum(gone[ways[way]].sum() for way in lost) / len(rays)
            sides = tuple(lost) if low else ()
            parts.append(Part(sides=sides, from_deg=low, to_deg=high, share=float(share)))
    return Gaps(parts=tuple(sorted(parts, key=lambda part: -part.share)), cells=cells)


# Clockwise from the right, y down, an eighth of a turn each.
SIDES = (
    "right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right",
)  # fmt: skip
_MIDDLE_DEG = 12.0
# Below this slant a face looks at the camera.
_HEAD_ON_DEG = 12.0


def side_of(offset: FloatArray) -> IntArray:
    """Which eighth of the picture offsets (..., 2) from the axis lie in, an index of SIDES."""
    turn = azimuth(offset)
    eighth: IntArray = np.rint(turn / (np.pi / 4)).astype(np.intp) % 8
    return eighth


def place_words(ray: FloatArray) -> str:
    """Where in the picture a ray (3,) is: ``in the lower right of the picture, 52° ...``."""
    angle = float(np.degrees(angle_from_axis(ray)))
    if angle < _MIDDLE_DEG:
        return "in the middle of the picture"
    side = SIDES[int(side_of(ray[:2]))]
    word = {"bottom": "at", "top": "at", "left": "on", "right": "on"}.get(side, "in")
    return f"{word} the {side} of the picture, {angle:.0f}° from the axis"


def tilt_words(front: FloatArray, middle: FloatArray) -> str:
    """``its face turned 35° to the left`` (its left edge is then the farther one), or facing.

    Args:
        front: (3,) where the face looks, a unit vector in the camera frame.
        middle: (3,) where it is.

    """
    x, y, z = ray = middle / np.linalg.norm(middle)
    angle = float(np.degrees(np.arccos(np.clip(-front @ ray, -1, 1))))
    if angle < _HEAD_ON_DEG:
        return "facing the camera"
    # The camera's own x and y, turned along with its axis to the ray the short way.
    share = 1 / max(1 + z, 1e-9)
    right = np.array([1 - x * x * share, -x * y * share, -x])
    down = np.array([-x * y * share, 1 - y * y * share, -y])
    side = SIDES[int(side_of(np.array([right @ front, down @ front])))]
    where = {"bottom": "downwards", "top": "upwards"}.get(side, f"to the {side}")
    return f"its face turned {angle:.0f}° {where}"


def listed(words: list[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
