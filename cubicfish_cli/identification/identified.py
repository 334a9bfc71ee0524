"""What became of grids: their places on the target, and the corners that follow."""

from __future__ import annotations

from dataclasses import dataclass

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import BoolArray

FEWEST_CORNERS = 12
"""A grid of fewer corners may be anything: it says nothing of why others have no place."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where on the target a grid lies.

    Corner (i, j) of the grid is corner turn · (i, j) + (column, row) of the board.

    Attributes:
        board: index into the target's boards.
        turn: quarter turns, index into :data:`cubicfish_cli.identification.placement.TURNS`.
        column, row: where the grid's cell (0, 0) lies on the board.

    """

    board: int
    turn: int
    column: int
    row: int


@dataclass(frozen=True, kw_only=True, eq=False)
class GridReport:
    """What became of one grid.

    Attributes:
        verdict: named, or why not.
        place: where it lies, None when it was left out.
        corners: how many corners it has.
        size: columns and rows of its bounding box; where it was left out, without lines of one or
            two corners at its rim.
        ratio: how many times worse the best other name fits; inf without a rival.
        rms_px: how well it fits its name under the lens of :class:`Identified`; NaN when unknown.

    """

    verdict: Decided
    place: Place | None
    corners: int
    size: tuple[int, int]
    ratio: float
    rms_px: float

    @property
    def named(self) -> bool:
        """Whether its corners are among the named ones."""
        return self.place is not None


@dataclass(frozen=True, kw_only=True, eq=False)
class Identified:
    """The named corners of all photos.

    Attributes:
        corners: the named corners; photos without any are listed in ``images`` all the same.
        found: for each photo, its grids, without the strays that were cut off.
        grids: for each photo, what became of each of its grids.
        lens: the radial lens that the names were checked with, None when none could be fitted.
        exact: (M,) whether the photo's corners are surely these corners of the target. False
            where a board seen in part may be a few squares further along its plane: as good
            for a lens, but not for measuring the target.
        other_colours: whether the only board is light where the target says that it is dark, in
            most photos that tell.

    """

    corners: Observations
    found: tuple[tuple[Grid, ...], ...]
    grids: tuple[tuple[GridReport, ...], ...]
    lens: RadialCamera | None
    exact: BoolArray
    other_colours: bool = False
