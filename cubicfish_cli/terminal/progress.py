"""Listening to the library on the terminal: a line of progress, and what is reported below it.

The line is on stderr and leaves nothing behind; where stderr is no terminal, such as a file, there
is a line every few seconds.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from io import UnsupportedOperation
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread, Timer
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

import click

from cubicfish import Listener, Run, UsageError
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import (
    CAMERA_KEY,
    command_line,
    option,
    record,
    verbosity,
)
from cubicfish_cli.terminal.terminal import (
    ERRORS,
    as_shown,
    can_redraw,
    print_json,
    print_message,
    safe,
)
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Event as Told
    from cubicfish import Finding
    from cubicfish.workers import Executor


# What is done sooner shows no line: it would only flash.
_PATIENCE_SECONDS = 0.4
EVERY_SECONDS = 5.0
"""Where lines cannot be wiped away, one comes so often."""
# The ^C that a terminal echoes must not begin a second line.
_SPARE = 3
_BAR, _LEAST_FOR_BAR = 12, 80


class _Shown(Listener):
    """Shows steps one after the other, and prints what is reported between them."""

    def __init__(self) -> None:
        self._notes = click.get_current_context().meta
        self._step: str | None = None
        self._line: _Line | _Lines | None = None

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        if step != self._step:
            self.interrupt()
            self._step = step
            if verbosity() >= 0:
                self._line = _Line(step) if can_redraw(sys.stderr) else _Lines.of(step)
        if self._line is not None and (now or done or total):
            self._line.show(done, total, now)

    def tell(self, event: Told, **figures: Any) -> None:
        self.interrupt()
        if verbosity() < 0:
            return  # the words of all extensions are not loaded for what nobody reads
        from cubicfish_cli.words.sentences import render_event

        print_message(render_event(event, figures))

    def found(self, findings: Sequence[Finding]) -> None:
        self.interrupt()
        report_found(findings)

    def end(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the last step, by an error of a kind; a usage error is all that is said."""
        if kind is not None and issubclass(kind, UsageError | click.UsageError):
            self._notes.pop(CAMERA_KEY, None)
        self.interrupt()

    def interrupt(self) -> None:
        """Wipe the line away, and say once which camera is used."""
        if self._line is not None:
            self._line.close()
        self._step = self._line = None
        camera = self._notes.pop(CAMERA_KEY, None)
        if camera is not None:
            print_message(f"Camera: {camera}.")


class _Line:
    """A line of progress on stderr: what is done, a bar, the time gone by and what is left."""

    def __init__(self, step: str) -> None:
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        self._stream = _open_stderr()
        console = Console(file=self._stream, highlight=False, markup=False, emoji=False)
        roomy = console.width >= _LEAST_FOR_BAR
        console.width -= _SPARE
        words = Column(ratio=1, no_wrap=True, overflow="ellipsis")
        self._progress = progress.Progress(
            progress.SpinnerColumn("line" if console.options.ascii_only else "dots"),
            progress.TextColumn("{task.description}", markup=False, table_column=words),
            *([progress.BarColumn(_BAR)] if roomy else []),
            progress.TextColumn("{task.fields[counts]}"),
            progress.TimeElapsedColumn(),
            progress.TimeRemainingColumn(compact=True),
            console=console,
            transient=True,
            redirect_stdout=False,
            expand=True,
        )
        self._task = self._progress.add_task(_make_plain(step, self._stream), total=None, counts="")
        self._timer = Timer(_PATIENCE_SECONDS, self._progress.start)
        self._timer.daemon = True
        self._timer.start()

    def close(self) -> None:
        """Wipe it away."""
        self._timer.cancel()
        self._timer.join()
        self._progress.stop()
        self._stream.close()

    def show(self, done: float, total: float, now: str) -> None:
        """Show how much is done, as a listener hears it."""
        words = _make_plain(_capitalised(now), self._stream) if now else None
        counts = _count(done, total, now)
        self._progress.update(
            self._task, completed=done, total=total or None, description=words, counts=counts
        )


class _Lines:
    """Lines on stderr where it is no terminal, such as a file: what is done, every few seconds."""

    def __init__(self, step: str) -> None:
        self._stream, self._words, self._counts = _open_stderr(), step, ""
        self._ended, self._begun = Event(), monotonic()
        self._thread = Thread(target=self._tell, daemon=True)
        self._thread.start()

    @classmethod
    def of(cls, step: str) -> _Lines | None:
        """Begin a step; None where stderr is a program's own object."""
        with suppress(UnsupportedOperation):
            return cls(step)
        return None

    def close(self) -> None:
        """Say no more."""
        self._ended.set()
        self._thread.join()
        self._stream.close()

    def show(self, done: float, total: float, now: str) -> None:
        """Take down how much is done, as a listener hears it."""
        self._words = _capitalised(now) or self._words
        self._counts = _count(done, total, now)

    def _tell(self) -> None:
        while not self._ended.wait(EVERY_SECONDS):
            done = f": {self._counts}" if self._counts else ""
            line = f"{self._words}{done}, {monotonic() - self._begun:.0f} s"
            print(_make_plain(line, self._stream), file=self._stream, flush=True)


def _open_stderr() -> TextIO:
    """A descriptor of its own: decoders on other threads have theirs silenced meanwhile."""
    return os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding=sys.stderr.encoding, errors=ERRORS)


def _make_plain(words: str, stream: TextIO) -> str:
    return as_shown(safe(words), stream)


def _capitalised(words: str) -> str:
    return words[:1].upper() + words[1:]


def _count(done: float, total: float, now: str) -> str:
    if now:
        return f"{100 * done:.0f} %"
    return f"{done:,.0f}/{total:,.0f}" if total else f"{done:,.0f}"


def report_found(findings: Sequence[Finding], mark: str = "") -> None:
    """Report findings of photos; what several share once, unless all is wanted (``--verbose``).

    Args:
        findings: each about one photo.
        mark: how each line begins.

    """
    from cubicfish_cli.words.remarks import line_of, remark_lines

    for line in map(line_of, findings) if verbosity() > 0 else remark_lines(findings):
        print_message(mark + line)


def report_left_out(rejected: Mapping[str, Finding], of: str = "") -> None:
    """Say which photos took no part in a fit, and why; ``of`` says of which camera."""
    report_found(
        [replace(why, images=(photo,)) for photo, why in rejected.items()], f"left out: {of}"
    )


class _Cluster:
    """The workers of a scheduler, who are called when there is work: mistakes come first."""

    def __init__(self, address: str, listener: _Shown, stack: ExitStack) -> None:
        self._address, self._listener, self._stack = address, listener, stack
        self._there: Executor | None = None

    def each(self, work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        if self._there is None:
            from cubicfish.workers import connect

            self._listener.interrupt()
            self._there = there = self._stack.enter_context(connect(self._address))
            threads = plural(there.threads, "thread")
            print_message(
                f"Using {plural(there.workers, 'worker')} with {threads} at {self._address}."
            )
        return self._there.each(work, items)


@record
class How:
    """How a command does its work, and answers; each command has some of these options.

    ``max_rms`` is looked at by the commands themselves.
    """

    max_rms: float | None = parameters.max_rms_option
    overwrite: bool = parameters.overwrite_option
    as_json: bool = parameters.json_option
    jobs: int | None = parameters.jobs_option
    scheduler: str | None = option(
        "--scheduler ADDRESS",
        "Have the work done by the dask workers of tcp://HOST:8786, which must see the "
        "same files under the same names (a shared file system). Only use a scheduler that "
        "you trust. Needs pip install 'cubicfish[scale]'.",
    )
    no_cache: bool = parameters.no_cache_option

    def __post_init__(self) -> None:
        if self.scheduler is not None and self.jobs is not None:
            raise UsageError(
                "--jobs is for this machine: with --scheduler, 'dask worker --nthreads' says how "
                "many photos each worker does at a time"
            )

    @contextmanager
    def run(self) -> Iterator[Run]:
        """How a function does the work; what it tells is shown meanwhile."""
        cache, listener = cache_folder(), _Shown()
        if "MPLCONFIGDIR" not in os.environ:
            # By itself matplotlib makes two folders of its own in the user's home.
            fonts = None if cache is None or self.no_cache else cache / "matplotlib"
            os.environ["MPLCONFIGDIR"] = str(fonts or _make_temporary_folder())
        with ExitStack() as there:
            there.push(listener.end)
            executor = None if self.scheduler is None else _Cluster(self.scheduler, listener, there)
            yield Run(
                jobs=self.jobs,
                cache=cache,
                anew=self.no_cache,
                overwrite=self.overwrite,
                listener=listener,
                executor=executor,
                command=command_line(),
            )

    def print(self, made: Any) -> bool:
        """Print what was made as JSON where that is asked for; false where it is not."""
        if self.as_json:
            print_json(made.as_record())
        return self.as_json


def _make_temporary_folder() -> str:
    """A new folder that ends with the process."""
    folder = TemporaryDirectory(prefix="cubicfish-", ignore_cleanup_errors=True)
    atexit.register(folder.cleanup)
    return folder.name


def cache_folder() -> Path | None:
    """Where it is kept: CUBICFISH_CACHE, else the user's cache folder; None without a home."""
    named = os.environ.get("CUBICFISH_CACHE")
    if named:
        return Path(named).absolute()
    from platformdirs import user_cache_path

    # Nobody that this machine knows, as in some containers, has no home.
    try:
        folder = user_cache_path("cubicfish", appauthor=False)
    except RuntimeError:  # newer versions; older ones leave the ~
        return None
    return None if folder.parts[0] == "~" else folder.absolute()
