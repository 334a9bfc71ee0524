"""How boards of each type are made for a size of paper."""

from dataclasses import dataclass
from math import floor
from typing import Any

Counts = tuple[int, int]
# A charuco has the smallest of these that is large enough, unless another one is named.
_USUAL_FAMILIES = {size: f"DICT_5X5_{size}" for size in (50, 100, 250, 1000)}


@dataclass(frozen=True, kw_only=True)
class Design:
    """How boards of a type are made.

    Attributes:
        type: in target.yaml.
        counts: the fewest and the most corners (of an aprilgrid: tags) along a side of a board:
            fewer say little, more are small.
        marker: side of a marker, in squares (or tags); 0 without markers.
        spacing: gap between tags / side of a tag, as Kalibr's own boards have it.
        quiet: white that the print should have around it, in squares (or tags).

    """

    type: str
    counts: Counts
    marker: float = 0.0
    spacing: float = 0.0
    quiet: float = 1.0

    @property
    def before(self) -> float:
        """Squares from the print's edge to corner (0, 0)."""
        return self.spacing or 1.0

    def length(self, count: int, square: float) -> float:
        """Length of the print of so many corners (or tags)."""
        return square * (count * (1 + self.spacing) + self.before)

    def count(self, length: float, square: float) -> int:
        """Return how many corners (or tags) fit into a length."""
        return floor((length / square - self.before) / (1 + self.spacing) + 1e-9)

    def marker_count(self, counts: Counts) -> int:
        """Return how many markers a board of so many corners (or tags) carries."""
        if self.type == "aprilgrid":
            return counts[0] * counts[1]
        # The square up-left of corner (0, 0) is dark, and so is the larger half of an odd number.
        return (counts[0] + 1) * (counts[1] + 1) // 2 if self.marker else 0

    def family(self, chosen: str | None, count: int) -> str:
        """Return the family of ``count`` markers: the chosen one, else the usual one."""
        if self.type == "aprilgrid":
            return chosen or "tag36h11"
        enough = [one for size, one in _USUAL_FAMILIES.items() if size >= count]
        return chosen or next(iter(enough), _USUAL_FAMILIES[1000])

    def record(self, counts: Counts, square: float, family: str, first: int) -> dict[str, Any]:
        """Return the record in target.yaml of a board of so many corners (or tags).

        ``family`` is that of its markers, if it has any, and ``first`` the first one's id.
        """
        record: dict[str, Any] = {"type": self.type}
        if self.type == "aprilgrid":
            record |= {"tags": [*counts], "tag": square, "spacing": self.spacing, "family": family}
        else:
            record |= {"corners": [*counts], "square": square}
        if self.type == "charuco":
            record |= {"dictionary": family, "marker": round(self.marker * square, 2)}
        return {**record, "first_marker": first} if self.marker else record


DESIGNS = {
    one.type: one
    for one in (
        Design(type="checkerboard", counts=(4, 11)),
        Design(type="charuco", counts=(4, 9), marker=0.75),  # large enough to be read
        Design(type="aprilgrid", counts=(2, 6), marker=1.0, spacing=0.3, quiet=0.5),
    )
}
"""By the types' names."""
