"""How far a long step is: a line on stderr, on a terminal only, that leaves nothing behind."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

from cubicfish_cli.cli.options import verbosity
from cubicfish_cli.cli.streams import ERRORS, can_redraw

if TYPE_CHECKING:
    from cubicfish_cli.cli.progress_line import ProgressLine

CountCallback = Callable[[int, int], None]
StageCallback = Callable[[str, float], None]

# What is done sooner shows no line: it would only flash.
_PATIENCE_SECONDS = 0.4


@contextmanager
def progress(label: str) -> Iterator[CountCallback]:
    """Yield ``callback(done, total)``: a bar, counts and the time left."""
    with _line(label) as line:
        yield lambda done, total: line.count(done, total) if line else None


@contextmanager
def stages(label: str) -> Iterator[StageCallback]:
    """Yield ``callback(words, share)`` for work in stages: what is done now, and the share done."""
    with _line(label) as line:
        yield lambda words, share: line.stage(words, share) if line else None


@contextmanager
def working(label: str) -> Iterator[None]:
    """Show that one long step is under way, and for how long."""
    with _line(label):
        yield


@contextmanager
def _line(label: str) -> Iterator[ProgressLine | None]:
    if not can_redraw(sys.stderr) or verbosity() < 0:
        yield None
        return
    from cubicfish_cli.cli.progress_line import ProgressLine

    encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
    # A descriptor of its own: decoders on other threads have theirs silenced meanwhile.
    with os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding=encoding, errors=ERRORS) as stream:
        line = ProgressLine(label, stream)
        timer = Timer(_PATIENCE_SECONDS, line.show)
        timer.daemon = True
        timer.start()
        try:
            yield line
        finally:
            timer.cancel()
            timer.join()
            line.close()
