"""Process pool over photos, with results in order whatever the number of processes."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from typing import Protocol, TypeVar

import cv2

from cubicfish.errors import ClusterError, CubicfishError, DetectionError
from cubicfish.photos.photos import one_opencv_thread

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Something that does the same work on many items, such as a cluster."""

    def each(
        self, work: Callable[[Item], Answer], items: Sequence[Item]
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do ``work`` on every item and yield (number of the item, answer) as they are done.

        A :class:`CubicfishError` that ``work`` raises is an answer. An item may be worked on more
        than once, where a machine is lost before it has answered: work that writes must be able
        to replace what it wrote before.

        Args:
            work: a function of a module, or a partial one, that can be pickled. It is unpickled
                once in each process, so what it keeps serves many items.
            items: what can be pickled too; their paths are absolute.

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
# How a process ends that cannot even begin, as Python does where it raises.
_CANNOT_BEGIN = 1
# Signals that ask for the end of a run, where there are such.
_REQUESTS = {
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}


def workers_for(jobs: int | None, items: int) -> int:
    """How many processes to use: ``jobs``, or one per processor where there is work for them."""
    if jobs is None:
        if items < _ITEMS_FOR_POOL:
            return 1
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs or 1, items))


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
        """Answer ``work`` of every item, in their order, whoever does it; both can be pickled.

        OpenCV runs one thread in each process.

        Raises:
            DetectionError: a process was ended from outside.
            CubicfishError: what ``work`` raises; the executor cannot do it.

        """
        workers = workers_for(self.jobs, len(items))
        answers: dict[int, Answer] = {}
        with one_opencv_thread():
            found: Iterator[tuple[int, Answer | CubicfishError]] = enumerate(map(work, items))
            if self.executor is not None:
                found = self.executor.each(work, items)
            elif workers > 1:
                found = enumerate(by_processes(work, items, workers))
            for number, answer in found:
                if isinstance(answer, ClusterError):
                    raise ClusterError(f"{items[number].name}: {answer}") from answer
                if isinstance(answer, CubicfishError):
                    raise answer
                answers[number] = answer
                self.progress(len(answers), len(items))
        return [answers[number] for number in range(len(items))]


def by_processes(
    work: Callable[[Photo], Answer], items: Sequence[Photo], workers: int
) -> Iterator[Answer]:
    """Yield the answers in order; leaving early waits for what is being worked on.

    Raises:
        DetectionError: a process was ended from outside, or could not load the caller's script.

    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # A script that begins its work as it is loaded is loaded here again, and begins again:
        # the process that it was begun in tells.
        sys.exit(_CANNOT_BEGIN)
    # A forked copy of a process whose OpenCV has threads may hang: processes are made anew.
    others, processes = {*multiprocessing.active_children()}, set[BaseProcess]()
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin)
    try:
        with _hold_signals_back():
            answers = deque(pool.submit(work, item) for item in items)
        processes = {*multiprocessing.active_children()} - others
        while answers:
            yield answers.popleft().result()
    except BrokenProcessPool as error:
        pool.shutdown(cancel_futures=True)
        # By a signal the code would be less than zero.
        if any((process.exitcode or 0) > 0 for process in processes):
            raise DetectionError(
                "the processes that look for corners load your script again, and it does its work "
                "as it is loaded: put the work below 'if __name__ == \"__main__\":', or pass jobs=1"
            ) from error
        raise DetectionError(
            "a process that looked for corners was ended from outside, as happens when memory "
            "runs out",
            do="try again with {jobs}",
            arguments={"jobs": "jobs=1"},
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _hold_signals_back() -> Iterator[None]:
    """Block signals while processes are started: cut off, or while they load, they complain."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # starting it later would let them through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _REQUESTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Begin a process that works on photos, one thread in each."""
    # The parent alone answers Ctrl-C, and the workers together use one thread a processor.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _REQUESTS)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A parent that is killed cannot tell its workers to end: they would do what they do."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
