"""A board's deformation relative to the nominal board."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from cubicfish.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardShape:
    """The deformation of a real board relative to the nominal plane, as a calibration found it.

    With x̂ and ŷ running from -1 to 1 across the board's corners, a corner nominally at (x, y) from
    the board's middle is at ((1 + stretch x) x, (1 + stretch y) y) in its plane and
    bend x · x̂² + bend y · ŷ² + twist · x̂ ŷ behind it (along x_axis × y_axis), plus its offset.

    Attributes:
        bend: (2,) how far the edges lie behind the middle, along x and along y.
        twist: how far two opposite corners lie behind the middle, and the others in front of it.
        stretch: (2,) relative stretch along x and along y.
        offsets: (rows, columns, 3) each corner's own offset along x_axis, y_axis and
            x_axis × y_axis; zeros where there is none.

    """

    bend: FloatArray
    twist: float
    stretch: FloatArray
    offsets: FloatArray

    @classmethod
    def none(cls, columns: int, rows: int) -> BoardShape:
        """The shape of a board of so many corners that is not deformed."""
        offsets = np.zeros((rows, columns, 3))
        return cls(bend=np.zeros(2), twist=0.0, stretch=np.zeros(2), offsets=offsets)

    def plus(self, other: BoardShape) -> BoardShape:
        """Both deformations together."""
        names = [one.name for one in fields(self)]
        return BoardShape(**{name: getattr(self, name) + getattr(other, name) for name in names})

    def in_mirror(self) -> BoardShape:
        """The shape in a mirror: columns run the other way."""
        return BoardShape(
            bend=self.bend,
            twist=-self.twist,
            stretch=self.stretch,
            offsets=self.offsets[:, ::-1] * [-1, 1, 1],
        )
