"""Overlays: what was found in a photo, drawn over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import CODES, PhotoReport
from cubicfish_cli.observations import Observations
from cubicfish_cli.overlay.canvas import (
    BLACK,
    WHITE,
    Colour,
    ColourPicture,
    PhotoCanvas,
    local_contrast,
)
from cubicfish_cli.photos import Picture
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.words.finding import Finding

# Okabe and Ito's colours for all kinds of colour vision, as blue, green, red; without black and
# blue, which vanish on a dark photo, and vermillion, which is close to LEFT_OUT.
BOARD_COLOURS: tuple[Colour, ...] = (
    (233, 180, 86),  # sky blue
    (0, 159, 230),  # orange
    (115, 158, 0),  # bluish green
    (66, 228, 240),  # yellow
    (167, 121, 204),  # reddish purple
)
LEFT_OUT: Colour = (60, 60, 255)  # red
REFUSED: Colour = (165, 165, 165)
# What is in no grid is drawn where its contrast is this share of the grids', and so many at most.
_CLEAR, _MOST_DOTS = 0.5, 200
_TURN = np.arange(24) * (np.pi / 12)
_RING = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1)
_SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
_CROSS = np.array([[[-1.0, -1], [1, 1]], [[-1, 1], [1, -1]]])


def draw_found(picture: Picture, report: PhotoReport, corners: Observations) -> ColourPicture:
    """The photo, dimmed, with all that was found in it and what became of it.

    Each board has a colour: lines along its rows and columns, rings at its corners (squares
    where a second look found them), a disc at corner (0, 0), arrows along growing column (x)
    and growing row (y) from the first corner in view, column and row numbers at the edges.
    Grids that were left out are red crosses with the reason beside them. Of the candidate corners
    that belong to no grid, those as clear as a grid's are grey dots: noise has others by the
    thousand. The caption counts them all.

    Args:
        picture: (H, W) grey photo, 8 or 16 bits.
        report: what became of it.
        corners: the named corners of all photos.

    Returns:
        (H, W, 3) drawing in BGR order, 8 bits.

    """
    canvas = PhotoCanvas(picture)
    boards, left_out = _boards(report, corners), _left_out(report)
    dots = _clear(picture, report, [*boards, *(mesh for mesh, _ in left_out)])
    canvas.dots(dots, REFUSED, 1.5 * canvas.unit)
    for mesh, _ in left_out:
        _draw_left_out(canvas, mesh)
    letters = []
    for board in boards:
        _draw_lines(canvas, board, board.colour)
        _draw_marks(canvas, board)
        letters += _draw_axes(canvas, board)
    canvas.caption(_caption(report, boards, len(dots)))
    plates = [(board, board.name, board.colour) for board in boards]
    reasons = [(mesh, f"left out: {why}", LEFT_OUT) for mesh, why in left_out]
    for mesh, text, colour in (*plates, *reasons):
        canvas.plate(text, _places(canvas, mesh, text), colour, filled=True, insist=True)
    for letter, places in letters:
        canvas.plate(letter, places, WHITE)
    for board in boards:
        _write_numbers(canvas, board)
    return canvas.pixels


@dataclass(frozen=True, kw_only=True, eq=False)
class _Mesh:
    """Corners with integer places, and which of them are neighbours.

    Attributes:
        cells: (N, 2) column and row.
        pixel: (N, 2).

    """

    cells: IntArray
    pixel: FloatArray

    @cached_property
    def table(self) -> IntArray:
        """(C, R) index of the corner at each place from the first; -1 for none, and last."""
        table = np.full(np.ptp(self.cells, axis=0) + 2, -1)
        table[tuple((self.cells - self.cells.min(axis=0)).T)] = np.arange(len(self.cells))
        return table

    @cached_property
    def edges(self) -> FloatArray:
        """(M, 2, 2) pixels of neighbours along rows and columns."""
        steps = ((self.table[:-1], self.table[1:]), (self.table[:, :-1], self.table[:, 1:]))
        pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=-1) for a, b in steps])
        return self.pixel[pairs[(pairs >= 0).all(axis=1)]]

    @cached_property
    def squares(self) -> FloatArray:
        """(M, 2) middles of the squares whose four corners are there."""
        table = self.table
        four = np.stack([table[:-1, :-1], table[1:, :-1], table[:-1, 1:], table[1:, 1:]], axis=-1)
        return self.pixel[four[(four >= 0).all(axis=-1)]].mean(axis=1)

    def mark(self, canvas: PhotoCanvas) -> float:
        """Radius of a mark that suits the photo and leaves the squares to be seen."""
        if not len(self.edges):
            return 4 * canvas.unit
        step = float(np.median(np.linalg.norm(np.ptp(self.edges, axis=1), axis=-1)))
        return min(4 * canvas.unit, 0.25 * step)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Board(_Mesh):
    """A board's named corners.

    Attributes:
        name: of the board.
        colour: that it is drawn in.
        added: (N,) whether the second pass found the corner.
        convention: whether its place on the board is by convention only.

    """

    name: str
    colour: Colour
    added: BoolArray
    convention: bool


def _boards(report: PhotoReport, corners: Observations) -> list[_Board]:
    """The boards of a photo that have named corners."""
    if report.name not in corners.images:
        return []
    fates = zip(report.found.grids if report.found else (), report.grids, strict=True)
    first = [grid.pixel for grid, fate in fates if fate.named]
    added = ~np.isin(corners.pixel @ [1, 1j], np.concatenate([np.empty((0, 2)), *first]) @ [1, 1j])
    conventions = {
        fate.place.board
        for fate in report.grids
        if fate.place is not None and fate.verdict is Decided.CONVENTION
    }
    boards = []
    for index, name in enumerate(corners.boards):
        here = (corners.image == corners.images.index(report.name)) & (corners.board == index)
        if here.any():
            boards.append(
                _Board(
                    cells=np.stack([corners.column[here], corners.row[here]], axis=-1),
                    pixel=corners.pixel[here],
                    name=name,
                    colour=BOARD_COLOURS[index % len(BOARD_COLOURS)],
                    added=added[here],
                    convention=index in conventions,
                )
            )
    return boards


def _left_out(report: PhotoReport) -> list[tuple[_Mesh, str]]:
    """The grids of a photo that were not named, and why."""
    if report.found is None:
        return []
    return [
        (
            _Mesh(cells=grid.cells, pixel=grid.pixel),
            Finding(code=CODES[fate.verdict], case="short").what,
        )
        for grid, fate in zip(report.found.grids, report.grids, strict=True)
        if not fate.named
    ]


def _clear(picture: Picture, report: PhotoReport, found: Sequence[_Mesh]) -> FloatArray:
    """Candidates (K, 2) of no grid that are nearly as contrasty as the grids' corners, if any.

    The clearest come first, and no more than can be told apart in a drawing.
    """
    refused = np.empty((0, 2)) if report.found is None else report.found.refused
    contrast = local_contrast(picture, refused)
    own = [local_contrast(picture, mesh.pixel) for mesh in found]
    least = _CLEAR * float(np.median(np.concatenate(own))) if own else 0.0
    order = np.argsort(-contrast, kind="stable")
    return refused[order[contrast[order] >= least][:_MOST_DOTS]]


def _draw_lines(canvas: PhotoCanvas, mesh: _Mesh, colour: Colour) -> None:
    """Lines between neighbours that leave the corners themselves to be seen."""
    along = mesh.edges[:, 1] - mesh.edges[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    gap = along * np.minimum(mesh.mark(canvas) / np.maximum(length, 1e-9), 0.5)
    canvas.outlined(
        np.stack([mesh.edges[:, 0] + gap, mesh.edges[:, 1] - gap], axis=1), colour, canvas.unit
    )


def _draw_left_out(canvas: PhotoCanvas, mesh: _Mesh) -> None:
    _draw_lines(canvas, mesh, LEFT_OUT)
    crosses = mesh.pixel[:, None, None] + mesh.mark(canvas) * _CROSS
    canvas.outlined(crosses.reshape(-1, 2, 2), LEFT_OUT, canvas.unit)


def _draw_marks(canvas: PhotoCanvas, board: _Board) -> None:
    """Open marks, so that the corners themselves can be seen in them."""
    mark = board.mark(canvas)
    for own, shape in ((~board.added, _RING), (board.added, 1.4 * _SQUARE)):
        for colour, size in ((BLACK, mark + canvas.unit), (board.colour, mark)):
            marks = board.pixel[own][:, None] + size * shape
            canvas.lines(marks, colour, canvas.unit, closed=True)


def _draw_axes(canvas: PhotoCanvas, board: _Board) -> list[tuple[str, FloatArray]]:
    """A disc at corner (0, 0) and arrows from the first corner in view.

    Returns:
        The arrows' letters, each with (K, 2) places where it may stand.

    """
    table, mark = board.table, board.mark(canvas)
    place = board.cells - board.cells.min(axis=0)
    lonely = (table[place[:, 0] + 1, place[:, 1]] < 0) | (table[place[:, 0], place[:, 1] + 1] < 0)
    # The corner nearest to (0, 0), rather one from which both arrows can start.
    column, row = place[np.lexsort([place[:, 1], place.sum(axis=1), lonely])[0]]
    starts = (table[column:, row], table[column, row:])
    paths = [board.pixel[line[: np.argmin(line >= 0)]] for line in starts]
    letters = []
    for letter, path, other in zip("xy", paths, paths[::-1], strict=True):
        if len(path) < 2:
            continue
        far = np.linalg.norm(path - path[0], axis=1) >= 4 * canvas.text_height
        path = path[: int(np.argmax(far)) + 1] if far.any() else path
        tip, along = path[-1], _unit(path[-1] - path[-2])
        across, head = along[::-1] * [-1, 1], 10 * canvas.unit
        triangle = tip + head * np.array([0 * along, 0.45 * across - along, -0.45 * across - along])
        stem = [np.concatenate([path[:-1], [tip - head * along]])]
        canvas.outlined([triangle], board.colour, canvas.unit, closed=True)
        canvas.outlined(stem, board.colour, 3 * canvas.unit)
        canvas.polygon(triangle, board.colour)
        canvas.reserve((path[0] + tip) / 2, mark)
        inwards = _unit(other[-1] - other[0]) if len(other) > 1 else across
        reach = 0.7 * head + np.abs(inwards) @ canvas.text_size(letter) / 2
        letters.append((letter, tip + reach * np.array([inwards, -inwards, 2 * along])))
    origin = board.pixel[(board.cells == 0).all(axis=1)]
    for colour, size in ((BLACK, 2.7), (WHITE, 2.4), (board.colour, 1.7)):
        canvas.dots(origin, colour, size * mark)
    for pixel in origin:
        canvas.reserve(pixel, 2 * mark)
    return letters


def _places(canvas: PhotoCanvas, mesh: _Mesh, text: str) -> FloatArray:
    """(K, 2) places for a text about a grid, the best first.

    In a square near the grid's middle, unless the text would hide much of it; on its sides.
    """
    low, high, size = mesh.pixel.min(axis=0), mesh.pixel.max(axis=0), canvas.text_size(text)
    middle, reach = (low + high) / 2, (high - low + size) / 2 + 2 * mesh.mark(canvas)
    sides = middle + reach * np.array([[0, 1], [0, -1], [1, 0], [-1, 0]])
    if np.prod(high - low) < 4 * np.prod(size):
        return sides
    far = np.linalg.norm(mesh.squares - mesh.pixel.mean(axis=0), axis=1)
    return np.concatenate([mesh.squares[np.argsort(far, kind="stable")], sides])


def _write_numbers(canvas: PhotoCanvas, board: _Board) -> None:
    """Columns' numbers at their first rows, rows' at their first columns.

    Where that is at the picture's edge, they stand at the other end. The first and the last
    also say x for columns, or y for rows, where there is room.
    """
    low = board.cells.min(axis=0).tolist()
    for axis, table, first in (("x", board.table, low[0]), ("y", board.table.T, low[1])):
        lines = {
            number: board.pixel[line[line >= 0]]
            for number, line in enumerate(table, start=first)
            if (line >= 0).sum() > 1
        }
        # First and last come first, since a number has to give way to those before it.
        for number in _some(list(lines), _thinning(canvas, [line[0] for line in lines.values()])):
            line = lines[number]
            outwards = np.array([_unit(line[0] - line[1]), _unit(line[-1] - line[-2])])
            named = [f"{axis}{number}"] * (number in (min(lines), max(lines)))
            for text in (*named, str(number)):
                reach = np.abs(outwards) @ canvas.text_size(text) / 2 + 3.6 * board.mark(canvas)
                places = line[[0, -1]] + outwards * reach[:, None]
                if canvas.plate(text, places[canvas.inside(places)][:1], board.colour):
                    break


def _thinning(canvas: PhotoCanvas, ends: Sequence[FloatArray]) -> int:
    """Every how many numbers have room side by side."""
    if len(ends) < 2:
        return 1
    between = float(np.median(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
    need = 1.1 * float(canvas.text_size("00")[0])
    return next((every for every in (1, 2, 5, 10, 20, 50) if every * between >= need), 100)


def _some(numbers: list[int], every: int) -> list[int]:
    """The first, the last, and the multiples of ``every`` in between."""
    between = [number for number in numbers[1:-1] if number % every == 0]
    return [*numbers[:1], *numbers[1:][-1:], *between]


def _caption(report: PhotoReport, boards: Sequence[_Board], dots: int) -> list[tuple[str, Colour]]:
    """The photo's name and how much of everything is drawn, in the colours it is drawn in."""
    count = sum(len(board.cells) for board in boards)
    added = sum(int(board.added.sum()) for board in boards)
    refused = 0 if report.found is None else len(report.found.refused)
    left_out = sum(not fate.named for fate in report.grids)
    parts = [(report.name, WHITE), (f"{count} corner{'s' * (count != 1)}", WHITE)]
    parts += [
        (f"{board.name} {len(board.cells)}" + " (place by convention)" * board.convention,
         board.colour)
        for board in boards
    ]  # fmt: skip
    if added:
        parts.append((f"{added} by a second look (squares)", WHITE))
    if left_out:
        parts.append((f"{left_out} grid{'s' * (left_out != 1)} left out", LEFT_OUT))
    elif report.problem is not None:
        parts.append((report.problem, LEFT_OUT))
    if refused:
        clear = f"{dots} of {refused}" if dots < refused else str(refused)
        parts.append((f"{clear} in no grid (dots)", REFUSED))
    return parts


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9))
