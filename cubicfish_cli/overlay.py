"""Overlays: what was found in a photo, drawn over it.

A dimmed photo to draw on: marks and legible text, sized to suit the photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.identification.identified import CODES, Decided, PhotoReport
from cubicfish_cli.observations import Observations
from cubicfish_cli.photos import Picture
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.words.finding import Finding

ColourPicture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]  # blue, green, red

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)

_SHIFT = 4  # cv2 draws to 1/16 pixel
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_CAPITAL = 22  # height of its capitals at scale 1, pixels
# The background's brightest level and how much its dark parts are raised.
_BRIGHTEST, _GAMMA = 135.0, 0.7
# Levels are spread no further than this share of the grey scale: noise stays dark.
_LEAST_SPAN = 1 / 12
# A text in a grid hides much of it where the grid is not so many times as large.
_MUCH = 10


def local_contrast(picture: Picture, pixel: FloatArray) -> FloatArray:
    """Brightest minus darkest level (N,) some pixels around (N, 2) pixels, noise smoothed away."""
    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 1.5)
    around = np.ones((9, 9), np.uint8)
    reach = np.asarray(cv2.dilate(smooth, around)) - np.asarray(cv2.erode(smooth, around))
    height, width = picture.shape
    x, y = np.clip(np.rint(pixel).astype(int), 0, (width - 1, height - 1)).T
    return np.asarray(reach[y, x], float)


class PhotoCanvas:
    """A photo in grey, half as bright as it was, and what is drawn over it.

    Attributes:
        pixels: (H, W, 3) the drawing, in BGR order.
        unit: width of a thin line, pixels: about a thousandth of the photo's longer side.
        text_height: height of a capital letter, pixels.

    """

    def __init__(self, picture: Picture) -> None:
        """Dim ``picture``, (H, W) of 8 or 16 bits."""
        self.pixels: ColourPicture = np.repeat(_dimmed(picture)[..., None], 3, axis=2)
        longer = max(picture.shape)
        self.unit = max(longer / 1000, 1.0)
        self._scale = max(0.5 * longer / 1000, 0.4)
        self.text_height = _CAPITAL * self._scale
        self._taken: list[FloatArray] = []

    def lines(
        self, paths: Sequence[FloatArray] | FloatArray, colour: Colour, width: float, *,
        closed: bool = False,
    ) -> None:  # fmt: skip
        """Draw (N, 2) paths of pixels with round ends, ``width`` pixels wide."""
        fixed = [_fixed(path) for path in paths]
        if fixed:
            thickness = max(round(width), 1)
            cv2.polylines(self.pixels, fixed, closed, colour, thickness, cv2.LINE_AA, _SHIFT)

    def outlined(
        self, paths: Sequence[FloatArray] | FloatArray, colour: Colour, width: float, *,
        closed: bool = False,
    ) -> None:  # fmt: skip
        """Draw paths as :meth:`lines` does, with a dark seam that shows on bright squares."""
        self.lines(paths, BLACK, width + 2 * max(round(0.6 * self.unit), 1), closed=closed)
        self.lines(paths, colour, width, closed=closed)

    def dots(self, pixel: FloatArray, colour: Colour, radius: float) -> None:
        """Draw a filled disc at each of (N, 2) pixels."""
        self.lines(np.stack([pixel, pixel], axis=1), colour, 2 * radius)

    def polygon(self, corners: FloatArray, colour: Colour) -> None:
        """Fill a convex polygon of (N, 2) pixels."""
        cv2.fillConvexPoly(self.pixels, _fixed(corners), colour, cv2.LINE_AA, _SHIFT)

    def text_size(self, text: str) -> FloatArray:
        """(2,) width and height of a text's plate, pixels."""
        return np.array([self._width(text), self.text_height]) + 2 * self._margin

    def reserve(self, middle: FloatArray, radius: float) -> None:
        """Keep texts away from a mark."""
        self._taken.append(np.concatenate([middle - radius, middle + radius]))

    def inside(self, pixel: FloatArray) -> BoolArray:
        """(N,) which of (N, 2) pixels lie in the picture."""
        return np.asarray(((pixel >= 0) & (pixel < self.pixels.shape[1::-1])).all(axis=-1))

    def plate(
        self,
        text: str,
        middles: Sequence[FloatArray] | FloatArray,
        colour: Colour,
        *,
        filled: bool = False,
        insist: bool = False,
    ) -> bool:
        """Write a text on a plate at the first of several places that no other text has.

        Args:
            text: what is written; letters other than ASCII become question marks.
            middles: pixels (2,) where the plate's middle may be, the best one first; they are
                moved as far as the plate needs to lie within the picture.
            colour: of the text, or of the plate.
            filled: whether the plate has the colour, rather than the text.
            insist: whether to write at the first place where all are taken.

        Returns:
            Whether it was written.

        """
        size = self.text_size(text)
        room = np.maximum(np.array(self.pixels.shape[1::-1]) - size, 0)
        # (K, 4) left, top, right, bottom of the plate at each place.
        corner = np.clip(np.reshape(middles, (-1, 2)) - size / 2, 0, room)
        boxes = np.concatenate([corner, corner + size], axis=1)
        free = np.array([not self._is_taken(box) for box in boxes], bool)
        if not len(boxes) or not (free.any() or insist):
            return False
        box = boxes[np.argmax(free)]
        if filled:
            self._fill(box, colour, 0.0)
        else:
            self._fill(box, BLACK, 0.3)
        self._write(text, box, BLACK if filled else colour)
        self._taken.append(box)
        return True

    def caption(self, parts: Sequence[tuple[str, Colour]]) -> None:
        """Write texts one after the other at the top left, over at most a third of the photo."""
        gap, height = self._width("n") + self._margin, 1.6 * self.text_height
        lowest = max(self.pixels.shape[0] / 3 - height, 0)
        left, top, words = 0.0, 0.0, []
        # A part stays together where it can; one longer than a line is split into its words.
        for text, colour in parts:
            whole = self.text_size(text)[0] <= self.pixels.shape[1]
            for word in [text] if whole else text.split():
                right = left + self._width(word)
                if left and right + 2 * self._margin > self.pixels.shape[1]:
                    left, top, right = 0.0, top + height, right - left
                if top <= lowest:
                    words.append((word, np.array([left, top, right, top + height]), colour))
                left = right + (gap if whole else 0.7 * gap)
        box = np.max([place for _, place, _ in words], axis=0) + 2 * self._margin
        box[:2] = 0
        self._fill(box, BLACK, 0.3)
        for word, place, colour in words:
            self._write(word, place, colour)
        self._taken.append(box)

    @property
    def _thickness(self) -> int:
        return max(round(1.6 * self._scale), 1)

    @property
    def _margin(self) -> float:
        return 0.4 * self.text_height

    def _width(self, text: str) -> float:
        return float(cv2.getTextSize(_ascii(text), _FONT, self._scale, self._thickness)[0][0])

    def _is_taken(self, box: FloatArray) -> bool:
        return any((box[:2] < old[2:]).all() and (old[:2] < box[2:]).all() for old in self._taken)

    def _fill(self, box: FloatArray, colour: Colour, kept: float) -> None:
        """Cover a box, letting through a share of what is beneath."""
        left, top, right, bottom = np.round(box).astype(int).tolist()
        part = self.pixels[top:bottom, left:right]
        part[:] = np.round(kept * part + (1 - kept) * np.array(colour))

    def _write(self, text: str, box: FloatArray, colour: Colour) -> None:
        x = round(float(box[0] + self._margin))
        y = round(float(box[1] + box[3] + self.text_height) / 2)
        cv2.putText(
            self.pixels, _ascii(text), (x, y), _FONT, self._scale, colour, self._thickness,
            cv2.LINE_AA,
        )  # fmt: skip


def _dimmed(picture: Picture) -> ColourPicture:
    """The photo from black to half bright, its dark parts raised."""
    full = 65_535 if picture.dtype == np.uint16 else 255
    step = max(min(picture.shape) // 500, 1)
    low, high = np.percentile(picture[::step, ::step], [1, 99])
    low = min(low, high / 2)  # a photo that is all bright stays bright
    spread = (np.arange(full + 1) - low) / max(high - low, _LEAST_SPAN * full)
    levels = np.round(_BRIGHTEST * np.clip(spread, 0, 1) ** _GAMMA).astype(np.uint8)
    return np.asarray(levels[picture])


def _fixed(path: FloatArray) -> npt.NDArray[np.int32]:
    return np.round(np.asarray(path) * (1 << _SHIFT)).astype(np.int32)


def _ascii(text: str) -> str:
    """cv2's fonts hold ASCII only."""
    return text.encode("ascii", "replace").decode()


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
    if np.prod(high - low) < _MUCH * np.prod(size):
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
