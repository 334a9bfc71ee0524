"""A drawing of the calibration target as SVG text: its boards in parallel projection."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.lenses.sphere import all_around
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.units import round_down

_WIDTH, _MARGIN, _LOWEST, _HIGHEST = 900.0, 60.0, 240.0, 1100.0
_FOOT = 44.0
_DIRECTIONS = 500
# A face needs not be seen squarer than this (cosine); its back is worth little.
_SQUARE_ENOUGH, _BACK = 0.75, 0.2
# Larger prints are drawn as plain plates, to keep the file small.
_MOST_SQUARES = 6000
_MOST_POINTS = 5000
_ORIGIN_COLOUR, _X_COLOUR, _Y_COLOUR, _Z_COLOUR = "#d6336c", "#e8590c", "#1c7ed6", "#2f9e44"
_STYLE = """\
  text { font: 15px system-ui, sans-serif; }
  .talk { fill: #7a7a7a; }
  .dot { fill: #ae3ec9; }
  .edge { stroke: #888; stroke-width: 1; }
  .paper { fill: #f4f1ea; }
  .print { fill: #454b57; }
  .back { fill: #888; fill-opacity: 0.12; stroke: #888; stroke-dasharray: 5 4; }
  .name { fill: #111; stroke: #fff; stroke-width: 4px; paint-order: stroke; text-anchor: middle; }
  .axis { stroke-width: 3; stroke-linecap: round; }
  @media (prefers-color-scheme: light) { .talk { fill: #333; } }
  @media (prefers-color-scheme: dark) { .talk { fill: #ddd; } }"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Picture:
    """A parallel projection onto a drawing.

    Attributes:
        rows: (2, 3) world directions of the drawing's x and y (down).
        to_viewer: (3,) world direction towards the viewer.
        scale: drawing units for a unit of the world.
        shift: (2,) where the world's origin is drawn.

    """

    rows: FloatArray
    to_viewer: FloatArray
    scale: float
    shift: FloatArray

    def at(self, world: FloatArray) -> FloatArray:
        """World points (..., 3) -> places on the drawing (..., 2)."""
        return np.asarray(self.scale * world @ self.rows.T + self.shift)

    def faces(self, board: Board) -> bool:
        """Whether the printed face is seen; lists of points have none and are always seen."""
        return board.points is not None or bool(-board.axes[2] @ self.to_viewer > 0)


def object_svg(target: Target) -> str:
    """Draw the boards of a target, corner (0, 0) and both axes of each, and the world's axes.

    The target is seen from where most boards show their printed faces; boards that show their
    backs are dashed. The colours suit light and dark pages alike.
    """
    plates = [_board_rim(board) for board in target.boards]
    picture, height = _picture_of(target, np.concatenate(plates))
    total = height + _FOOT
    order = sorted(range(len(plates)), key=lambda k: plates[k].mean(0) @ picture.to_viewer)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:.0f} {total:.0f}" '
        f'width="{_WIDTH:.0f}" height="{total:.0f}">',
        f"<title>{escape(', '.join(target.board_names))}</title>",
        f"<style>\n{_STYLE}\n</style>",
    ]
    for index in order:
        # A label goes with its board, so that what hides the one hides the other.
        lines += _drawn(target.boards[index], plates[index], picture)
        lines += _labels(target.boards[index], plates[index], picture)
    lines += [*_world_axes(picture, total), *_legend(target.units, picture, total), "</svg>", ""]
    return "\n".join(lines)


def _board_rim(board: Board) -> FloatArray:
    """World points of a board's print: (4, 3) its corners in order, or all points."""
    if board.points is not None:
        return board.points
    rim = board.rim
    end = board.plane_points(board.columns - 1, board.rows - 1) + rim
    plane = np.array([[-rim, -rim], [end[0], -rim], end, [-rim, end[1]]])
    return board.origin + plane @ board.axes[:2]


def _picture_of(target: Target, world: FloatArray) -> tuple[_Picture, float]:
    """A drawing of world points (N, 3) from where most boards show their faces, and its height."""
    printed = [board for board in target.boards if board.points is None]
    up = _up(printed)
    way = _way(printed, up)
    right = np.cross(-way, up)
    right /= np.linalg.norm(right)
    rows = np.stack([right, -np.cross(right, -way)])
    flat = world @ rows.T
    low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
    room = np.array([_WIDTH, _HIGHEST]) - 2 * _MARGIN
    scale = float((room / np.maximum(extent, 1e-12 * np.abs(world).max() + 1e-12)).min())
    height = max(scale * extent[1] + 2 * _MARGIN, _LOWEST)
    shift = np.array([_WIDTH, height]) / 2 - scale * (low + extent / 2)
    return _Picture(rows=rows, to_viewer=way, scale=scale, shift=shift), float(height)


def _up(boards: list[Board]) -> FloatArray:
    """The world axis along which rows run down most; z where none does more."""
    down = sum((board.y_axis for board in boards), np.zeros(3))
    axes = np.concatenate([np.eye(3)[::-1], -np.eye(3)[::-1]])
    return axes[np.argmax(np.round(-axes @ down, 6))]


def _way(boards: list[Board], up: FloatArray) -> FloatArray:
    """The direction towards a viewer who sees most faces well, a little from above and aside."""
    ways = all_around(_DIRECTIONS)
    ways = ways[np.abs(ways @ up) < 0.9]
    normals = -np.array([board.axes[2] for board in boards]).reshape(-1, 3)
    cosine = ways @ normals.T
    seen = np.sqrt(np.minimum(np.abs(cosine), _SQUARE_ENOUGH))
    score = np.where(cosine > 0, seen, _BACK * seen).sum(axis=1)
    aside = np.cross(up, normals.sum(axis=0))
    if np.linalg.norm(aside) < 1e-6:
        aside = np.ones(3) - up
    score += 0.05 * ways @ up + 0.02 * ways @ (aside / np.linalg.norm(aside))
    return ways[np.argmax(score)]


def _drawn(board: Board, plate: FloatArray, picture: _Picture) -> list[str]:
    if board.points is not None:
        dots = picture.at(board.points[:_MOST_POINTS])
        return [f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3"/>' for x, y in dots]
    outline = _path(picture.at(plate)[None])
    if not picture.faces(board):
        return [f'<path class="back" d="{outline}"/>']
    lines = [f'<path class="paper edge" d="{outline}"/>']
    squares = board.dark_squares()
    if len(squares) <= _MOST_SQUARES:
        world = board.origin + squares @ board.axes[:2]
        lines.append(f'<path class="print" d="{_path(picture.at(world))}"/>')
    return lines


def _path(polygons: FloatArray) -> str:
    """(N, K, 2) -> the ``d`` of one path."""
    parts = ["M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in polygon) + "Z" for polygon in polygons]
    return "".join(parts)


def _labels(board: Board, plate: FloatArray, picture: _Picture) -> list[str]:
    name = escape(board.name)
    middle = picture.at(plate.mean(axis=0))
    if board.points is None:
        if not picture.faces(board):
            name += " (its back)"
        length = 2 * board.square
        lines = [
            _line(picture.at(board.origin), picture.at(board.origin + length * axis), colour)
            for axis, colour in ((board.x_axis, _X_COLOUR), (board.y_axis, _Y_COLOUR))
        ]
        x, y = picture.at(board.origin)
        lines.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="{_ORIGIN_COLOUR}" stroke="#fff"/>'
        )
    else:
        lines = []
    return [*lines, f'<text class="name" x="{middle[0]:.1f}" y="{middle[1]:.1f}">{name}</text>']


def _line(start: FloatArray, end: FloatArray, colour: str) -> str:
    (x0, y0), (x1, y1) = start, end
    return (
        f'<line class="axis" stroke="{colour}" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" '
        f'y2="{y1:.1f}"/>'
    )


def _world_axes(picture: _Picture, total: float) -> list[str]:
    """The directions of the world's axes, at the bottom on the left."""
    start = np.array([_MARGIN, total - _MARGIN])
    lines = []
    for axis, name, colour in zip(np.eye(3), "xyz", (_X_COLOUR, _Y_COLOUR, _Z_COLOUR), strict=True):
        along = picture.rows @ axis
        x, y = start + 46 * along
        lines.append(_line(start, start + 36 * along, colour))
        lines.append(f'<text x="{x - 4:.1f}" y="{y + 5:.1f}" fill="{colour}">{name}</text>')
    return lines


def _legend(units: str, picture: _Picture, total: float) -> list[str]:
    y, left = total - 14, 2.5 * _MARGIN
    signs = (
        (_ORIGIN_COLOUR, "●", "corner (0, 0)"),
        (_X_COLOUR, "━", "columns (x_axis)"),
        (_Y_COLOUR, "━", "rows (y_axis)"),
    )
    words = " \u2003".join(f'<tspan fill="{colour}">{sign}</tspan> {what}'
                           for colour, sign, what in signs)  # fmt: skip
    length = round_down(130 / picture.scale)
    bar, right = length * picture.scale, _WIDTH - _MARGIN
    return [
        f'<text class="talk" x="{left:.1f}" y="{y:.1f}">{words}</text>',
        f'<path stroke="#888" stroke-width="2" fill="none" d="M{right - bar:.1f} {y - 20:.1f}'
        f'h{bar:.1f}m0 -5v10m{-bar:.1f} 0v-10"/><text class="talk" text-anchor="end" '
        f'x="{right:.1f}" y="{y:.1f}">{length:g} {escape(units)}</text>',
    ]
