"""What became of grids and photos: places on the target, named corners, and remarks on them.

Of targets with markers ids name the corners photo by photo;
boards without markers on the same target are named afterwards, in the second pass: by then the
marked boards have given the lens and where each photo was taken from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.verdict import enough_corners
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import BoolArray
from cubicfish.wording import Brief

if TYPE_CHECKING:  # tables have no grids to be named, and ask for none of what names them
    from cubicfish.find.detection.markers import MarkedCorners
    from cubicfish.find.identification.scene import Scene


class Decided(Enum):
    """What became of a grid."""

    NAMED = "named"
    CONVENTION = "named by convention"
    AMBIGUOUS = "ambiguous"
    SLIDE = "undecidable"
    TWIN = "one of several boards alike"
    NO_FIT = "fits no place"
    TOO_LARGE = "larger than every board"
    COLOURS = "light where the board is dark"
    NOT_PLANE = "not a plane of squares"


FEWEST_CORNERS = 12
"""A grid of fewer corners may be anything: it says nothing of why others have no place."""
CODES = {
    Decided.CONVENTION: Code.BY_CONVENTION,
    Decided.AMBIGUOUS: Code.AMBIGUOUS,
    Decided.SLIDE: Code.SLIDES,
    Decided.TWIN: Code.LOOKS_LIKE_ANOTHER,
    Decided.NO_FIT: Code.FITS_NOWHERE,
    Decided.TOO_LARGE: Code.TOO_LARGE,
    Decided.COLOURS: Code.OTHER_COLOURS,
    Decided.NOT_PLANE: Code.NO_PLANE,
}
"""What is reported of a grid, by what became of it."""
# What another lens makes of a board, as well as another nominal target.
_ODD = (Decided.NO_FIT, Decided.NOT_PLANE)


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where on the target a grid lies.

    Corner (i, j) of the grid is corner turn · (i, j) + (column, row) of the board.

    Attributes:
        board: index into the target's boards.
        turn: quarter turns, index into :data:`cubicfish.target.placement.TURNS`.
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
        rms_px: how well it fits its name under the lens of the scene; NaN when unknown.
        whole: whether it is as wide and as high as its board.

    """

    verdict: Decided
    place: Place | None
    corners: int
    size: tuple[int, int]
    rms_px: float
    whole: bool = False

    @property
    def sure(self) -> bool:
        """Whether its corners are surely those that they are named as."""
        return self.verdict is Decided.NAMED

    @property
    def code(self) -> Code | None:
        """What is reported of it; None where it is simply named."""
        return CODES.get(self.verdict)

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
        exact: (M,) whether the photo's corners are surely these corners of the target. False
            where a board seen in part may be a few squares further along its plane: as good
            for a lens, but not for measuring the target.
        other_colours: whether the only board is light where the target says that it is dark, in
            most photos that tell.
        scene: the grids under the lens; None where there is none.

    """

    corners: Observations
    found: tuple[tuple[Grid, ...], ...]
    grids: tuple[tuple[GridReport, ...], ...]
    exact: BoolArray
    other_colours: bool = False
    scene: Scene | None = None


def marked_corners(
    marked: Sequence[MarkedCorners],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Observations:
    """What markers named in each of the photos, as one table sorted by photo.

    Args:
        marked: one for each photo.
        target: the calibration target.
        image_size: (width, height) of all photos, pixels.
        images: the photos' names.

    """
    image = np.repeat(np.arange(len(marked)), [len(one) for one in marked])
    board, column, row = (
        np.concatenate([getattr(one, name) for one in marked]).astype(np.intp)
        for name in ("board", "column", "row")
    )
    pixel = np.concatenate([one.pixel for one in marked])
    return (
        Observations(
            image_size=image_size,
            images=tuple(images),
            boards=target.board_names,
            image=image,
            board=board,
            column=column,
            row=row,
            pixel=pixel,
        )
        .with_target(target)
        .in_order()
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoReport:
    """What became of one photo.

    Attributes:
        name: the photo's name.
        refusal: why nothing was looked for, or found, in it; None where something was.
        remarks: what is reported of its grids and boards: left out, or named by convention.
        boards: names of the boards that were found in it, in the target's order.
        corners: how many corners were named.
        added: how many of them a second pass added.
        exact: whether these are surely the corners that they are named as; see
            :class:`cubicfish.find.identification.identified.Identified`.
        found: everything that was found in it, named or not; None when it could not be used.
        grids: what became of each of ``found.grids``.

    """

    name: str
    refusal: Finding | None = None
    remarks: tuple[Finding, ...] = ()
    boards: tuple[str, ...] = ()
    corners: int = 0
    added: int = 0
    exact: bool = True
    found: FoundGrids | None = None
    grids: tuple[GridReport, ...] = ()

    def with_corners(self, corners: Observations, number: int, added: int = 0) -> PhotoReport:
        """The report with what corners its photo has: that of this number in their table."""
        board = corners.board[corners.image == number]
        boards = tuple(corners.boards[one] for one in np.unique(board))
        return replace(self, boards=boards, corners=len(board), added=added)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is reported of it, thing by thing."""
        return self.remarks if self.refusal is None else (self.refusal,)

    @property
    def lost(self) -> bool:
        """Whether it gave no corners, for a reason that is known."""
        none_named = bool(self.grids) and not any(grid.named for grid in self.grids)
        return self.refusal is not None or (none_named and bool(self.remarks))

    @property
    def loss(self) -> Finding | None:
        """Why it gave no corners: the remarks on it, or of its largest grid; None when it did."""
        if not self.lost:
            return None
        if self.refusal is not None:
            return self.refusal
        return max(self.remarks, key=lambda one: one.figures["corners"])

    @property
    def problem(self) -> str | None:
        """One line that says why it gave no corners; None when it did."""
        return "; ".join(map(str, self.findings)) if self.lost else None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Detection(Brief):
    """The corners found in a set of photos.

    Attributes:
        corners: the named corners; ``images`` are the photos that have some.
        photos: a report on every photo, in the order given.
        findings: what is likely wrong with photos or target, where many grids fit nowhere.
        other_colours: whether the only board is light where the target says that it is dark.

    """

    corners: Observations
    photos: tuple[PhotoReport, ...]
    findings: tuple[Finding, ...] = ()
    other_colours: bool = False

    @property
    def enough_corners(self) -> float:
        """How many corners are not few for one of these photos."""
        return enough_corners([photo.corners for photo in self.photos if not photo.lost])


def nameless(
    names: Sequence[str], found: Sequence[FoundGrids | None], image_size: tuple[int, int]
) -> Detection:
    """What is known of photos of an unknown target: grids, whose corners have no names.

    Args:
        names: the photos' names.
        found: for each of them what was found in it; None where it cannot be used.
        image_size: (width, height) of all photos, pixels.

    """
    none = np.zeros(0, np.intp)
    corners = Observations(
        image_size=image_size,
        images=(),
        boards=(),
        image=none,
        board=none,
        column=none,
        row=none,
        pixel=np.zeros((0, 2)),
    )
    reports = (PhotoReport(name=name, found=one) for name, one in zip(names, found, strict=True))
    return Detection(corners=corners, photos=tuple(reports))


def nominal_target_fits(grids: Sequence[Sequence[GridReport]], target: Target) -> bool:
    """Whether most photos fit the nominal target, and each of its boards does in some.

    Then a grid that fits nowhere says something of its photo, and nothing of the nominal target.

    Args:
        grids: for each photo, what became of its grids.
        target: the calibration target.

    """
    large = [[grid for grid in own if grid.corners >= FEWEST_CORNERS] for own in grids]
    fitting = sum(bool(own) and all(grid.named for grid in own) for own in large)
    odd = sum(any(grid.verdict in _ODD for grid in own) for own in large)
    seen = {grid.place.board for own in large for grid in own if grid.place}
    boards = {index for index, board in enumerate(target.boards) if board.has_squares}
    return fitting > odd and seen == boards


def remark_of(photo: str, grid: GridReport, *, odd: bool = False) -> Finding | None:
    """What is to be said of a grid; None where it is simply named.

    Args:
        photo: the photo that shows it.
        grid: what became of it.
        odd: whether the nominal target fits other photos, so that a grid that it does not fit is
            odd.

    """
    if grid.code is None:
        return None
    columns, rows = grid.size
    whole = grid.verdict is Decided.CONVENTION and grid.whole
    return Finding(
        code=grid.code,
        case="odd" if odd and grid.verdict in _ODD else "whole" if whole else "",
        severity=Severity.NOTE if grid.named else Severity.CARE,
        images=(photo,),
        figures={"grids": 1, "columns": columns, "rows": rows, "corners": grid.corners},
    )


def remarks_of(photo: str, grids: Sequence[GridReport], *, odd: bool) -> tuple[Finding, ...]:
    """What is to be said of a photo's grids; see :func:`remark_of`."""
    remarks = (remark_of(photo, grid, odd=odd) for grid in grids)
    return tuple(one for one in remarks if one is not None)
