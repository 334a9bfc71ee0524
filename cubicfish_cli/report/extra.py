"""Whether the libraries of the extra ``report`` are there, found out without loading them."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

INSTALL = "pip install 'cubicfish[report]'"
LIBRARIES = ("jinja2", "matplotlib")


def missing() -> list[str]:
    """The libraries that a report needs and this Python lacks."""
    return [name for name in LIBRARIES if find_spec(name) is None]


@contextmanager
def quiet() -> Iterator[None]:
    """Keep matplotlib to itself: what it thinks of its set-up, and of libraries newer than it.

    Also while it is loaded, whatever Python was told to do with warnings: they are of matplotlib's
    own calls, and nothing that its users can change.
    """
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            yield
    finally:
        logger.setLevel(level)
