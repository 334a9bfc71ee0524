"""A board's deformation against its drawing, and its pose in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.core.boards.section import MAX_LENGTH, Section, is_place, is_point
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.wording import quoted

AXES_TOLERANCE = 1e-3
PLACE_KEYS = ("origin", "x_axis", "y_axis")
SHAPE_KEYS = ("bend", "twist", "stretch", "offsets")


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardShape:
    """The deformation of a real board against the drawn plane, as a calibration found it.

    With x̂ and ŷ running from -1 to 1 across the board's corners, a corner drawn at (x, y) from
    the board's middle is at ((1 + stretch x) x, (1 + stretch y) y) in its plane and
    bend x · x̂² + bend y · ŷ² + twist · x̂ ŷ behind it (along x_axis × y_axis), plus its offset.

    Attributes:
        bend: (2,) how far the edges lie behind the middle, along x and along y.
        twist: how far two opposite corners lie behind the middle, and the others before it.
        stretch: (2,) relative stretch along x and along y.
        offsets: (rows, columns, 3) each corner's own offset along x_axis, y_axis and
            x_axis × y_axis; zeros where there is none.

    """

    bend: FloatArray
    twist: float
    stretch: FloatArray
    offsets: FloatArray

    def plus(self, other: BoardShape) -> BoardShape:
        """Both deformations together."""
        return BoardShape(
            bend=self.bend + other.bend,
            twist=self.twist + other.twist,
            stretch=self.stretch + other.stretch,
            offsets=self.offsets + other.offsets,
        )

    def in_mirror(self) -> BoardShape:
        """The shape as a mirror shows it: columns run the other way."""
        return BoardShape(
            bend=self.bend,
            twist=-self.twist,
            stretch=self.stretch,
            offsets=self.offsets[:, ::-1] * [-1, 1, 1],
        )


def read_shape(section: Section, columns: int, rows: int) -> BoardShape | None:
    """The keys that a calibration adds to a refined target; None where there are none.

    Raises:
        TargetError: a value is not usable.

    """
    if not any(section.data.get(key) is not None for key in SHAPE_KEYS):
        return None
    offsets = np.zeros((rows, columns, 3))
    entries = section.data.get("offsets") or []
    hint = "a list of [column, row, along x_axis, along y_axis, into the board]"
    if not isinstance(entries, list):
        section.refuse("offsets", f"must be {hint}")
    for entry in entries:
        if (
            not isinstance(entry, list)
            or len(entry) != 5
            or not is_place(entry[0], columns)
            or not is_place(entry[1], rows)
            or not is_point(entry[2:])
        ):
            section.refuse("offsets", f"{quoted(entry)} does not fit: {hint}")
        offsets[entry[1], entry[0]] = entry[2:]
    return BoardShape(
        twist=section.number("twist"),
        bend=section.pair("bend", MAX_LENGTH),
        stretch=section.pair("stretch", 0.5),
        offsets=offsets,
    )


def read_place(section: Section, *, alone: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origin and orthonormal axes; a board that is alone lies in the world's z = 0 plane.

    Raises:
        TargetError: they are missing, or no axes of a plane.

    """
    given = [key for key in PLACE_KEYS if section.data.get(key) is not None]
    if alone and "x_axis" not in given and "y_axis" not in given:
        section.data = {**section.data, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    if alone and "origin" not in given:
        section.data = {**section.data, "origin": [0, 0, 0]}
    hint = "a target of several boards needs origin, x_axis and y_axis for each"
    if alone:
        hint = "x_axis and y_axis go together"
    origin, x_axis, y_axis = (section.vector(key, hint) for key in PLACE_KEYS)
    for key, axis in (("x_axis", x_axis), ("y_axis", y_axis)):
        norm = float(np.linalg.norm(axis))
        if abs(norm - 1) > AXES_TOLERANCE:
            section.refuse(key, f"must have length 1 (to {AXES_TOLERANCE:g}), not {norm:.6g}")
    cosine = float(x_axis @ y_axis)
    if abs(cosine) > AXES_TOLERANCE:
        angle = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
        section.refuse("y_axis", f"must be at a right angle to x_axis, not at {angle:.2f} degrees")
    # The nearest orthonormal pair: the polar factor, which favours neither axis.
    left, _, right = np.linalg.svd(np.stack([x_axis, y_axis]), full_matrices=False)
    x_axis, y_axis = left @ right
    return origin, x_axis, y_axis
