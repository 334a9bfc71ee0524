"""Worker processes, each behind its own pipe.

They share no queue and no lock, unlike those of :mod:`concurrent.futures`: one that is killed,
also while it sends an answer, leaves nothing behind that anybody waits for.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

import cv2

from cubicfish_cli.errors import DetectionError

Item = TypeVar("Item")
Answer = TypeVar("Answer")

# Signals that ask for the end of a run, where there are such.
_REQUESTS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


def each_by_processes(
    work: Callable[[Item], Answer], items: Sequence[Item], workers: int, context: BaseContext
) -> Iterator[tuple[int, Answer]]:
    """Yield (number of the item, ``work`` of it) of every item, as they are done.

    Leaving early waits for what is being worked on.

    Args:
        work: picklable.
        items: picklable.
        workers: how many processes to use.
        context: how they are made.

    Raises:
        DetectionError: a process was ended from outside.
        Exception: what ``work`` raises.

    """
    processes: list[BaseProcess] = []
    pipes: list[Connection] = []
    doing: dict[Connection, int] = {}
    numbers = iter(range(len(items)))

    def go_on(pipe: Connection) -> None:
        number = next(numbers, None)
        if number is not None:
            pipe.send(items[number])
            doing[pipe] = number

    try:
        for _ in range(workers):
            with _told():
                with _requests_held_back():
                    pipes.append(_start(work, context, processes))
                go_on(pipes[-1])
        while doing:
            for pipe in wait(list(doing)):
                assert isinstance(pipe, Connection)
                with _told():
                    problem, answer = pipe.recv()
                    number = doing.pop(pipe)
                    go_on(pipe)
                if problem is not None:
                    raise problem
                yield number, answer
    finally:
        for pipe in pipes:
            pipe.close()  # says that there is no more to do
        for process in processes:
            process.join()


def _start(
    work: Callable[[Any], Any], context: BaseContext, processes: list[BaseProcess]
) -> Connection:
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, work), daemon=True)  # type: ignore[attr-defined]
    process.start()
    processes.append(process)
    there.close()  # the process has its own: when it ends, this end knows
    return here


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


@contextmanager
def _told() -> Iterator[None]:
    """Say what it means that there is nobody at the other end."""
    try:
        yield
    except (EOFError, OSError) as error:
        raise DetectionError(
            "a process that looked for corners was ended from outside, as happens when memory "
            "runs out: try again with --jobs 1"
        ) from error


def _serve(pipe: Connection, work: Callable[[Any], Any]) -> None:
    """Run in a process of its own: work on what comes until no more does."""
    # The parent alone answers Ctrl-C, and the workers together use one thread a processor.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):  # the parent has no more to do
        while True:
            item = pipe.recv()
            answer = _answer(work, item)
            try:
                pipe.send(answer)
            except (TypeError, AttributeError, ValueError) as error:  # it cannot be pickled
                pipe.send((RuntimeError(f"{type(error).__name__}: {error}"), None))


def _answer(work: Callable[[Any], Any], item: Any) -> tuple[Exception | None, Any]:
    try:
        return None, work(item)
    except Exception as problem:
        problem.add_note(traceback.format_exc())  # of this process: --debug shows it
        return problem, None


def _end_with_parent() -> None:
    """A parent that is killed cannot tell its workers to end: they would do what they do."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
