"""The line itself: what is done, a bar, the time gone by and the time that is left."""

from __future__ import annotations

from typing import TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

from cubicfish_cli.app.terminal.streams import as_shown, safe

# The ^C that a terminal echoes must not begin a second line.
_SPARE = 3
_BAR, _LEAST_FOR_BAR = 24, 100


class ProgressLine:
    """A line of progress on a terminal.

    Args:
        label: what is done.
        stream: the terminal.

    """

    def __init__(self, label: str, stream: TextIO) -> None:
        console = Console(file=stream, highlight=False, markup=False, emoji=False)
        roomy = console.width >= _LEAST_FOR_BAR
        console.width -= _SPARE
        self._stream = stream
        self._progress = Progress(
            SpinnerColumn("line" if console.options.ascii_only else "dots", style="cyan"),
            TextColumn(
                "{task.description}",
                markup=False,
                table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis"),
            ),
            *([BarColumn(_BAR, complete_style="cyan", finished_style="cyan")] if roomy else []),
            TextColumn("{task.fields[counts]}"),
            TimeElapsedColumn(),
            _Left(compact=True),
            console=console,
            transient=True,
            redirect_stdout=False,
            expand=True,
        )
        self._task = self._progress.add_task(self._plain(label), total=None, counts="")
        self._shown = False

    def show(self) -> None:
        """Draw it from now on."""
        self._shown = True
        self._progress.start()

    def count(self, done: int, total: int) -> None:
        """So many are done, of so many; 0 where that is not known."""
        counts = f"{done:,}/{total:,}" if total else f"{done:,}"
        self._progress.update(self._task, completed=done, total=total or None, counts=counts)

    def stage(self, words: str, share: float) -> None:
        """What is done now, and the share of everything that was done before it."""
        self._progress.update(
            self._task,
            completed=share,
            total=1.0,
            description=self._plain(words[:1].upper() + words[1:]),
            counts=f"{100 * share:.0f} %",
        )

    def close(self) -> None:
        """Wipe it away."""
        if self._shown:
            self._progress.stop()

    def _plain(self, label: str) -> str:
        return as_shown(safe(label), self._stream)


class _Left(TimeRemainingColumn):
    """The time that is left, as far as it can be guessed."""

    def render(self, task: Task) -> Text:
        left = super().render(task)
        return Text.assemble(left, " left") if left.plain.strip("-: ") else Text("")
