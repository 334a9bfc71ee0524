"""Pictures of what was found in a photo, for people who want to see it."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Corners
from cubicfish_cli.naming.detect import PhotoReport
from cubicfish_cli.photos import Picture

ColourPicture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

_LEFT_OUT: Colour = (60, 60, 255)  # red: no board has this colour
_SHIFT = 4  # cv2 draws to 1/16 pixel


def draw_found(picture: Picture, report: PhotoReport, corners: Corners) -> ColourPicture:
    """The photo with its named corners, a colour a board, and in red what was left out.

    Lines follow the rows (growing column) and the columns of each board; its first corner in
    view carries the board's name and its own (column, row).

    Args:
        picture: (H, W) grey photo, 8 or 16 bits.
        report: what became of it.
        corners: the named corners of all photos.

    """
    scale = 1 if picture.dtype == np.uint8 else 1 / 257
    # Half as bright, so that the drawing stands out on white squares.
    dim = np.asarray(picture * (0.6 * scale), np.uint8)
    canvas: ColourPicture = np.repeat(dim[..., None], 3, axis=2)
    if report.found is not None:
        for grid, fate in zip(report.found.grids, report.grids, strict=True):
            if not fate.named:
                _grid(canvas, grid.cells, grid.pixel, _LEFT_OUT)
    if report.name not in corners.images:
        return canvas
    own = corners.image == corners.images.index(report.name)
    for index, name in enumerate(corners.boards):
        here = own & (corners.board == index)
        if here.any():
            cells = np.stack([corners.column[here], corners.row[here]], axis=-1)
            colour = _colour(index, len(corners.boards))
            _grid(canvas, cells, corners.pixel[here], colour)
            _label(canvas, name, cells, corners.pixel[here], colour)
    return canvas


def _colour(index: int, count: int) -> Colour:
    """Well apart from each other and from red, as blue, green, red."""
    red, green, blue = colorsys.hsv_to_rgb(0.14 + 0.72 * index / max(count, 1), 0.75, 1.0)
    return round(255 * blue), round(255 * green), round(255 * red)


def _grid(
    canvas: ColourPicture,
    cells: npt.NDArray[np.intp],
    pixel: npt.NDArray[np.float64],
    colour: Colour,
) -> None:
    place = {
        (int(column), int(row)): _fixed(point)
        for (column, row), point in zip(cells, pixel, strict=True)
    }
    for (column, row), point in place.items():
        for neighbour in ((column + 1, row), (column, row + 1)):
            if neighbour in place:
                cv2.line(canvas, point, place[neighbour], colour, 1, cv2.LINE_AA, _SHIFT)
        cv2.circle(canvas, point, 3 << _SHIFT, colour, 1, cv2.LINE_AA, _SHIFT)


def _label(
    canvas: ColourPicture,
    name: str,
    cells: npt.NDArray[np.intp],
    pixel: npt.NDArray[np.float64],
    colour: Colour,
) -> None:
    first = np.lexsort((cells[:, 0], cells[:, 1]))[0]
    column, row = cells[first].tolist()
    # cv2's fonts hold ASCII only.
    text = f"{name} ({column}, {row})".encode("ascii", "replace").decode()
    x, y = np.round(pixel[first]).astype(int).tolist()
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    at = (
        min(max(x + 6, 0), max(canvas.shape[1] - width - 2, 0)),
        min(max(y - 6, height + 2), canvas.shape[0] - 3),
    )
    for line_colour, thickness in (((0, 0, 0), 3), (colour, 1)):
        cv2.putText(
            canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, line_colour, thickness, cv2.LINE_AA
        )


def _fixed(point: Sequence[float] | npt.NDArray[np.float64]) -> tuple[int, int]:
    return round(float(point[0]) * (1 << _SHIFT)), round(float(point[1]) * (1 << _SHIFT))
