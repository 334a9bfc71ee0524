"""Name of the host that works for another machine, for messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_host: ContextVar[str] = ContextVar("host", default="")


def on_host() -> str:
    """`` on node7`` while the work of another machine is done on node7, else nothing."""
    name = _host.get()
    return f" on {name}" if name else ""


@contextmanager
def working_on(name: str) -> Iterator[None]:
    """Work inside is done for another machine, on the host ``name``: messages say so."""
    token = _host.set(name)
    try:
        yield
    finally:
        _host.reset(token)
