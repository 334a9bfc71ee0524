"""The real program, in an environment of which nothing lies outside one folder."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

PROGRAM = (str(Path(sys.executable).with_name("cubicfish")),)
# A command that takes longer than this hangs.
LONGEST_S = 300.0
SCHEDULER = "{scheduler}"
"""Stands for the scheduler's address, which ``scheduler.txt`` of the working folder holds."""


def environment(folder: Path) -> dict[str, str]:
    """A user's environment of which nothing lies outside ``folder``."""
    return {
        **{key: value for key, value in os.environ.items() if not key.startswith("CUBICFISH_")},
        "HOME": str(folder / "home"),
        "XDG_CACHE_HOME": str(folder / "cache"),
        "TMPDIR": str(folder / "tmp"),
        "MPLCONFIGDIR": str(folder / "fonts"),
        "SOURCE_DATE_EPOCH": "1700000000",
        "OMP_NUM_THREADS": "1",
    }


def start_program(args: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
    """Start the program in a session of its own; what it prints goes to two files."""
    if SCHEDULER in args:
        address = (folder / "scheduler.txt").read_text()
        args = [address if one == SCHEDULER else one for one in args]
    with (folder / "said.txt").open("wb") as said, (folder / "printed.txt").open("wb") as printed:
        return subprocess.Popen(
            [*PROGRAM, *args],
            cwd=folder,
            env=environment(folder),
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=said,
            start_new_session=True,
            preexec_fn=_hear_interrupts,
        )


def _hear_interrupts() -> None:
    """Ctrl-C counts for the program, also where this one was started so as to be deaf to it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def said(folder: Path) -> str:
    """What the last run said, on stderr."""
    return (folder / "said.txt").read_text(errors="replace")


def printed(folder: Path) -> str:
    """What the last run printed, on stdout."""
    return (folder / "printed.txt").read_text(errors="replace")
