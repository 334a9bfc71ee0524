"""The advice as a picture: uncertainty over the photo, and where to place the target."""

from __future__ import annotations

import io
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from cubicfish_cli.app.drawing import drawing, lay_out
from cubicfish_cli.app.target_drawing import draw_board
from cubicfish_cli.app.viewpoints.truth import camera_points
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.advice.advise import Advice
from cubicfish_cli.extensions.advice.knowledge import reach_of
from cubicfish_cli.extensions.advice.proposals import Proposal

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "advice",
    "svg.fonttype": "none",
    "font.size": 10,
    "axes.facecolor": "#c4c8cd",
    "figure.dpi": 100,
    "savefig.dpi": 150,
}
# Uncertainty over the goal, and what a place with at most so much is filled with.
_LEVELS, _COLOURS = (0, 0.5, 1, 2, 1e9), ("#c3e9cf", "#eef0b4", "#fad192", "#f1958c")
_PANEL, _TEXT, _LETTERS = 4.8, 0.9, 58
_MOST_DOTS = 6000
# Boards are drawn this far beyond the field, plates in so many pieces along a side.
_BEYOND_DEG, _PIECES = 8.0, 12


def advice_picture(advice: Advice, suffix: str) -> bytes:
    """Draw the advice: a map of what is known where, and each photo to take with its instruction.

    Green to red is the uncertainty beside what is wanted; hatched squares of the field hold no
    corner; dots are the corners so far.

    Args:
        advice: what is drawn.
        suffix: of the picture's file, ``.svg``, ``.png`` or ``.pdf``.

    """
    shown = advice.proposals if advice.target is not None else ()
    columns = min(2, 1 + len(shown))
    rows = -(-(1 + len(shown)) // columns)
    width, height = advice.camera.image_size
    with drawing(_STYLE):
        size = (columns * _PANEL, rows * (_PANEL * height / width + _TEXT))
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels:
            axes.set_axis_off()
        _draw_map(panels[0], advice)
        for number, (axes, proposal) in enumerate(zip(panels[1:], shown, strict=False), start=1):
            _draw_photo(axes, advice, proposal, f"{number}  Put {proposal.words}")
        lay_out(figure)
        made = io.BytesIO()
        undated = {"Date": None} if suffix == ".svg" else None
        figure.savefig(made, format=suffix[1:], metadata=undated)
    return made.getvalue()


def _draw_frame(axes: Axes, advice: Advice, title: str) -> None:
    """A photo's frame with the trusted field, y down."""
    width, height = advice.camera.image_size
    axes.set_axis_on()
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.fill(*advice.camera.outline().T, facecolor="#dcdfe2", edgecolor="#666", linestyle="--")
    axes.set_xlabel(textwrap.fill(title, _LETTERS), loc="left", fontweight="bold")


def _draw_map(axes: Axes, advice: Advice) -> None:
    width, height = advice.camera.image_size
    goal = advice.goal_px
    if advice.now is None:
        title = "No corners in the hatched squares; dots are the corners so far"
    else:
        end = "" if advice.enough else f"; wanted: {goal:g} px"
        title = f"{'Enough' if advice.enough else 'Now'}: {advice.now.words}{end}"
    _draw_frame(axes, advice, title)
    field = axes.patches[0]
    norm = BoundaryNorm(_LEVELS, len(_COLOURS))
    image = axes.imshow(
        advice.sigma / goal,
        extent=(-0.5, width - 0.5, height - 0.5, -0.5),
        cmap=ListedColormap(_COLOURS),
        norm=norm,
        interpolation="nearest",
        zorder=1.5,
    )
    image.set_clip_path(field)
    row, column = np.nonzero(advice.gaps.cells.empty)
    corner = np.stack([column, row], axis=-1)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    empty = PolyCollection(
        list(corner * advice.gaps.cells.cell - 0.5),
        facecolor="none", edgecolor="#b3352a", hatch="//", linewidth=0.4, zorder=2,
    )  # fmt: skip
    axes.add_collection(empty)
    empty.set_clip_path(field)
    dots = advice.pixel[:: -(-len(advice.pixel) // _MOST_DOTS)]
    axes.scatter(dots[:, 0], dots[:, 1], s=2, color="#333", alpha=0.5, zorder=2, rasterized=True)
    if advice.now is not None:
        words = (f"≤ {goal / 2:.2g}", f"≤ {goal:.2g}", f"≤ {2 * goal:.2g}", f"> {2 * goal:.2g} px")
        keys = [Patch(color=one, label=text) for one, text in zip(_COLOURS, words, strict=True)]
        axes.legend(handles=keys, ncols=4, loc="lower center", fontsize=8, framealpha=0.9)


def _draw_photo(axes: Axes, advice: Advice, proposal: Proposal, title: str) -> None:
    """A photo to take: the target as the camera would see it, farther boards first."""
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
    lens = reach_of(advice.camera, _BEYOND_DEG)
    boards = advice.target.with_flat_boards().boards

    def project(world: FloatArray) -> FloatArray:
        return lens.project(camera_points(proposal.view.pose, world))

    for index in sorted(shown, key=lambda one: -float(away[seen.board == one].mean())):
        draw_board(axes, boards[index], project, _PIECES)
