"""How a run ends when a signal asks for it."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterable
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

EXIT_SIGNAL = 128  # and the signal's number, as shells count

_asked: int | None = None
# A request that was lost is made again after so many seconds.
_AGAIN = 0.01


def raise_on(numbers: Iterable[int]) -> None:
    """Let these signals raise KeyboardInterrupt from now on, whatever comes of it on its way."""
    sys.unraisablehook = _not_lost
    for number in numbers:
        signal.signal(number, _ask)


def asked() -> int | None:
    """The signal that has asked for the end; None where none has.

    An exception may be another one's cause when it arrives, as while Python 3.11 makes a class.
    """
    return _asked


def _ask(number: int, frame: FrameType | None) -> NoReturn:
    global _asked
    _asked = number
    raise KeyboardInterrupt


def _not_lost(what: UnraisableHookArgs) -> None:
    """Where an exception goes nowhere, as in a finaliser, the request comes once more.

    What else finalisers say of work that was broken off is of no use to anybody.
    """
    if _asked is None:
        sys.__unraisablehook__(what)
    elif isinstance(what.exc_value, KeyboardInterrupt):
        import threading

        again = threading.Timer(_AGAIN, os.kill, (os.getpid(), _asked))
        again.daemon = True
        again.start()
