"""Standard streams that are closed or full, and how a run ends when a signal asks for it.

Imports next to nothing: this is settled before anything else is loaded.
"""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Iterable
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

if TYPE_CHECKING:
    from sys import UnraisableHookArgs


_STDIN, _STDOUT, _STDERR = 0, 1, 2


class _Talk(io.FileIO):
    """Standard error: what cannot be said is not said."""

    def write(self, data: Any, /) -> int:
        """As a file does, whatever happens."""
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


class _Results(io.FileIO):
    """Standard output: that it cannot be written is an error, once."""

    lost = False

    def write(self, data: Any, /) -> int:
        """As a file does.

        Raises:
            OSError: it cannot be written, for the first time; the error names the stream.

        """
        if self.lost:
            return memoryview(data).nbytes
        try:
            return super().write(data)
        except BrokenPipeError:  # the reader has seen enough
            raise
        except OSError as error:
            self.lost = True
            raise OSError(error.errno, error.strerror, "standard output") from error


def settle_streams(errors: str) -> None:
    """Open closed streams to nowhere, so that no file takes their place, and guard the others.

    Args:
        errors: how characters are written that a stream's encoding lacks.

    """
    for descriptor in (_STDIN, _STDOUT, _STDERR):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest number that is free: this one, since those below are open.
            os.open(os.devnull, os.O_RDONLY if descriptor == _STDIN else os.O_WRONLY)
    if sys.stdin is None:
        sys.stdin = io.TextIOWrapper(io.FileIO(_STDIN, closefd=False), encoding="utf-8")
    sys.stdout = _guarded(sys.stdout, _Results, _STDOUT, errors)
    sys.stderr = _guarded(sys.stderr, _Talk, _STDERR, errors)


def _guarded(stream: TextIO | None, kind: type[io.FileIO], descriptor: int, errors: str) -> TextIO:
    if stream is not None and not isinstance(stream, io.TextIOWrapper):
        return stream  # somebody's own
    if stream is not None and stream.isatty():  # Windows writes to consoles in its own way
        stream.reconfigure(errors=errors)
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(kind(descriptor, "wb", closefd=False)),
        encoding="utf-8" if stream is None else stream.encoding,
        errors=errors,
        newline=None,
        line_buffering=descriptor == _STDERR,
    )


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
