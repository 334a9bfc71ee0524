"""Whether the libraries of the extra ``report`` are there, found out without loading them."""

from __future__ import annotations

import logging
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
    """Keep matplotlib from logging what it thinks of its own set-up, also while it is loaded."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
