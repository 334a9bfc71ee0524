"""Processes of this machine that work on photos, with results in order however many they are.

Loaded only where there are several: what they need of the standard library takes a while.
"""

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
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from typing import TypeVar

import cv2

from cubicfish.errors import DetectionError

Item = TypeVar("Item")
Answer = TypeVar("Answer")

# How a process ends that cannot even begin, as Python does where it raises.
_CANNOT_BEGIN = 1
# Signals that ask for the end of a run, where there are such.
_REQUESTS = {
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}


def by_processes(
    work: Callable[[Item], Answer], items: Sequence[Item], workers: int
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
