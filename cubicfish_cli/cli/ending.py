"""How a run ends when a signal asks for it."""

from __future__ import annotations

import signal
from types import FrameType
from typing import NoReturn

EXIT_SIGNAL = 128  # and the signal's number, as shells count
EXIT_INTERRUPTED = EXIT_SIGNAL + signal.SIGINT


class Terminated(KeyboardInterrupt):
    """A request to end (SIGTERM, SIGHUP), to be cleaned up after like Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def terminate(number: int, frame: FrameType | None) -> NoReturn:
    """Handle such a signal."""
    raise Terminated(number)
