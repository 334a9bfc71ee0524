"""Bounded reading of untrusted files.

Whatever a file holds, it is read or refused in one line, within these bounds. Memory is that of one
file, beyond the file's own bytes and what the result needs; time is that of one processor of 2020.

=====================================  ==========================  ========  =======
file                                   largest                     memory    seconds
=====================================  ==========================  ========  =======
target.yaml                            4 MB, 500,000 values        300 MB    10
camera.yaml, rig.yaml                  67 MB, 500,000 values       500 MB    10
other cameras as YAML, XML, JSON       4 MB, 2 million values      300 MB    10
OCamCalib's text                       1 MB                        300 MB    10
JSON of nerfstudio                     64 MB, 2 million values     500 MB    10
COLMAP's cameras                       16 MB                       200 MB    10
.cameramodel                           64 MB, 500,000 values       1 GB      15
tables: corners, pairs, poses          100 MB, 16 million values   1.5 GB    20
corners.vnl                            200 MB, 5 million lines     2 GB      20
calib_data.mat, PhotonVision's         100 MB, 2 million values    1 GB      20
points, pixels                         100 MB                      1 GB      60
photos, each of those under way        2 GB, 200 million pixels    7 GB      15
=====================================  ==========================  ========  =======

Anything else than a file, such as a pipe or a device, is read up to the same bounds where text is
expected, and refused elsewhere. Only videos are handed to a library (FFmpeg) unseen, which is told
to open no other file and no frame of more than 200 million pixels.
"""

import errno
import os
import select
import stat
from contextlib import suppress
from pathlib import Path

from cubicfish.errors import CubicfishError

MAX_COORDINATE = 1e9
"""Largest coordinate of points and pixels: no photo and no object has larger ones."""
MAX_SIDE = 100_000
"""Longest side of photos, pixels."""
PATIENCE = 2.0
"""Seconds to wait for somebody to write into a pipe."""


def read_bytes(path: Path, *, max_bytes: int, error: type[CubicfishError]) -> bytes:
    """The contents of a file of at most ``max_bytes``.

    Pipes and devices are read up to the same bound; a pipe that nobody writes to is not waited for.

    Raises:
        error: the file cannot be read, or is larger.

    """
    try:
        with open(path, "rb", opener=_open_at_once) as file:
            first = _read_first_of_pipe(file.fileno())
            raw = first + file.read(max_bytes + 1)
    except (OSError, ValueError) as problem:  # ValueError: a name that no file can have
        if isinstance(problem, FileNotFoundError):
            raise error.missing(path) from problem
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


def _read_first_of_pipe(descriptor: int) -> bytes:
    """Wait for a pipe's first bytes, for ever if another program has it open to write.

    Raises:
        OSError: no program has it open to write.

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
