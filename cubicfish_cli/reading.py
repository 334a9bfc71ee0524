"""Reading files that nobody vouches for, at a bounded cost.

Whatever a file holds, it is read, or refused in one line, within these bounds, which are those of
a machine of 2020 and of one file at a time (photos: of each of the ``--jobs`` at work):

========================  ==========================  =======  =====================
what                      largest file                memory   time
========================  ==========================  =======  =====================
"""

from __future__ import annotations

import errno
import os
import select
import stat
from contextlib import suppress
from pathlib import Path

from cubicfish_cli.errors import CubicfishError

PATIENCE = 2.0
"""Seconds to wait for somebody to write into a pipe."""


def read_bytes(path: Path, *, max_bytes: int, error: type[CubicfishError]) -> bytes:
    """The contents of a file of at most ``max_bytes``.

    Pipes and devices are read as far; a pipe that nobody writes to is not waited for.

    Raises:
        error: the file cannot be read, or is larger.

    """
    try:
        with open(path, "rb", opener=_open_at_once) as file:
            first = _first_of_pipe(file.fileno())
            raw = first + file.read(max_bytes + 1)
    except (OSError, ValueError) as problem:  # ValueError: a name that no file can have
        what = getattr(problem, "strerror", None) or problem
        raise error(f"{path} cannot be read: {what}") from problem
    if len(raw) > max_bytes:
        raise error(f"{path} is larger than {max_bytes / 1e6:.3g} MB: is it the right file?")
    return raw


def read_text(path: Path, *, max_bytes: int, error: type[CubicfishError]) -> str:
    """The text of a file of at most ``max_bytes``; a byte order mark is dropped.

    Raises:
        error: the file cannot be read, is larger, or is not UTF-8 text.

    """
    try:
        return read_bytes(path, max_bytes=max_bytes, error=error).decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise error(f"{path} is not UTF-8 text: is it the right file?") from problem


def _open_at_once(path: str, flags: int) -> int:
    """Open, without waiting for the other end of a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _first_of_pipe(descriptor: int) -> bytes:
    """Wait for a pipe's first bytes, for ever if another program has it open to write.

    Raises:
        OSError: nobody has.

    """
    if not hasattr(os, "O_NONBLOCK"):
        return b""
    first = b""
    if stat.S_ISFIFO(os.fstat(descriptor).st_mode):
        waiting = select.poll()
        waiting.register(descriptor, select.POLLIN)
        if not waiting.poll(1000 * PATIENCE):
            with suppress(BlockingIOError):  # somebody is there, and silent so far
                first = os.read(descriptor, 1)
                if not first:
                    raise OSError(errno.EPIPE, "nobody writes to this pipe")
    os.set_blocking(descriptor, True)
    return first
