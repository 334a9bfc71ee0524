"""The optional packages of the extra ``report``, and drawing with matplotlib.

Nothing of it is loaded before it is drawn with.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INSTALL = "pip install 'cubicfish[report]'"
PRINTING = ("matplotlib",)
REPORT = ("jinja2",)


def missing(libraries: tuple[str, ...]) -> list[str]:
    """Those of the libraries that this Python lacks."""
    return [name for name in libraries if find_spec(name) is None]


def require(libraries: tuple[str, ...], purpose: str) -> None:
    """Refuse a purpose, such as ``a report``, if this Python lacks a library for it.

    Raises:
        CubicfishError: it lacks one; the line says how to install it.

    """
    lacking = missing(libraries)
    if lacking:
        raise CubicfishError(f"{purpose} needs {' and '.join(lacking)}: {INSTALL}")


@contextmanager
def quiet() -> Iterator[None]:
    """Keep matplotlib to itself: what it thinks of its set-up, and of libraries newer than it.

    Also while it is loaded, whatever Python was told to do with warnings: they are of matplotlib's
    own calls, and nothing that its users can change.
    """
    loggers = [logging.getLogger(name) for name in ("matplotlib", "fontTools")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            # A name in letters that the font lacks: boxes stand for them.
            warnings.filterwarnings("ignore", message="Glyph .* missing")
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def drawing(style: dict[Any, Any]) -> Iterator[None]:
    """Draw in a style, whatever the user's matplotlibrc says, and quietly."""
    with quiet():
        import matplotlib as mpl

        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(style)
            yield


def lay_out(figure: Figure) -> None:
    """Place a figure's parts for good, on round numbers.

    The solver that places them differs in the last digit from run to run, and matplotlib names
    parts of an SVG after such numbers: the same picture would not be the same file.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        bounds = axes.get_position(original=True).bounds
        left, bottom, width, height = (round(value, 6) for value in bounds)
        axes.set_position((left, bottom, width, height))
