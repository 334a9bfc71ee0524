"""Terminals for tests: one that only says that it is one, and a real one of the system's."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import time
from dataclasses import dataclass

from rich.cells import cell_len

_STYLES = re.compile(r"\x1b\[[0-9;]*m")
_LONGEST_SECONDS = 120


class Screen(io.StringIO):
    """Standard output that claims to be a terminal; ``COLUMNS`` says how wide."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        raise OSError("no descriptor")

    @property
    def text(self) -> str:
        return unstyled(self.getvalue())


def unstyled(text: str) -> str:
    """Without colours."""
    return _STYLES.sub("", text)


def widest(text: str) -> int:
    """Cells of the widest line."""
    return max(map(cell_len, unstyled(text).replace("\r", "").split("\n")))


# The cursor is hidden while a bar moves, and its line is wiped out in the end.
_PROGRESS = re.compile(r"\x1b\[\?25l.*?\x1b\[\?25h\s*(?:\x1b\[1A)?(?:\x1b\[2K)?", re.DOTALL)


@dataclass(frozen=True)
class Ended:
    """A program that ran on a terminal: its exit code, and what it printed where."""

    code: int
    screen: str
    stdout: str

    @property
    def settled(self) -> str:
        """What stays on the screen when progress, which slow machines show, is gone."""
        return _PROGRESS.sub("", self.screen)


def on_terminal(
    *args: object,
    columns: int = 80,
    piped: bool = False,
    interrupt_at: str | None = None,
    **environment: str,
) -> Ended:
    """Run ``cubicfish`` on a terminal of its own.

    Args:
        args: its arguments.
        columns: the terminal's width.
        piped: stdout is a pipe instead; stderr stays on the terminal.
        interrupt_at: Ctrl-C is pressed when this has appeared.
        environment: variables on top of those here; colours are asked for by none of these.

    """
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    held = {"NO_COLOR", "FORCE_COLOR", "COLUMNS", "LINES", "PYTHONIOENCODING"}
    own = {name: value for name, value in os.environ.items() if name not in held}
    own |= {"TERM": "xterm-256color", "PYTHONUTF8": "1", **environment}
    process = subprocess.Popen(
        [sys.executable, "-m", "cubicfish_cli", *map(str, args)],
        stdin=follower,
        stdout=subprocess.PIPE if piped else follower,
        stderr=follower,
        env=own,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )
    os.close(follower)
    seen, pressed, ends = b"", False, time.monotonic() + _LONGEST_SECONDS
    try:
        while time.monotonic() < ends:
            try:
                part = os.read(leader, 65536)
            except OSError:  # what Linux says when all have closed a terminal
                break
            if not part:
                break
            seen += part
            if interrupt_at and not pressed and interrupt_at.encode() in seen:
                os.write(leader, b"\x03")
                pressed = True
        stdout = process.stdout.read().decode() if process.stdout else ""
        code = process.wait(timeout=_LONGEST_SECONDS)
    finally:
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()
        os.close(leader)
    return Ended(code, seen.decode("utf-8", "replace").replace("\r\n", "\n"), stdout)


def visible(text: str) -> list[str]:
    """The lines that a terminal shows in the end, where all that is redrawn is whole lines."""
    lines, at, column = [""], 0, 0
    for part in re.findall(r"\x1b\[[0-9;?]*[A-Za-z]|\r|\n|[^\x1b\r\n]+", text):
        if part == "\n":
            at, column = at + 1, 0
            lines += [""] * (at >= len(lines))
        elif part == "\r":
            column = 0
        elif part == "\x1b[2K":
            lines[at] = ""
        elif part.endswith("A"):
            at = max(0, at - int(part[2:-1] or 1))
        elif not part.startswith("\x1b"):
            lines[at] = lines[at][:column].ljust(column) + part + lines[at][column + len(part) :]
            column += len(part)
    return [line.rstrip() for line in lines if line.strip()]
