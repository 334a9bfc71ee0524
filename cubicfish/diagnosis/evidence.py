"""The evidence that photos give about a set-up, before anything is fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from cubicfish.fit.calibration import Evidence
from cubicfish.judge.finding import Finding
from cubicfish.target.boards.board import Board
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target

if TYPE_CHECKING:
    from cubicfish.diagnosis.corner_count import Count
    from cubicfish.find.detection.grids import FoundGrids
    from cubicfish.find.identification.identified import Identified
    from cubicfish.photos.photos import Picture


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoEvidence(Evidence):
    """The evidence of photos in which corners were searched.

    Attributes:
        photos: how many photos were given.
        names: names of the photos that can be used.
        picture: gives the brightness (H, W) of the photo of this number, read once more; None where
            it cannot be read.
        target: the nominal target.
        with_boards: in how many of the photos boards were found.
        lost: for each photo without corners, the reason.

    """

    photos: int
    names: Sequence[str]
    picture: Callable[[int], Picture | None]
    target: Target
    with_boards: int
    lost: Sequence[Finding]

    @property
    def other_colours(self) -> bool:
        """Whether the only board is light where the target says that it is dark."""
        return False


@dataclass(frozen=True, kw_only=True, eq=False)
class GridEvidence(PhotoEvidence):
    """The evidence of grids that were named by geometry.

    Attributes:
        identified: what became of the grids.

    """

    identified: Identified

    @property
    def corners(self) -> Observations:
        """The corners that have a name."""
        return self.identified.corners

    @property
    def other_colours(self) -> bool:
        """See :class:`PhotoEvidence`."""
        return self.identified.other_colours

    @cached_property
    def counts(self) -> list[Count]:
        """Boards for which photos show another number of corners than the target says."""
        from cubicfish.diagnosis.corner_count import count_corners  # for photos alone

        return count_corners(self.identified, self.target)


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkerEvidence(PhotoEvidence):
    """The evidence of corners that were named by markers.

    Attributes:
        corners: the corners.
        grids: what was found in each photo.

    """

    corners: Observations
    grids: Sequence[FoundGrids]


def boards_with_squares(target: Target) -> list[int]:
    """Indices of the boards whose corners are where squares meet."""
    return [index for index, board in enumerate(target.boards) if board.has_squares]


def grid_boards(target: Target) -> list[Board]:
    """The boards that show as a grid of squares."""
    return [target.boards[index] for index in boards_with_squares(target)]
