"""Process pool over photos, with results in order whatever the number of processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any, Protocol, TypeVar

import cv2
import numpy as np

from cubicfish_cli.app.photos import one_opencv_thread
from cubicfish_cli.core.errors import ClusterError, CubicfishError, DetectionError
from cubicfish_cli.core.types import FloatArray

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Something that does the same work on many items, such as a cluster."""

    def each(
        self,
        work: Callable[[Item], Answer],
        items: Sequence[Item],
        *,
        writes_below: Path | None = None,
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do ``work`` on every item and yield (number of the item, answer) as they are done.

        A :class:`CubicfishError` that ``work`` raises is an answer. An item may be worked on more
        than once, where a machine is lost before it has answered: work that writes must be able
        to replace what it wrote before.

        Args:
            work: a function of a module, or a partial one, that can be pickled. It is unpickled
                once in each process, so what it keeps serves many items.
            items: what can be pickled too; their paths are absolute.
            writes_below: the folder that the work writes into; the executor must have the same.

        Raises:
            CubicfishError: the work cannot be done there at all.

        """
        ...


class _Named(Protocol):
    @property
    def name(self) -> str:
        """What messages call it."""
        ...


Photo = TypeVar("Photo", bound=_Named)

# Fewer photos than this are not worth starting other processes for.
_ITEMS_FOR_POOL = 4
# Positions are rounded to this many digits of a pixel, far below any noise: their last bits
# depend on how memory happens to be aligned, and no result may depend on the processes used.
_DIGITS = 5
# The longest name that a socket can have on every system; Linux has a few bytes more.
_SOCKET_BYTES = 103


def settled(pixel: FloatArray) -> FloatArray:
    """Pixels without the digits that differ from one process to another."""
    return np.asarray(np.round(pixel, _DIGITS))


def workers_for(jobs: int | None, items: int) -> int:
    """How many processes to use: ``jobs``, or one per processor where there is work for them."""
    if jobs is None:
        if items < _ITEMS_FOR_POOL:
            return 1
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs or 1, items))


def map_photos(
    work: Callable[[Photo], Answer],
    items: Sequence[Photo],
    workers: int,
    executor: Executor | None = None,
) -> Iterator[Answer]:
    """Yield ``work`` of every item, in order, whatever ``workers`` is.

    OpenCV runs one thread in each process.

    Args:
        work: picklable.
        items: picklable.
        workers: processes to use.
        executor: who does the work instead of this machine's processes.

    Raises:
        DetectionError: a process was ended from outside.
        CubicfishError: what ``work`` raises; the executor cannot do it.

    """
    if executor is not None:
        yield from _by_machines(work, items, executor)
        return
    if workers == 1:
        with one_opencv_thread():
            yield from map(work, items)
        return
    yield from _by_processes(work, items, workers)


@dataclass(frozen=True, kw_only=True)
class Work:
    """Who looks at many photos, and who hears how far that is.

    Attributes:
        jobs: processes to use; None for one per processor.
        progress: called with items done and all items.
        executor: who does it instead of processes here.

    """

    jobs: int | None = None
    progress: Callable[[int, int], None] = lambda done, total: None
    executor: Executor | None = None

    def done(self, work: Callable[[Photo], Answer], items: Sequence[Photo]) -> list[Answer]:
        """The answers of :func:`map_photos`."""
        answers: list[Answer] = []
        for answer in map_photos(work, items, workers_for(self.jobs, len(items)), self.executor):
            answers.append(answer)
            self.progress(len(answers), len(items))
        return answers


def _by_machines(
    work: Callable[[Photo], Answer], items: Sequence[Photo], executor: Executor
) -> Iterator[Answer]:
    def good() -> Iterator[tuple[int, Answer]]:
        for number, answer in executor.each(work, items):
            if isinstance(answer, ClusterError):
                raise ClusterError(f"{items[number].name}: {answer}") from answer
            if isinstance(answer, CubicfishError):
                raise answer
            yield number, answer

    yield from _in_order(good())


def _in_order(answers: Iterator[tuple[int, Answer]]) -> Iterator[Answer]:
    early: dict[int, Answer] = {}
    wanted = 0
    for number, answer in answers:
        early[number] = answer
        while wanted in early:
            yield early.pop(wanted)
            wanted += 1


def _context() -> BaseContext:
    """How worker processes are made.

    A forked copy of a process whose OpenCV has threads may hang. Copies of a server that has the
    libraries loaded and has run nothing do not, and start at once.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods() or _too_long_for_a_server():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    looks = ("corners.detection.look", "corners.identification.second_pass")
    context.set_forkserver_preload([f"cubicfish_cli.{look}" for look in looks])
    _start_server()
    return context


def _start_server() -> None:
    """Start it with Ctrl-C held back, which would end it with a traceback while it loads."""
    from multiprocessing import resource_tracker
    from multiprocessing.forkserver import ensure_running

    # The server starts the tracker first, and starting that lets Ctrl-C through again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _too_long_for_a_server() -> bool:
    """Whether a server's socket has no place: it stands where temporary files do."""
    socket = os.path.join(tempfile.gettempdir(), "pymp-12345678", "listener-12345678")
    return len(os.fsencode(socket)) > _SOCKET_BYTES


# Signals that ask for the end of a run, where there are such.
_REQUESTS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


def _by_processes(
    work: Callable[[Photo], Answer], items: Sequence[Photo], workers: int
) -> Iterator[Answer]:
    """Leaving early waits for what is being worked on."""
    pool = ProcessPoolExecutor(workers, _context(), _begin)
    try:
        with _requests_held_back():
            answers = deque(pool.submit(work, item) for item in items)
        while answers:
            yield answers.popleft().result()
    except BrokenProcessPool as error:
        raise DetectionError(
            "a process that looked for corners was ended from outside, as happens when memory "
            "runs out: try again with --jobs 1"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Begin a process that works on photos, one thread in each."""
    # The parent alone answers Ctrl-C, and the workers together use one thread a processor.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


@contextmanager
def _requests_held_back() -> Iterator[None]:
    """Block signals while the forkserver starts a worker: cut off, it complains at length."""
    came: list[int] = []
    before: dict[int, Any] = {}
    # Only the main thread may set handlers, and only there they are called.
    ours = threading.current_thread() is threading.main_thread()
    try:
        for number in _REQUESTS if ours else ():
            if callable(signal.getsignal(number)):
                before[number] = signal.getsignal(number)
                signal.signal(number, lambda one, frame: came.append(one))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def _end_with_parent() -> None:
    """A parent that is killed cannot tell its workers to end: they would do what they do."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
