"""Whether the libraries of the extra ``report`` are there, found out without loading them."""

from __future__ import annotations

from importlib.util import find_spec

INSTALL = "pip install 'cubicfish[report]'"
LIBRARIES = ("jinja2", "matplotlib")


def missing() -> list[str]:
    """The libraries that a report needs and this Python lacks."""
    return [name for name in LIBRARIES if find_spec(name) is None]
