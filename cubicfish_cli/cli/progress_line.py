"""The line itself: what is done, a bar, and the time that is left or has gone by."""

from __future__ import annotations

import time
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

from cubicfish_cli.cli.streams import as_shown, cells, cut_middle, safe

_BAR = (8, 30)
_LONGEST = 40  # cells of our own words, which are not cut to make room for a bar
_TAIL = (16, 22)  # cells of counts and times, on a narrow terminal and on others
# Blanks and the spinner; and the ^C that a terminal echoes must not begin a second line.
_GAPS = 5 + 3
# The time left is not guessed before so much of it has been measured.
_FIRST_GUESS_SECONDS = 2.0
_FIRST_GUESS_SHARE = 0.05


class ProgressLine:
    """A line of progress on a terminal.

    Args:
        label: what is done.
        stream: the terminal.

    """

    def __init__(self, label: str, stream: TextIO) -> None:
        console = Console(file=stream, highlight=False, markup=False, emoji=False)
        self._stream = stream
        self._started = time.monotonic()
        columns = console.width
        bar = min(_BAR[1], columns - _LONGEST - _TAIL[True] - _GAPS)
        bar = bar if bar >= _BAR[0] else 0
        tail = _TAIL[bar > 0]
        bars = [BarColumn(bar_width=bar, complete_style="cyan", finished_style="cyan")]
        self._progress = Progress(
            SpinnerColumn("line" if console.options.ascii_only else "dots", style="cyan"),
            TextColumn("{task.description}", markup=False),
            *(bars if bar else []),
            _Tail(self._started, tail),
            console=console,
            transient=True,
            redirect_stdout=False,
        )
        self._room = max(8, columns - bar - tail - _GAPS)
        self._widest = 0
        self._task = self._progress.add_task(self._cut(label), total=None, counts="")
        self._shown = False

    def show(self) -> None:
        """Draw it from now on."""
        self._shown = True
        self._progress.start()

    def count(self, done: int, total: int) -> None:
        """So many are done, of so many; 0 where that is not known."""
        self._update(
            done / total if total else None, f"{done:,}/{total:,}" if total else f"{done:,}"
        )

    def stage(self, words: str, share: float) -> None:
        """What is done now, and the share of everything that was done before it."""
        self._update(share, f"{100 * share:.0f} %", self._cut(words[:1].upper() + words[1:]))

    def close(self) -> None:
        """Wipe it away."""
        if self._shown:
            self._progress.stop()

    def _update(self, share: float | None, counts: str, words: str | None = None) -> None:
        left = None
        gone = time.monotonic() - self._started
        if share and share >= _FIRST_GUESS_SHARE and gone >= _FIRST_GUESS_SECONDS:
            left = gone * (1 - share) / share
        self._progress.update(
            self._task,
            completed=share or 0.0,
            total=None if share is None else 1.0,
            description=words,
            counts=counts,
            ends=None if left is None else time.monotonic() + left,
        )

    def _cut(self, label: str) -> str:
        shown = as_shown(safe(label), self._stream)
        shown = cut_middle(shown, self._room, as_shown("…", self._stream))
        self._widest = max(self._widest, cells(shown))
        return shown + " " * (self._widest - cells(shown))


class _Tail(ProgressColumn):
    """Counts and times, as wide as they ever become: nothing jumps."""

    max_refresh = None

    def __init__(self, started: float, width: int) -> None:
        super().__init__()
        self._started = started
        self._width = width

    def render(self, task: Task) -> Text:
        ends, now = task.fields.get("ends"), time.monotonic()
        # A guess that has run out was wrong: then the time gone by is what is known.
        if ends is not None and ends > now:
            clock = f"{_clock(ends - now)} left"
        else:
            clock = _clock(now - self._started)
        words = f"{task.fields['counts']}  {clock}".strip()
        return Text(words + " " * max(0, self._width - cells(words)), no_wrap=True)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
