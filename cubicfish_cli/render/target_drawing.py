"""A drawing of the calibration target, and of its boards as something sees them."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from cubicfish import FloatArray, Target
from cubicfish.models import cone_rays
from cubicfish.target import Board
from cubicfish_cli.render.board_shapes import dark_squares, paper
from cubicfish_cli.render.drawing import drawing, lay_out

_STYLE: dict[Any, Any] = {"svg.hashsalt": "target", "svg.fonttype": "none", "font.size": 10}
_SIZE = (9.0, 7.0)
_DIRECTIONS = 500
# A face needs not be seen squarer than this (cosine); its back is worth little.
_SQUARE_ENOUGH, _BACK = 0.75, 0.2
# Larger prints are drawn as plain plates, to keep the file small.
_MOST_SQUARES, _MOST_POINTS = 6000, 5000
_ORIGIN_COLOUR, _AXIS_COLOURS = "#d6336c", ("#e8590c", "#1c7ed6", "#2f9e44")


def object_svg(target: Target) -> bytes:
    """Draw the boards of a target, corner (0, 0) and both axes of each, and the world's axes.

    The target is seen from where most boards show their printed faces; boards that show their
    backs are dashed.
    """
    printed = [board for board in target.boards if board.points is None]
    up = _find_up(printed)
    way = _find_viewing_direction(printed, up)
    right = np.cross(-way, up)
    right /= np.linalg.norm(right)
    rows = np.stack([right, np.cross(right, -way)])
    with drawing(_STYLE):
        figure = Figure(figsize=_SIZE, layout="constrained")
        axes = figure.add_subplot(aspect="equal", xlabel=target.units)
        # A label goes with its board, so that what hides the one hides the other.
        for board in sorted(target.boards, key=lambda one: float(_find_middle(one) @ way)):
            _draw(axes, board, rows, way)
        for along, name, colour in zip(rows.T, "xyz", _AXIS_COLOURS, strict=True):
            arrow = {"arrowstyle": "<-", "color": colour}
            places: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
            axes.annotate(
                name,
                (0.07, 0.07),
                (32 * along[0], 32 * along[1]),
                arrowprops=arrow,
                color=colour,
                **places,
            )
        for kind, colour, text in (
            ("o", _ORIGIN_COLOUR, "corner (0, 0)"),
            ("-", _AXIS_COLOURS[0], "columns (x_axis)"),
            ("-", _AXIS_COLOURS[1], "rows (y_axis)"),
        ):
            axes.plot([], [], kind, color=colour, label=text)
        figure.legend(loc="outside upper center", ncols=3, frameon=False)
        axes.margins(0.08)
        lay_out(figure)
        data = io.BytesIO()
        figure.savefig(data, format="svg", metadata={"Date": None})
    return data.getvalue()


def draw_board(
    axes: Axes, board: Board, project: Callable[[FloatArray], FloatArray], pieces: int = 1
) -> None:
    """Draw the paper and the dark squares of a board as far as they are seen whole.

    Args:
        axes: where.
        board: one with a print.
        project: world points (..., 3) -> places on the axes (..., 2), NaN where they are not seen.
        pieces: how many the paper is drawn in along a side; where it is one, edges are straight.

    """
    squares = dark_squares(board)
    squares = board.origin + (_bend_edges(squares) if pieces > 1 else squares) @ board.axes[:2]
    prints = [squares] if len(squares) <= _MOST_SQUARES else []
    for polygons, colour in zip(
        [paper(board, pieces), *prints], ("white", "#3d434d"), strict=False
    ):
        place = project(polygons)
        whole = place[np.isfinite(place).all(axis=(1, 2))]
        look: dict[str, Any] = {
            "facecolor": colour,
            "edgecolor": colour,
            "linewidth": 0.5,
            "zorder": 2,
        }
        gid = f"{'paper' if colour == 'white' else 'print'} of {board.name}"
        axes.add_collection(PolyCollection(list(whole), rasterized=pieces > 1, gid=gid, **look))


def _bend_edges(polygons: FloatArray) -> FloatArray:
    """(N, K, 2) -> (N, 3 K, 2), with points between: edges are bent in the picture."""
    share = np.arange(3)[:, None] / 3
    start, end = polygons[:, :, None], np.roll(polygons, -1, 1)[:, :, None]
    return (start + share * (end - start)).reshape(len(polygons), -1, 2)


def _draw(axes: Axes, board: Board, rows: FloatArray, way: FloatArray) -> None:
    """Draw a board in parallel projection onto ``rows`` (2, 3), seen from direction ``way``."""

    def project(world: FloatArray) -> FloatArray:
        return np.asarray(world @ rows.T)

    name = board.name
    if board.points is not None:
        x, y = project(board.points[:_MOST_POINTS]).T
        axes.scatter(x, y, s=9, color="#ae3ec9", gid="dots")
    else:
        outline = PolyCollection(
            [*project(paper(board))], facecolor="none", edgecolor="#888", zorder=2
        )
        if -board.axes[2] @ way > 0:
            draw_board(axes, board, project)
        else:
            outline.set_linestyle("--")
            name += " (its back)"
        axes.add_collection(outline)
        origin = board.origin
        for axis, colour in zip(board.axes[:2], _AXIS_COLOURS, strict=False):
            axes.plot(
                *project(np.stack([origin, origin + 2 * board.square * axis])).T, color=colour
            )
        axes.plot(*project(origin), "o", color=_ORIGIN_COLOUR, gid=f"origin of {board.name}")
    axes.annotate(
        name,
        tuple(project(_find_middle(board))),
        ha="center",
        zorder=2,
        parse_math=False,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1},
    )


def _find_middle(board: Board) -> FloatArray:
    points = paper(board)[0] if board.points is None else board.points
    return np.asarray(points.mean(axis=0))


def _find_up(boards: list[Board]) -> FloatArray:
    """The world axis along which rows run down most; z where none does more."""
    down = sum((board.y_axis for board in boards), np.zeros(3))
    axes = np.concatenate([np.eye(3)[::-1], -np.eye(3)[::-1]])
    return axes[np.argmax(np.round(-axes @ down, 6))]


def _find_viewing_direction(boards: list[Board], up: FloatArray) -> FloatArray:
    """The direction towards a viewer who sees most faces well, a little from above and aside."""
    ways = cone_rays(np.pi, _DIRECTIONS)
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
