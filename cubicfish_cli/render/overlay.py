"""What was found in a photo, drawn over the photo, dimmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import Finding, FloatArray, Observations
from cubicfish.find import PhotoReport
from cubicfish_cli.words.remarks import problem_of
from cubicfish_cli.words.sentences import render_short

ColourPicture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]  # blue, green, red

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)
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

_SHIFT = 4  # cv2 draws to 1/16 pixel
_FONT = cv2.FONT_HERSHEY_SIMPLEX
# The background's brightest level and how much its dark parts are raised.
_BRIGHTEST, _GAMMA = 135.0, 0.7
# Levels are spread no further than this share of the grey scale: noise stays dark.
_LEAST_SPAN = 1 / 12
_SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def draw_found(
    picture: npt.NDArray[Any], report: PhotoReport, corners: Observations
) -> ColourPicture:
    """The photo, dimmed, with all that was found in it and what became of it.

    Each board has a colour: lines along its rows and columns, rings at its corners (squares
    where a second pass found them), a disc at corner (0, 0), arrows along growing column (x)
    and growing row (y) from the first corner in view, the last one's column and row.
    Grids that were left out are red crosses with the reason beside them. The caption counts all.

    Args:
        picture: (H, W) grey photo, 8 or 16 bits.
        report: what became of it.
        corners: the named corners of all photos.

    Returns:
        (H, W, 3) drawing in BGR order, 8 bits.

    """
    canvas = _Canvas(picture)
    boards = _find_boards(report, corners)
    for row, (text, colour) in enumerate(_write_caption(report, boards)):
        canvas.write(text, np.array([0.0, (row + 1) * canvas.line]), colour)
    for grid, fate in zip(report.found.grids if report.found else (), report.grids, strict=True):
        if fate.code is not None and not fate.named:
            lines, mark = _join_neighbours(grid.cells, grid.pixel, canvas.unit)
            cross = grid.pixel[:, None] + mark * _SQUARE
            canvas.lines(lines, LEFT_OUT)
            canvas.lines(np.concatenate([cross[:, ::2], cross[:, 1::2]]), LEFT_OUT)
            why = render_short(Finding(code=fate.code))
            canvas.write(f"left out: {why}", grid.pixel.mean(axis=0), LEFT_OUT)
    for board in boards:
        _draw_board(canvas, board)
    return canvas.pixels


class _Canvas:
    """A photo in grey, half as bright as it was, and what is drawn over it.

    Attributes:
        pixels: (H, W, 3) the drawing, in BGR order.
        unit: width of a thin line, pixels: about a thousandth of the photo's longer side.
        line: from a line of text to the next, pixels.

    """

    def __init__(self, picture: npt.NDArray[Any]) -> None:
        """Dim ``picture``, (H, W) of 8 or 16 bits."""
        self.pixels: ColourPicture = np.repeat(_dim(picture)[..., None], 3, axis=2)
        self.unit = max(max(picture.shape) / 1000, 1.0)
        self.line = 20 * self.unit

    def lines(self, paths: FloatArray, colour: Colour, *, width: float = 1.0,
              closed: bool = False) -> None:  # fmt: skip
        """Draw (N, K, 2) paths of pixels, so many units wide, with a dark seam."""
        fixed = list(_convert_to_fixed(paths))
        for own, more in ((BLACK, 1.5), (colour, 0.0)):
            thick = max(round((width + more) * self.unit), 1)
            cv2.polylines(self.pixels, fixed, closed, own, thick, cv2.LINE_AA, _SHIFT)

    def disc(self, pixel: FloatArray, colour: Colour, radius: float, thick: int = -1) -> None:
        """Draw a filled disc, or a ring so thick."""
        x, y = _convert_to_fixed(pixel).tolist()
        size = round(radius * (1 << _SHIFT))
        cv2.circle(self.pixels, (x, y), size, colour, thick, cv2.LINE_AA, _SHIFT)

    def write(self, text: str, pixel: FloatArray, colour: Colour) -> None:
        """Write a text on a dark plate from a pixel on; cv2's fonts hold ASCII only."""
        plain = text.encode("ascii", "replace").decode()
        scale, thick = 0.55 * self.unit, max(round(self.unit), 1)
        (width, height), _ = cv2.getTextSize(plain, _FONT, scale, thick)
        most = np.array(self.pixels.shape[1::-1]) - [width, 0]
        at = np.minimum(np.maximum(pixel + self.unit * np.array([4, -4]), [0, height]), most)
        x, y = np.rint(at).astype(int).tolist()
        cv2.rectangle(self.pixels, (x - thick, y + 3 * thick), (x + width, y - height), BLACK, -1)
        cv2.putText(self.pixels, plain, (x, y), _FONT, scale, colour, thick, cv2.LINE_AA)


def _draw_board(canvas: _Canvas, board: _Board) -> None:
    colour = board.colour
    lines, mark = _join_neighbours(board.cells, board.pixel, canvas.unit)
    canvas.lines(lines, colour)
    # Open marks, so that the corners themselves can be seen in them.
    for pixel in board.pixel[~board.added]:
        canvas.disc(pixel, BLACK, mark + canvas.unit, round(canvas.unit))
        canvas.disc(pixel, colour, mark, round(canvas.unit))
    canvas.lines(
        board.pixel[board.added][:, None] + 1.4 * mark * _SQUARE, colour, width=1.5, closed=True
    )
    for pixel in board.pixel[(board.cells == 0).all(axis=1)]:
        canvas.disc(pixel, WHITE, 2.4 * mark)
        canvas.disc(pixel, colour, 1.7 * mark)
    order = np.argsort(board.cells.sum(axis=1), kind="stable")
    first, last = order[0], order[-1]
    for letter, step in (("x", [1, 0]), ("y", [0, 1])):
        ahead = np.flatnonzero((board.cells == board.cells[first] + step).all(axis=1))
        if len(ahead):
            start, tip = (_convert_to_fixed(board.pixel[one]).tolist() for one in (first, ahead[0]))
            cv2.arrowedLine(canvas.pixels, start, tip, colour, round(3 * canvas.unit),
                            cv2.LINE_AA, _SHIFT, 0.3)  # fmt: skip
            canvas.write(letter, board.pixel[ahead[0]], WHITE)
    column, row = board.cells[last].tolist()
    canvas.write(f"x{column} y{row}", board.pixel[last], colour)
    canvas.write(board.name, board.pixel.mean(axis=0) + np.array([0, canvas.line]), colour)


def _dim(picture: npt.NDArray[Any]) -> ColourPicture:
    """The photo from black to half bright, its dark parts raised."""
    full = 65_535 if picture.dtype == np.uint16 else 255
    step = max(min(picture.shape) // 500, 1)
    low, high = np.percentile(picture[::step, ::step], [1, 99])
    low = min(low, high / 2)  # a photo that is all bright stays bright
    spread = (np.arange(full + 1) - low) / max(high - low, _LEAST_SPAN * full)
    levels = np.round(_BRIGHTEST * np.clip(spread, 0, 1) ** _GAMMA).astype(np.uint8)
    return np.asarray(levels[picture])


def _convert_to_fixed(pixel: FloatArray) -> npt.NDArray[np.int32]:
    return np.round(np.asarray(pixel) * (1 << _SHIFT)).astype(np.int32)


def _join_neighbours(
    cells: npt.NDArray[np.intp], pixel: FloatArray, unit: float
) -> tuple[FloatArray, float]:
    """Lines (M, 2, 2) along rows and columns, and the radius of a mark between them at a corner.

    The marks suit the photo and leave the squares to be seen, the lines the corners themselves.
    """
    at = dict(zip(map(tuple, cells.tolist()), pixel, strict=True))
    neighbours = [((x, y), step) for x, y in at for step in ((x + 1, y), (x, y + 1)) if step in at]
    ends = np.array([(at[one], at[other]) for one, other in neighbours]).reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    mark = min(4 * unit, 0.25 * float(np.median(length))) if len(ends) else 4 * unit
    gap = along * np.minimum(mark / np.maximum(length, 1e-9), 0.5)
    return np.stack([ends[:, 0] + gap, ends[:, 1] - gap], axis=1), mark


@dataclass(frozen=True, kw_only=True, eq=False)
class _Board:
    """A board's named corners in a photo.

    Attributes:
        cells: (N, 2) column and row.
        pixel: (N, 2).
        name: of the board.
        colour: that it is drawn in.
        added: (N,) whether the second pass found the corner.
        convention: whether its place on the board is by convention only.

    """

    cells: npt.NDArray[np.intp]
    pixel: FloatArray
    name: str
    colour: Colour
    added: npt.NDArray[np.bool_]
    convention: bool


def _find_boards(report: PhotoReport, corners: Observations) -> list[_Board]:
    """The boards of a photo that have named corners."""
    if report.name not in corners.images:
        return []
    fates = zip(report.found.grids if report.found else (), report.grids, strict=True)
    first = [grid.pixel for grid, fate in fates if fate.named]
    added = ~np.isin(corners.pixel @ [1, 1j], np.concatenate([np.empty((0, 2)), *first]) @ [1, 1j])
    conventions = {
        fate.place.board for fate in report.grids if fate.place is not None and not fate.sure
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


def _write_caption(report: PhotoReport, boards: Sequence[_Board]) -> list[tuple[str, Colour]]:
    """The photo's name and how much of everything is drawn, in the colours it is drawn in."""
    count = sum(len(board.cells) for board in boards)
    added = sum(int(board.added.sum()) for board in boards)
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
    elif (problem := problem_of(report)) is not None:
        parts.append((problem, LEFT_OUT))
    return parts
