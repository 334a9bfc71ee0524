"""Process pool over photos, with results in order whatever the number of processes."""

from __future__ import annotations

import multiprocessing
import multiprocessing.context
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

import numpy as np

from cubicfish_cli.errors import ClusterError, CubicfishError
from cubicfish_cli.executors.executor import Executor
from cubicfish_cli.executors.processes import each_by_processes
from cubicfish_cli.photos import one_opencv_thread
from cubicfish_cli.types import FloatArray


class _Named(Protocol):
    @property
    def name(self) -> str:
        """What messages call it."""
        ...


Item = TypeVar("Item", bound=_Named)
Answer = TypeVar("Answer")

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
    work: Callable[[Item], Answer],
    items: Sequence[Item],
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
    yield from _in_order(each_by_processes(work, items, workers, _context()))


def photos_done(
    work: Callable[[Item], Answer],
    items: Sequence[Item],
    *,
    jobs: int | None,
    progress: Callable[[int, int], None] | None,
    executor: Executor | None = None,
) -> list[Answer]:
    """The answers of :func:`map_photos`.

    Args:
        work: as there.
        items: as there.
        jobs: processes to use; None for one per processor.
        progress: called with items done and all items.
        executor: as there.

    """
    answers: list[Answer] = []
    for answer in map_photos(work, items, workers_for(jobs, len(items)), executor):
        answers.append(answer)
        if progress is not None:
            progress(len(answers), len(items))
    return answers


def _by_machines(
    work: Callable[[Item], Answer], items: Sequence[Item], executor: Executor
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


def _context() -> multiprocessing.context.BaseContext:
    """How worker processes are made.

    A forked copy of a process whose OpenCV has threads may hang. Copies of a server that has the
    libraries loaded and has run nothing do not, and start at once.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods() or _too_long_for_a_server():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    looks = ("detection.look", "identification.second_pass")
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
