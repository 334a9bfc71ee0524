"""The advice as a picture: uncertainty over the photo, and where to place the target."""

import io
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from cubicfish import FloatArray
from cubicfish.target import Board
from cubicfish_cli.extensions.advice.advise import Advice
from cubicfish_cli.extensions.advice.limited_lens import limited_lens
from cubicfish_cli.extensions.advice.proposals import Proposal
from cubicfish_cli.render.drawing import drawing, lay_out
from cubicfish_cli.render.target_drawing import draw_board

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "advice",
    "svg.fonttype": "none",
    "font.size": 10,
    "axes.facecolor": "#c4c8cd",
    "figure.dpi": 100,
    "savefig.dpi": 150,
}
_PANEL, _TEXT, _LETTERS = 4.8, 0.9, 58
_MOST_DOTS = 6000
# Boards are drawn this far beyond the field, plates in so many pieces along a side.
_BEYOND_DEG, _PIECES = 8.0, 12


def advice_picture(advice: Advice, suffix: str) -> bytes:
    """Draw the photos to take: where the target should be, over the corners so far.

    Dots are the corners; hatched squares of the field hold none.

    Args:
        advice: the advice to draw.
        suffix: of the picture's file, ``.svg``, ``.png`` or ``.pdf``.

    """
    columns = min(2, max(1, len(advice.proposals)))
    rows = max(1, -(-len(advice.proposals) // columns))
    width, height = advice.camera.image_size
    with drawing(_STYLE):
        size = (columns * _PANEL, rows * (_PANEL * height / width + _TEXT))
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels:
            axes.set_axis_off()
        if not advice.proposals:
            _draw_frame(panels[0], advice, "Enough" if advice.enough else "No photo is proposed")
        for number, proposal in enumerate(advice.proposals, start=1):
            _draw_photo(panels[number - 1], advice, proposal, f"{number}  Put {proposal.words}")
        lay_out(figure)
        made = io.BytesIO()
        undated = {"Date": None} if suffix == ".svg" else None
        figure.savefig(made, format=suffix[1:], metadata=undated)
    return made.getvalue()


def _draw_frame(axes: Axes, advice: Advice, title: str) -> None:
    """Draw a photo's frame with the trusted field and the corners so far, y down."""
    width, height = advice.camera.image_size
    axes.set_axis_on()
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
    axes.set_aspect("equal")
    (field,) = axes.fill(
        *advice.camera.outline().T, facecolor="#dcdfe2", edgecolor="#666", linestyle="--"
    )
    axes.set_xlabel(textwrap.fill(title, _LETTERS), loc="left", fontweight="bold")
    row, column = np.nonzero(advice.gaps.cells.empty)
    corner = np.stack([column, row], axis=-1)[:, None] + Board.AROUND_SQUARE
    empty = PolyCollection(
        list(corner * advice.gaps.cells.cell - 0.5),
        facecolor="none", edgecolor="#b3352a", hatch="//", linewidth=0.4, zorder=1.2,
    )  # fmt: skip
    axes.add_collection(empty)
    empty.set_clip_path(field)
    pixel = advice.pairs.pixel
    dots = pixel[:: -(-len(pixel) // _MOST_DOTS)]
    axes.scatter(dots[:, 0], dots[:, 1], s=2, color="#333", alpha=0.5, zorder=1.2, rasterized=True)


def _draw_photo(axes: Axes, advice: Advice, proposal: Proposal, title: str) -> None:
    """Draw a photo to take: the target as the camera would see it, farther boards first."""
    gain = (
        f"{proposal.before.median_px:.3f} px → {proposal.after.median_px:.3f} px, "
        f"{100 * proposal.gain:.0f} % less over the field"
    )
    _draw_frame(axes, advice, f"{title}; {gain}")
    if advice.target is None:
        return
    seen = proposal.view.seen
    away = np.linalg.norm(seen.camera, axis=1)
    shown = np.unique(seen.board[seen.visible]).tolist()
    lens = limited_lens(advice.camera, _BEYOND_DEG)
    boards = advice.target.with_flat_boards().boards

    def project(world: FloatArray) -> FloatArray:
        return lens.project(proposal.view.points(world))

    for index in sorted(shown, key=lambda one: -float(away[seen.board == one].mean())):
        draw_board(axes, boards[index], project, _PIECES)
