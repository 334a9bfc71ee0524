"""Boards of each type, as they are made for a size of paper."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor

import numpy as np

from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.markers import MARKER_DICTIONARIES, TAG_FAMILIES, Markers
from cubicfish_cli.core.boards.types import BOARD_TYPES
from cubicfish_cli.core.errors import TargetError, UsageError
from cubicfish_cli.core.wording import did_you_mean, quoted

# Of a charuco, where nobody asks for another: the smallest that is large enough.
_USUAL_FAMILIES = ("DICT_5X5_50", "DICT_5X5_100", "DICT_5X5_250", "DICT_5X5_1000")


@dataclass(frozen=True, kw_only=True)
class Design:
    """How boards of a type are made.

    Attributes:
        type: in target.yaml.
        counts: the fewest and the most corners (of an aprilgrid: tags) along a side of boards
            that are made for a size of paper: fewer say little, more are small.
        marker: side of a marker, in squares (or tags); 0 without markers.
        spacing: gap between tags / side of a tag, as Kalibr's own boards have it.

    """

    type: str
    counts: tuple[int, int]
    marker: float = 0.0
    spacing: float = 0.0

    @property
    def _beside(self) -> float:
        """Squares that a row of corners (or tags) is longer than their number, spaced."""
        return self.spacing or 1.0

    def length(self, count: int, square: float) -> float:
        """Length of the print of so many corners (or tags)."""
        return square * (count * (1 + self.spacing) + self._beside)

    def count(self, length: float, square: float) -> int:
        """How many corners (or tags) fit into a length."""
        return floor((length / square - self._beside) / (1 + self.spacing) + 1e-9)

    def marker_count(self, counts: tuple[int, int]) -> int:
        """How many markers a board of so many corners (or tags) carries."""
        if self.type == "aprilgrid":
            return counts[0] * counts[1]
        # The square up-left of corner (0, 0) is dark, and so is the larger half of an odd number.
        return (counts[0] + 1) * (counts[1] + 1) // 2 if self.marker else 0

    def family(self, asked: str | None, count: int) -> str | None:
        """The family of ``count`` markers, by the name that is asked for or the usual one.

        Raises:
            TargetError: there is none of this name for such boards, or it is too small.
            UsageError: such boards have none.

        """
        if not self.marker:
            if asked is None:
                return None
            raise UsageError(
                f"--dictionary is of markers, and {self.type}s have no markers: '--type charuco' "
                "or 'aprilgrid' do"
            )
        known: tuple[str, ...] = (*TAG_FAMILIES, *TAG_FAMILIES.values())
        if self.type == "charuco":
            known = tuple(MARKER_DICTIONARIES)
            usual = [one for one in _USUAL_FAMILIES if MARKER_DICTIONARIES[one] >= count]
            asked = asked or next(iter(usual), _USUAL_FAMILIES[-1])
        asked = asked or "tag36h11"
        if asked not in known:
            raise TargetError(
                f"--dictionary {quoted(asked)} is no family of markers for a board of type "
                f"{self.type}: {did_you_mean(asked, known)}"
            )
        name = TAG_FAMILIES.get(asked, asked)  # AprilTag has names of its own
        if MARKER_DICTIONARIES[name] < count:
            raise TargetError(
                f"these boards carry {count} markers, but {name} has only "
                f"{MARKER_DICTIONARIES[name]}: take another --dictionary, or larger squares"
            )
        return name

    def board(
        self, name: str, counts: tuple[int, int], square: float, family: str | None, first: int
    ) -> Board:
        """A new board at the world's origin, of so many corners (or tags) along x and along y.

        ``family`` is of its markers, of those of :meth:`family`, and ``first`` the first one's id.
        """
        kind = BOARD_TYPES[self.type]
        markers = family and Markers(
            dictionary=family,
            side=square if self.spacing else round(self.marker * square, 2),
            first=first,
            count=self.marker_count(counts),
        )
        return kind(
            name=name,
            columns=kind.per_cell * counts[0],
            rows=kind.per_cell * counts[1],
            square=square,
            origin=np.zeros(3),
            x_axis=np.array([1.0, 0.0, 0.0]),
            y_axis=np.array([0.0, 1.0, 0.0]),
            markers=markers or None,
            spacing=self.spacing,
        )


DESIGNS = {
    one.type: one
    for one in (
        Design(type="checkerboard", counts=(4, 11)),
        Design(type="charuco", counts=(4, 9), marker=0.75),  # large enough to be read
        Design(type="aprilgrid", counts=(2, 6), marker=1.0, spacing=0.3),
    )
}
"""By the types' names."""
