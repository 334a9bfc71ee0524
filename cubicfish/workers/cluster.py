"""Executor on a dask cluster: each photo is a task.

The work travels once to each process, a photo's path with each task, and what comes back is
small: photos and pictures themselves stay on a file system that all machines share.
"""

import asyncio
import concurrent.futures
import logging
import pickle
import platform
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any

import cv2
import numpy as np

from cubicfish import __version__
from cubicfish.errors import ClusterError, CubicfishError
from cubicfish.files.whole_files import working_on
from cubicfish.photos.photos import one_opencv_thread
from cubicfish.wording import shown
from cubicfish.workers.pool import Answer, Item

CANCELLED = (concurrent.futures.CancelledError, asyncio.CancelledError)
"""What becomes of a task whose scheduler is gone."""
WAIT_S = 60.0
"""How long to wait for a worker where there is none."""

# A scheduler that is there answers within milliseconds.
_CONNECT_S, _SLACK_S, _CLOSE_S = 5.0, 1.0, 5.0
_POLL_S, _LOOK_S = 1.0, 0.01


def versions_here() -> dict[str, str]:
    """The versions that decide what comes out to the last digit, by name."""
    return {"cubicfish": __version__, "OpenCV": cv2.__version__, "numpy": np.__version__}


def do_one(work: Callable[[Any], Any], versions: Mapping[str, str], item: Any) -> tuple[Any]:
    """Run on a worker: the work on one item, or what is wrong with that item.

    The answer is in a tuple of one, by which it is told from what became of a task that failed.
    """
    host = platform.node()
    for name, has in versions_here().items():
        if has != versions[name]:
            raise ClusterError(
                f"a worker on {host} has {name} {has} and this machine has {versions[name]}, whose "
                "results may differ: install the same version"
            )
    with one_opencv_thread(), working_on(host):
        try:
            return (work(item),)
        except CubicfishError as error:
            return (error,)


class Cluster:
    """The workers of a scheduler; see :class:`cubicfish.workers.pool.Executor`."""

    def __init__(self, client: Any, address: str, wait_s: float) -> None:
        """Use a ``distributed.Client`` that is connected to ``address``."""
        self._client, self._address, self._wait_s = client, address, wait_s
        self._polled = self._seen = time.monotonic()
        self.workers = self.threads = 0

    def ask(self, so_far: str = "") -> int:
        """Learn how many workers there are; not to have one for too long is an error."""
        try:
            threads = self._client.nthreads().values()
        except (OSError, RuntimeError, concurrent.futures.TimeoutError, *CANCELLED) as problem:
            raise self._explain_loss(so_far) from problem
        self.workers, self.threads = len(threads), sum(threads)
        self._polled = time.monotonic()
        if self.workers:
            self._seen = self._polled
        elif self._polled > self._seen + self._wait_s:
            raise ClusterError(
                f"{self._address} has had no worker for {self._wait_s:g} s{so_far}: start some "
                f"with 'dask worker {self._address}' and run this again"
            )
        return self.workers

    def each(
        self, work: Callable[[Item], Answer], items: Sequence[Item]
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do the work on every item; see :meth:`cubicfish.workers.pool.Executor.each`.

        A task is done again elsewhere when its worker is lost. An item that ends several workers
        one after the other gets a :class:`ClusterError` for an answer.

        Raises:
            ClusterError: the scheduler or all workers are lost, or a worker has other versions.

        """
        from distributed import as_completed

        # The answer of a task, unlike data that is scattered, is made again when it is lost.
        kept = self._client.submit(pickle.loads, pickle.dumps(work), pure=False)
        every = len(items)
        versions = [versions_here()] * every
        futures = self._client.map(do_one, [kept] * every, versions, items, pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        # It fetches answers on its own thread: one that is lost with its worker may never come.
        finished = as_completed(
            futures, loop=self._client.loop, with_results=True, raise_errors=False
        )
        so_far = ""
        try:
            while numbers:
                so_far = f" ({every - len(numbers)} of {every} done)"
                if time.monotonic() > self._polled + _POLL_S:
                    self.ask(so_far)
                some = finished.next_batch(block=False)
                if not some:
                    time.sleep(_LOOK_S)
                for future, outcome in some:
                    # Its status may have changed since: answers are lost with their workers.
                    if isinstance(outcome, tuple) and len(outcome) == 1:
                        answer = outcome[0]
                    else:  # of what failed: its type, the exception and its traceback
                        why = outcome if isinstance(outcome, BaseException) else outcome[1]
                        answer = self._explain_failure(why, so_far)
                    yield numbers.pop(future), answer
        except CANCELLED as problem:
            raise self._explain_loss(so_far) from problem

    def _explain_failure(self, problem: BaseException, so_far: str) -> ClusterError:
        """What became of a task that gave no answer, where the others may go on."""
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        if isinstance(problem, CommClosedError):
            raise self._explain_loss(so_far) from problem
        if isinstance(problem, KilledWorker):
            return ClusterError(
                "each worker that tried it was ended from outside, as happens when memory runs "
                "out: give the workers more memory or fewer threads"
            )
        # The scheduler says what it cannot load by a RuntimeError.
        if isinstance(problem, (ImportError, RuntimeError)):
            raise ClusterError(
                f"a worker or the scheduler cannot load cubicfish ({problem}): install cubicfish "
                f"{__version__} there as it is here"
            ) from problem
        raise problem

    def _explain_loss(self, so_far: str) -> ClusterError:
        return ClusterError(
            f"the scheduler at {self._address} does not answer any more{so_far}: start it and its "
            "workers, and run this again"
        )


@contextmanager
def connect(address: str, *, wait_s: float = WAIT_S) -> Iterator[Cluster]:
    """Reach a scheduler and wait for a worker; on leaving, what has not begun is cancelled.

    Args:
        address: such as ``tcp://host:8786``. Whoever runs the scheduler can run anything here.
        wait_s: how long to wait, now and later, while there is no worker.

    Raises:
        ClusterError: dask is missing here, nobody answers, or no worker comes.

    """
    try:
        from distributed import Client
    except ImportError as problem:
        raise ClusterError(
            f"a scheduler needs dask ({problem}): pip install 'cubicfish[scale]'"
        ) from problem
    with ExitStack() as stack:
        # What goes wrong is said once, by an error: dask's own log goes nowhere meanwhile.
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)
        stack.enter_context(warnings.catch_warnings())
        # It compares versions too, of more than what matters here.
        warnings.filterwarnings("ignore", message="Mismatched versions found")

        class QuietClient(Client):  # type: ignore[misc]
            """One that fails to connect would try to close, for seconds, and print a traceback."""

            def __del__(self) -> None:
                pass

        connect = partial(
            QuietClient, address, timeout=_CONNECT_S, set_as_default=False, name="cubicfish"
        )
        try:
            client = _call_within(_CONNECT_S + _SLACK_S, connect)
        except Exception as problem:  # whatever the other side does not understand
            words = " ".join(str(problem).split()) or "it is silent"
            raise ClusterError(
                f"no scheduler answers at {shown(address) or repr(address)} ({words}): is "
                "'dask scheduler' of this version running there, and is this its address?"
            ) from problem
        stack.callback(_close, client)
        cluster = Cluster(client, shown(address), wait_s)
        while not cluster.ask():
            time.sleep(min(_POLL_S, wait_s) / 5)
        yield cluster


def _close(client: Any) -> None:
    with suppress(OSError, RuntimeError, *CANCELLED):
        client.close(timeout=_CLOSE_S)


def _call_within(limit_s: float, start: Callable[[], Any]) -> Any:
    """Call a function that may never return, as where something else listens.

    Raises:
        TimeoutError: it did not return in time.

    """
    outcome: concurrent.futures.Future[Any] = concurrent.futures.Future()

    def run() -> None:
        try:
            outcome.set_result(start())
        except Exception as problem:
            outcome.set_exception(problem)

    threading.Thread(target=run, daemon=True).start()
    return outcome.result(limit_s)
