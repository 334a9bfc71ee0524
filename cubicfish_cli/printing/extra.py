"""Whether the library that writes pages is there, found out without loading it."""

from __future__ import annotations

from importlib.util import find_spec

INSTALL = "pip install 'cubicfish[report]'"
LIBRARIES = ("matplotlib",)


def missing() -> list[str]:
    """The libraries that printing needs and this Python lacks."""
    return [name for name in LIBRARIES if find_spec(name) is None]
