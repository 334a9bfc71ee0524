"""What markers name in a photo: each board's pieces, of the markers that agree where they are.

Markers that come later are taken into what is known, so that no board is grown twice.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.markers_detect import SeenMarkers, Sight
from cubicfish.find.detection.markers_lattice import BoardLattice, verify
from cubicfish.find.detection.markers_pieces import (
    Piece,
    agrees,
    extend,
    merge_pieces,
    note_grids,
    piece_of,
    take_in,
)
from cubicfish.find.detection.markers_read import all_read, group_agreeing, read_together
from cubicfish.find.detection.nearby import Tree
from cubicfish.types import IntArray

# So many markers, at least two side by side, are no misreadings even where others refute them.
_NO_ACCIDENT = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Named:
    """What markers name in a photo.

    Attributes:
        pieces: the boards.
        contradictory: indices of boards that were left out: markers put them in two places, or
            others are in their squares.

    """

    pieces: list[Piece]
    contradictory: set[int]

    @property
    def boards(self) -> set[int]:
        """Indices of all boards that markers place, in one place or in several."""
        return {piece.board for piece in self.pieces} | self.contradictory


def name_corners(
    sight: Sight,
    alone: SeenMarkers,
    grids: FoundGrids,
    before: Named | None = None,
    again: set[int] | None = None,
) -> Named:
    """What markers that were read alone, and those in the squares of grids, name.

    What is known ``before`` of other boards than those to be looked at ``again`` stays.
    """
    done = [] if before is None else [p for p in before.pieces if p.board not in (again or ())]
    for piece in done:
        note_grids(piece, grids.grids)
    free = _make_tree(grids)
    settled = {piece.board for piece in done}
    pieces, refuted = _place_pieces(sight, all_read(sight, grids, alone), grids, free, settled)
    kept, contradictory = merge_pieces([*done, *pieces])
    out = contradictory | set(np.flatnonzero(refuted).tolist())
    for piece in _name_other_grids(sight, kept, grids, out):
        extend(sight.pyramid, piece, grids.grids, free)
        merged, against = merge_pieces([*kept, piece])
        kept = kept if against else merged
    refuted[[piece.board for piece in kept]] = 0
    contradictory |= set(np.nonzero(refuted >= _NO_ACCIDENT)[0].tolist())
    return Named(pieces=kept, contradictory=contradictory)


def _place_pieces(
    sight: Sight, markers: SeenMarkers, grids: FoundGrids, free: Tree, settled: set[int]
) -> tuple[list[Piece], IntArray]:
    """Pieces of boards that are not settled, those of most markers first; what refutes each board.

    That is how many markers (B,) put it where others are read.
    """
    pieces: list[Piece] = []
    refuted = np.zeros(len(sight.target.boards), np.intp)
    for index in sorted(set(markers.board.tolist()) - settled):
        own = markers.of(index)
        label = group_agreeing(own, sight.target.boards[index])
        placed = (
            piece_of(sight, index, own, label == place, grids.grids, free)
            for place in np.unique(label)
        )
        for piece in placed:
            if piece is None:
                continue
            if agrees(sight, piece):
                pieces.append(piece)
            elif piece.markers > 1:
                refuted[index] += piece.markers
    return sorted(pieces, key=lambda piece: -piece.markers), refuted


def _name_other_grids(
    sight: Sight, kept: Sequence[Piece], grids: FoundGrids, out: set[int]
) -> Iterator[Piece]:
    """Yield grids that no piece has, as pieces of boards that are not left out.

    Their markers are read together, through all of their squares.
    """
    named = {number for piece in kept for number in piece.grids}
    for number, grid in enumerate(grids.grids):
        one = None if number in named else read_together(sight, grid)
        if one is None or one.board in out:
            continue
        lattice = BoardLattice(board=sight.target.boards[one.board])
        lattice.put(one.cells, grid.pixel)
        verify(sight.pyramid, lattice)
        yield Piece(board=one.board, lattice=lattice, markers=one.markers, grids={number})


def with_more_markers(
    sight: Sight, found: Named, known: SeenMarkers, fresh: SeenMarkers, grids: FoundGrids
) -> tuple[Named, SeenMarkers]:
    """What is found with more markers than the known ones, and all of them."""
    both = SeenMarkers.joined([known, fresh])
    again = set()
    for index in np.unique(fresh.board).tolist():
        own, old = fresh.of(index), known.of(index)
        piece = next((one for one in found.pieces if one.board == index), None)
        label = group_agreeing(SeenMarkers.joined([old, own]), sight.target.boards[index])
        if piece is None or not np.isin(label, label[: len(old)]).all():
            again.add(index)
            continue
        take_in(sight.pyramid, piece, own, grids.grids, _make_tree(grids))
    return (name_corners(sight, both, grids, found, again) if again else found), both


def _make_tree(grids: FoundGrids) -> Tree:
    """The corners of grids, and those of none."""
    return Tree(np.concatenate([grids.refused, *(grid.pixel for grid in grids.grids)]))


def list_agreeing(sight: Sight, own: SeenMarkers) -> list[SeenMarkers]:
    """Markers of a board, at least one, by the place that they agree on."""
    label = group_agreeing(own, sight.target.boards[own.board[0]])
    return [own.select(label == place) for place in np.unique(label)]
