"""The advice as an SVG picture: uncertainty over the photo, and where to place the target."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from html import escape

import numpy as np

from cubicfish_cli.advice.advise import Advice
from cubicfish_cli.advice.field import GRID, reach_of, rim_of
from cubicfish_cli.advice.proposals import Proposal
from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.boards.board import Board
from cubicfish_cli.rendering.object_drawing import board_rim
from cubicfish_cli.rendering.truth import camera_points
from cubicfish_cli.rendering.views import WholeLens
from cubicfish_cli.types import FloatArray

_WIDTH, _MARGIN, _GAP = 1000.0, 20.0, 24.0
_PANEL = (_WIDTH - 2 * _MARGIN - _GAP) / 2
_LINE, _LETTERS = 22.0, 52
_COLOURS = ("#c2255c", "#1864ab", "#d9480f")
_MOST_DOTS, _MOST_SQUARES = 6000, 3000
# Uncertainty over the goal, and what a square with at most so much is filled with.
_LEVELS = ((0.5, "#c3e9cf"), (1.0, "#eef0b4"), (2.0, "#fad192"), (np.inf, "#f1958c"))
_EDGE_STEPS, _PIECES = 40, 20
# Boards are drawn this far beyond the rim at which they are cut off.
_CUT_DEG = 8.0
# Edges of squares are drawn bent where there are few squares, which are large then.
_SQUARE_STEPS, _FEW_SQUARES = 5, 200
_DOT, _DENSE = 1.8, 1500
_STYLE = """\
  text { font: 15px system-ui, sans-serif; fill: #222; }
  .page { fill: #fff; }
  .photo { fill: #e4e4e6; }
  .frame { fill: none; stroke: #888; }
  .field { fill: #f4f4f2; stroke: #888; stroke-dasharray: 6 4; }
  .line { fill: none; stroke: #777; stroke-dasharray: 6 4; }
  .dot { fill: #333; fill-opacity: 0.45; }
  .empty { fill: url(#hatch); stroke: #b3352a; stroke-opacity: 0.5; }
  .paper { fill: #fff; }
  .print { fill: #3d434d; }
  .mark { font-weight: 700; font-size: 21px; fill: #fff; text-anchor: middle; }
  .head { font-weight: 600; }"""


def advice_svg(advice: Advice) -> str:
    """Draw the advice: a map of what is known where, and each photo to take with its instruction.

    Green to red is the uncertainty beside what is wanted; hatched squares of the field hold no
    corner; dots are the corners so far.
    """
    width, height = advice.camera.image_size
    scale = _PANEL / width
    tall = scale * height
    panels = [_map(advice, scale), *_photos(advice, scale)]
    below = [_map_lines(advice), *map(_photo_lines, advice.proposals)]
    rows = [range(first, min(first + 2, len(panels))) for first in range(0, len(panels), 2)]
    across = _WIDTH if len(panels) > 1 else 2 * _MARGIN + _PANEL
    lines, top = [], _MARGIN
    for row in rows:
        for number in row:
            left = _MARGIN + (number % 2) * (_PANEL + _GAP)
            lines += [
                f'<g transform="translate({left + 0.5 * scale:.2f} {top + 0.5 * scale:.2f}) '
                f'scale({scale:.6f})">',
                *panels[number],
                "</g>",
            ]
            colour = _COLOURS[(number - 1) % len(_COLOURS)] if number else None
            lines += _written(below[number], left, top + tall + _LINE, colour)
            if number:
                lines += _badge(number, left + 22, top + 22, _COLOURS[(number - 1) % 3])
            elif np.isfinite(advice.sigma).any():
                lines += _legend(advice, left, top + tall + _LINE * (1 + len(below[0])))
        lengths = [len(below[number]) + (0 if number else 2) for number in row]
        top += tall + _LINE * (1.2 + max(lengths)) + 6
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {across:.0f} {top:.0f}" '
            f'width="{across:.0f}" height="{top:.0f}">',
            "<title>What to photograph next</title>",
            f"<style>\n{_STYLE}\n</style>",
            '<defs><pattern id="hatch" width="14" height="14" patternUnits="userSpaceOnUse" '
            'patternTransform="rotate(45)"><path d="M0 0V14" stroke="#b3352a" stroke-width="3" '
            'stroke-opacity="0.6"/></pattern>'
            f'<clipPath id="frame"><rect x="-0.5" y="-0.5" width="{width}" height="{height}"/>'
            f'</clipPath><clipPath id="field"><path d="{_path(advice.camera.outline())}"/>'
            f'</clipPath><clipPath id="reach"><path d="{_path(rim_of(advice.camera))}"/>'
            "</clipPath></defs>",
            f'<rect class="page" width="{across:.0f}" height="{top:.0f}"/>',
            *lines,
            "</svg>",
            "",
        ]
    )


def _rectangle(advice: Advice, name: str, scale: float) -> str:
    width, height = advice.camera.image_size
    return (
        f'<rect class="{name}" x="-0.5" y="-0.5" width="{width}" height="{height}" '
        f'stroke-width="{1 / scale:.2f}"/>'
    )


def _map(advice: Advice, scale: float) -> list[str]:
    outline = _path(advice.camera.outline())
    return [
        _rectangle(advice, "photo", scale),
        f'<path class="field" stroke="none" d="{outline}"/>',
        '<g clip-path="url(#field)">',
        *_certainty(advice),
        *_empty(advice, scale),
        "</g>",
        '<g clip-path="url(#frame)">',
        *_dots(advice, scale),
        f'<path class="line" stroke-width="{1.5 / scale:.2f}" d="{outline}"/>',
        "</g>",
        _rectangle(advice, "frame", scale),
    ]


def _photos(advice: Advice, scale: float) -> Iterator[list[str]]:
    """The photos to take: the target as the camera would see it."""
    if advice.target is None:
        return
    lens = reach_of(advice.camera, _CUT_DEG)
    boards = advice.target.with_flat_boards().boards
    outline = _path(advice.camera.outline())
    for number, proposal in enumerate(advice.proposals):
        seen = proposal.view.seen
        away = np.linalg.norm(seen.camera, axis=1)
        shown = sorted(
            np.unique(seen.board[seen.visible]).tolist(),
            key=lambda index: -float(away[seen.board == index].mean()),
        )
        lines = [
            _rectangle(advice, "photo", scale),
            '<g clip-path="url(#frame)">',
            f'<path class="field" stroke-width="{1.5 / scale:.2f}" d="{outline}"/>',
            '<g clip-path="url(#reach)">',
        ]
        for index in shown:
            lines += _board(boards[index], proposal, lens, _COLOURS[number % len(_COLOURS)], scale)
        yield [*lines, "</g>", "</g>", _rectangle(advice, "frame", scale)]


def _certainty(advice: Advice) -> Iterator[str]:
    """The photo in squares, coloured by the uncertainty there; the field is cut out of it."""
    known = np.isfinite(advice.sigma)
    if not known.any():
        return
    grid, sigma = advice.grid[known], advice.sigma[known]
    side = [size / count for size, count in zip(advice.camera.image_size, GRID, strict=True)]
    x, y = ((np.arange(count) + 0.5) * step - 0.5 for count, step in zip(GRID, side, strict=True))
    middle = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # Squares at the rim whose middle is outside: as the nearest inside.
    apart = np.linalg.norm(middle[:, None] - grid, axis=-1)
    nearest = apart.argmin(axis=1)
    drawn = apart.min(axis=1) <= 2 * max(side)
    away = angle_from_axis(advice.camera.unproject(middle))
    drawn &= ~(away < advice.gaps.cells.blind)
    level = np.searchsorted([limit for limit, _ in _LEVELS], sigma[nearest] / advice.goal_px)
    for number, (_, colour) in enumerate(_LEVELS):
        own = middle[drawn & (level == number)]
        if len(own):
            parts = "".join(
                f"M{x - side[0] / 2:.1f} {y - side[1] / 2:.1f}h{side[0]:.1f}v{side[1]:.1f}"
                f"h{-side[0]:.1f}z"
                for x, y in own
            )
            yield f'<path fill="{colour}" stroke="{colour}" d="{parts}"/>'


def _empty(advice: Advice, scale: float) -> Iterator[str]:
    cell = advice.gaps.cells.cell
    row, column = np.nonzero(advice.gaps.cells.empty)
    if len(row):
        parts = "".join(
            f"M{x * cell - 0.5:.1f} {y * cell - 0.5:.1f}h{cell:.1f}v{cell:.1f}h{-cell:.1f}z"
            for x, y in zip(column, row, strict=True)
        )
        yield f'<path class="empty" stroke-width="{1 / scale:.2f}" d="{parts}"/>'


def _dots(advice: Advice, scale: float) -> Iterator[str]:
    step = -(-len(advice.pixel) // _MOST_DOTS)
    shown = len(advice.pixel) / max(step, 1)
    radius = _DOT * min(1.0, (_DENSE / max(shown, 1)) ** 0.5) / scale
    parts = "".join(
        f"M{x - radius:.1f} {y:.1f}a{radius:.2f} {radius:.2f} 0 1 0 {2 * radius:.2f} 0"
        f"a{radius:.2f} {radius:.2f} 0 1 0 {-2 * radius:.2f} 0"
        for x, y in advice.pixel[::step]
    )
    yield f'<path class="dot" d="{parts}"/>'


def _board(
    board: Board, proposal: Proposal, lens: WholeLens, colour: str, scale: float
) -> Iterator[str]:
    def seen(world: FloatArray) -> FloatArray:
        pixel = lens.project(camera_points(proposal.view.pose, world))
        return pixel[np.isfinite(pixel).all(axis=-1).all(axis=-1)] if pixel.ndim == 3 else pixel

    rim = board_rim(board)
    share = np.arange(_EDGE_STEPS) / _EDGE_STEPS
    edges = [
        start + share[:, None] * (end - start)
        for start, end in zip(rim, np.roll(rim, -1, 0), strict=True)
    ]
    border = seen(np.concatenate(edges))
    paper = _path(border)
    if not np.isfinite(border).all():
        # Parts are out of reach: the plate in small pieces.
        share = np.arange(_PIECES) / _PIECES
        x, y = (part.ravel()[:, None, None] for part in np.meshgrid(share, share))
        step = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) / _PIECES
        right, down = rim[1] - rim[0], rim[3] - rim[0]
        pieces = rim[0] + (x + step[:, :1]) * right + (y + step[:, 1:]) * down
        paper = "".join(_path(piece) for piece in seen(pieces))
    yield f'<path class="paper" stroke="#fff" stroke-width="1" d="{paper}"/>'
    squares = board.dark_squares()
    if len(squares) <= _MOST_SQUARES:
        bent = _with_points_between(squares, _SQUARE_STEPS if len(squares) <= _FEW_SQUARES else 1)
        ink = "".join(_path(one) for one in seen(board.origin + bent @ board.axes[:2]))
        yield f'<path class="print" d="{ink}"/>'
    yield (
        f'<path fill="none" stroke="{colour}" stroke-width="{2 / scale:.2f}" d="{_path(border)}"/>'
    )


def _with_points_between(polygons: FloatArray, steps: int) -> FloatArray:
    """(N, K, 2) -> (N, K steps, 2), every edge in so many parts."""
    share = np.arange(steps)[:, None] / steps
    start, end = polygons[:, :, None], np.roll(polygons, -1, 1)[:, :, None]
    return (start + share * (end - start)).reshape(len(polygons), -1, 2)


def _path(polygon: FloatArray) -> str:
    """(K, 2) -> the ``d`` of a closed line; of what has no pixel it leaves a gap."""
    known = np.isfinite(polygon).all(axis=1)
    if known.all():
        return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in polygon) + "Z"
    if not known.any():
        return ""
    # Begin behind a gap, so that no piece is cut in two.
    first = int(np.argmin(known)) + 1
    pieces: list[list[str]] = [[]]
    for (x, y), there in zip(np.roll(polygon, -first, 0), np.roll(known, -first), strict=True):
        if there:
            pieces[-1].append(f"{x:.1f} {y:.1f}")
        elif pieces[-1]:
            pieces.append([])
    return "".join("M" + "L".join(piece) for piece in pieces if piece)


def _badge(number: int, x: float, y: float, colour: str) -> list[str]:
    return [
        f'<circle cx="{x:.0f}" cy="{y:.0f}" r="15" fill="{colour}"/>'
        f'<text class="mark" x="{x:.0f}" y="{y + 7.5:.1f}">{number}</text>'
    ]


def _legend(advice: Advice, left: float, y: float) -> list[str]:
    """What the map's colours and marks mean, in two rows."""
    goal = advice.goal_px
    words = [f"≤ {goal / 2:.2g}", f"≤ {goal:.2g}", f"≤ {2 * goal:.2g}", f"> {2 * goal:.2g} px"]
    lines = []
    for number, ((_, fill), text) in enumerate(zip(_LEVELS, words, strict=True)):
        x = left + number * _PANEL / 4
        lines.append(_swatch(x, y, fill) + _beside(x, y, text))
    y += _LINE
    dash = f"M{{:.0f}} {y - 5:.0f}m-10 0h20"
    marks = [
        (f'<circle cx="{{:.0f}}" cy="{y - 5:.0f}" r="2.5" class="dot"/>', "a corner so far"),
        (f'<path class="line" stroke-width="1.5" d="{dash}"/>', "the field"),
    ]
    if advice.gaps.cells.empty.any():
        marks.append(("", "no corner yet"))
    for number, (mark, text) in enumerate(marks):
        x = left + number * _PANEL / 3
        drawn = mark.format(x + 10) if mark else _swatch(x, y, "url(#hatch)")
        lines.append(drawn + _beside(x, y, text))
    return lines


def _swatch(x: float, y: float, fill: str) -> str:
    return (
        f'<rect x="{x:.0f}" y="{y - 14:.0f}" width="20" height="16" fill="{fill}" stroke="#999"/>'
    )


def _beside(x: float, y: float, text: str) -> str:
    return f'<text x="{x + 26:.0f}" y="{y:.0f}">{escape(text)}</text>'


def _map_lines(advice: Advice) -> list[str]:
    if advice.now is None:
        return ["No corners in the hatched squares; dots are the corners so far"]
    begin = "Enough" if advice.enough else "Now"
    told = f"{begin}: {advice.now.words}; wanted: {advice.goal_px:g} px"
    return textwrap.wrap(told, _LETTERS)


def _photo_lines(proposal: Proposal) -> list[str]:
    gain = (
        f"{proposal.here_before_px:.3f} px → {proposal.here_after_px:.3f} px there, "
        f"{100 * proposal.gain:.0f} % less over the field"
    )
    return [*textwrap.wrap(f"Put {proposal.words}", _LETTERS), gain]


def _written(lines: list[str], left: float, top: float, colour: str | None) -> Iterator[str]:
    style = f' style="fill: {colour}"' if colour else ""
    for number, text in enumerate(lines):
        yield (
            f'<text class="head" x="{left:.0f}" y="{top + _LINE * number:.0f}"{style}>'
            f"{escape(text)}</text>"
        )
