"""With this folder on PYTHONPATH, Python programs cannot reach a network.

Each attempt, and each program that is started, becomes a line of the file that the environment
variable GUARD_RECORD names.
"""

from __future__ import annotations

import os
import socket
import sys
from typing import Any

_RECORD = os.environ.get("GUARD_RECORD")
_NETWORK = ("socket.connect", "socket.sendto", "socket.sendmsg", "socket.bind")
_NAMES = ("socket.getaddrinfo", "socket.gethostbyname", "socket.gethostbyaddr", "urllib.Request")
_PROGRAMS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.startfile")


def _note(line: str) -> None:
    if _RECORD is not None:
        with open(_RECORD, "a", encoding="utf-8") as file:
            file.write(line + "\n")


def _watch(event: str, args: tuple[Any, ...]) -> None:
    if event in _NETWORK:
        family = getattr(args[0], "family", None)
        if family == getattr(socket, "AF_UNIX", None):  # processes of this machine
            return
    elif event not in _NAMES:
        if event in _PROGRAMS:
            _note(f"program {args[0]!r} {args[1] if len(args) > 1 else ''!r}")
        return
    _note(f"network {event} {args[1:]!r}")
    raise OSError(f"no network here: {event} {args[1:]!r}")


sys.addaudithook(_watch)
