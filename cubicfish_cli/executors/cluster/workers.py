"""Dask workers: checking that they can do the work, and handing it out."""

from __future__ import annotations

import asyncio
import concurrent.futures
import pickle
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from cubicfish_cli.errors import ClusterError, CubicfishError
from cubicfish_cli.executors.cluster.patience import within
from cubicfish_cli.executors.cluster.tasks import order, task
from cubicfish_cli.executors.cluster.versions import DECISIVE, asker, compare, versions_here

Item = TypeVar("Item")
Answer = TypeVar("Answer")

CANCELLED = (concurrent.futures.CancelledError, asyncio.CancelledError)
"""What becomes of a task whose scheduler is gone."""

_ANSWER_S = 15.0
_POLL_S = 1.0
# Enough that no worker waits for the network, few enough that the scheduler does not notice.
_TASKS_A_THREAD = 4


class Cluster:
    """The workers of a scheduler; see :class:`cubicfish_cli.executors.executor.Executor`."""

    def __init__(self, client: Any, address: str, wait_s: float) -> None:
        """Use a ``distributed.Client`` that is connected to ``address``."""
        self._client, self._address, self._wait_s = client, address, wait_s
        self._workers: Mapping[str, int] = {}
        self._asked = self._seen = time.monotonic()

    @property
    def workers(self) -> int:
        """How many workers there were when last asked."""
        return len(self._workers)

    @property
    def threads(self) -> int:
        """How many threads they have together."""
        return sum(self._workers.values())

    def wait_for_worker(self) -> None:
        """Return when there is a worker.

        Raises:
            ClusterError: none came in time.

        """
        self._ask()
        while not self._workers:
            time.sleep(min(_POLL_S, self._wait_s) / 5)
            self._ask()

    def check_versions(self) -> None:
        """Raise :class:`ClusterError` when a worker cannot do what is done here, just so."""
        versions = self._asked_all(self._client.get_versions)
        here = versions["client"]["packages"]
        for address, worker in versions["workers"].items():
            # Functions that travel hold code for one minor version of Python.
            theirs, ours = (_minor(each["python"]) for each in (worker["packages"], here))
            compare({"Python": theirs}, {"Python": ours}, f"worker {address}")
        found = self._asked_all(self._client.run, asker(), DECISIVE, on_error="return")
        mine = versions_here()
        for address, theirs in found.items():
            if isinstance(theirs, BaseException):
                raise ClusterError(
                    f"worker {address} cannot say what it has ({theirs}): start it in an "
                    "environment like this one"
                ) from theirs
            host, has = theirs
            compare(has, mine, f"worker {address} on {host}")

    def _asked_all(self, ask: Callable[..., Any], *args: Any, **options: Any) -> Any:
        try:
            return within(_ANSWER_S, partial(ask, *args, **options))
        except TimeoutError as problem:
            raise self._silent() from problem
        except (OSError, RuntimeError, *CANCELLED) as problem:
            raise self._lost() from problem

    def _silent(self) -> ClusterError:
        """Name the workers that the scheduler has not heard of for long: stopped processes."""
        known = self._client.scheduler_info(n_workers=-1)["workers"]
        last = max((worker["last_seen"] for worker in known.values()), default=0.0)
        names = [name for name, one in known.items() if one["last_seen"] < last - _ANSWER_S / 2]
        return ClusterError(
            f"{', '.join(names) or 'a worker'} has not answered for {_ANSWER_S:g} s: let it go on, "
            "or end it, and run this again"
        )

    def each(
        self,
        work: Callable[[Item], Answer],
        items: Sequence[Item],
        *,
        writes_below: Path | None = None,
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do the work on every item; see :meth:`cubicfish_cli.executors.executor.Executor.each`.

        A task is done again elsewhere when its worker is lost. An item that ends several workers
        one after the other gets a :class:`ClusterError` for an answer.

        Raises:
            ClusterError: the scheduler or all workers are lost, a worker that joined has other
                versions, or does not see the folder.

        """
        with order(work, writes_below) as wanted:
            yield from self._each(wanted, items)

    def _each(
        self, wanted: bytes, items: Sequence[Item]
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        # The answer of a task, unlike data that is scattered, is made again when it is lost.
        kept = self._client.submit(bytes, wanted, pure=False)
        numbers = iter(range(len(items)))
        pending: dict[str, tuple[int, Any]] = {}
        finished: SimpleQueue[Any] = SimpleQueue()
        answers: SimpleQueue[list[tuple[str, Any, BaseException | None]]] = SimpleQueue()
        collector = threading.Thread(
            target=_collect, args=(self._client, finished, answers), daemon=True
        )
        collector.start()
        done, so_far = 0, ""
        try:
            while done < len(items):
                so_far = f" ({done} of {len(items)} done)"
                if time.monotonic() > self._asked + _POLL_S:
                    self._ask(so_far)
                room = max(1, _TASKS_A_THREAD * self.threads) - len(pending)
                batch = list(islice(numbers, max(0, room)))
                if batch:
                    chosen = [pickle.dumps(items[number]) for number in batch]
                    futures = self._client.map(task(), [kept] * len(batch), chosen, pure=False)
                    for number, future in zip(batch, futures, strict=True):
                        pending[future.key] = (number, future)
                        future.add_done_callback(finished.put)
                try:
                    some = answers.get(timeout=_POLL_S)
                except Empty:
                    continue
                for key, answer, problem in some:
                    number, _ = pending.pop(key)
                    done += 1
                    yield number, answer if problem is None else self._explained(problem, so_far)
        except CANCELLED as problem:
            raise self._lost(so_far) from problem
        finally:
            finished.put(None)

    def _explained(self, problem: BaseException, so_far: str) -> ClusterError:
        """What became of a task that gave no answer, where the others may go on."""
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        if isinstance(problem, CommClosedError):
            raise self._lost(so_far) from problem
        if isinstance(problem, KilledWorker):
            return ClusterError(
                "each worker that tried it was ended from outside, as happens when memory runs "
                "out: give the workers more memory or fewer threads"
            )
        if isinstance(problem, ImportError):
            raise ClusterError(
                f"a worker cannot load cubicfish ({problem}): install it there as it is here"
            ) from problem
        raise problem

    def _ask(self, so_far: str = "") -> None:
        """Learn which workers there are; not to have one for too long is an error."""
        try:
            ask = self._client.scheduler.ncores
            self._workers = self._client.sync(ask, workers=None, callback_timeout=_ANSWER_S)
        except (OSError, RuntimeError, concurrent.futures.TimeoutError, *CANCELLED) as problem:
            raise self._lost(so_far) from problem
        self._asked = time.monotonic()
        if self._workers:
            self._seen = self._asked
        elif self._asked > self._seen + self._wait_s:
            raise ClusterError(
                f"{self._address} has had no worker for {self._wait_s:g} s{so_far}: start some "
                f"with 'dask worker {self._address}' and run this again"
            )

    def _lost(self, so_far: str = "") -> ClusterError:
        return ClusterError(
            f"the scheduler at {self._address} does not answer any more{so_far}: start it and its "
            "workers, and run this again"
        )


def _collect(
    client: Any,
    finished: SimpleQueue[Any],
    answers: SimpleQueue[list[tuple[str, Any, BaseException | None]]],
) -> None:
    """Fetch the answers of finished tasks, many at a time, until None comes."""
    while (first := finished.get()) is not None:
        batch = [first]
        with suppress(Empty):
            while (more := finished.get_nowait()) is not None:
                batch.append(more)
            return
        try:
            found = client.gather(batch)
            answers.put([(f.key, one, None) for f, one in zip(batch, found, strict=True)])
        except BaseException:  # of one of them: whose is it?
            answers.put([_answer(future) for future in batch])


def _answer(future: Any) -> tuple[str, Any, BaseException | None]:
    try:
        return future.key, future.result(), None
    except BaseException as problem:
        return future.key, None, problem


def _minor(python: str) -> str:
    return ".".join(python.split(".")[:2])
