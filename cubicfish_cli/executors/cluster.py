"""Executor on a dask cluster: its workers are checked, and each photo is a task.

The work travels once to each process, a photo's path with each task, and what comes back is
small: photos and pictures themselves stay on a file system that all machines share. An order is
pickled as (versions, proof, pickled work): those who cannot do the work find out before they
unpickle it.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import importlib
import logging
import os
import pickle
import platform
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from cubicfish_cli.errors import ClusterError, CubicfishError
from cubicfish_cli.files import temporary_name, working_on, write_text
from cubicfish_cli.photos import one_opencv_thread, shown

DECISIVE = {"cubicfish": "cubicfish_cli", "OpenCV": "cv2", "numpy": "numpy"}
"""Name -> module; results may differ in their last digits from one version to another."""


def versions_here() -> dict[str, str]:
    """The versions that decide what comes out, by name."""
    versions: dict[str, str] = asker()(DECISIVE)[1]
    return versions


def asker() -> Callable[[Mapping[str, str]], tuple[str, dict[str, str]]]:
    """What asks a process for its versions, where this package may be missing.

    A function inside a function travels as code; a module's own travels as a name.
    """

    def ask(modules: Mapping[str, str]) -> tuple[str, dict[str, str]]:
        versions = {}
        for name, module in modules.items():
            try:
                versions[name] = str(importlib.import_module(module).__version__)
            except ImportError:
                versions[name] = ""
        return platform.node(), versions

    return ask


def compare(theirs: Mapping[str, str], mine: Mapping[str, str], who: str) -> None:
    """Raise :class:`ClusterError` when ``who`` lacks one of these, or has another version."""
    for name, version in mine.items():
        has = theirs.get(name, "")
        if not has:
            raise ClusterError(f"{who} has no {name}: install {name} {version} there as it is here")
        if has != version:
            raise ClusterError(
                f"{who} has {name} {has} and this machine has {version}, whose results may "
                "differ: install the same version"
            )


# Processes serve several runs one after the other; their maps are large.
_ORDERS_KEPT = 2


@contextmanager
def order(work: Callable[[Any], Any], writes_below: Path | None) -> Iterator[bytes]:
    """What asks for the work, while the block runs."""
    with _proof(writes_below) as proof:
        yield pickle.dumps((versions_here(), proof, pickle.dumps(work)))


@contextmanager
def _proof(folder: Path | None) -> Iterator[Path | None]:
    """A file in a folder, which is made if need be: who sees it sees the same folder."""
    if folder is None:
        yield None
        return
    folder = Path(os.path.abspath(folder))
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    path = temporary_name(folder / "cubicfish")
    try:
        write_text(path, "", overwrite=False)
        yield path
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
            for empty in made:
                empty.rmdir()


_orders: dict[bytes, Callable[[Any], Any]] = {}
_orders_lock = threading.Lock()


def _work_of(wanted: bytes) -> Callable[[Any], Any]:
    """The work that an order asks for, the same object for the same order."""
    with _orders_lock:
        work = _orders.get(wanted)
        if work is None:
            host = platform.node()
            versions, proof, pickled = pickle.loads(wanted)
            compare(versions_here(), versions, f"a worker on {host}")
            if proof is not None and not proof.exists():
                raise ClusterError(
                    f"a worker on {host} does not see the {shown(proof.parent)} of this machine: "
                    "all need the same folders, on a shared file system"
                )
            work = pickle.loads(pickled)
            while len(_orders) >= _ORDERS_KEPT:
                del _orders[next(iter(_orders))]
            _orders[wanted] = work
        return work


def do_one(wanted: bytes, item: bytes) -> Any:
    """Run on a worker: the work on one pickled item, or what is wrong with that item."""
    work = _work_of(wanted)
    with one_opencv_thread(), working_on(platform.node()):
        try:
            return work(pickle.loads(item))
        except CubicfishError as error:
            return error


def task() -> Callable[[bytes, bytes], tuple[Any]]:
    """What is sent as a task: like its arguments, a scheduler without this package can read it.

    It puts the answer into a tuple of one, by which it is told from what became of a task that
    failed.
    """

    def do(wanted: bytes, item: bytes) -> tuple[Any]:

        return (do_one(wanted, item),)

    return do


Item = TypeVar("Item")
Answer = TypeVar("Answer")

CANCELLED = (concurrent.futures.CancelledError, asyncio.CancelledError)
"""What becomes of a task whose scheduler is gone."""

_ANSWER_S = 15.0
_POLL_S, _LOOK_S = 1.0, 0.01
# Enough that no worker waits for the network, few enough that the scheduler does not notice.
_TASKS_A_THREAD = 4


class Cluster:
    """The workers of a scheduler; see :class:`cubicfish_cli.executors.pool.Executor`."""

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
        """Do the work on every item; see :meth:`cubicfish_cli.executors.pool.Executor.each`.

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
        from distributed import as_completed

        # The answer of a task, unlike data that is scattered, is made again when it is lost.
        kept = self._client.submit(bytes, wanted, pure=False)
        # It fetches answers on its own thread: one that is lost with its worker may never come.
        finished = as_completed(loop=self._client.loop, with_results=True, raise_errors=False)
        numbers = iter(range(len(items)))
        pending: dict[Any, int] = {}
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
                    pending |= zip(futures, batch, strict=True)
                    finished.update(futures)
                some = finished.next_batch(block=False)
                if not some:
                    time.sleep(_LOOK_S)
                for future, told in some:
                    done += 1
                    # Its status may have changed since: answers are lost with their workers.
                    if isinstance(told, tuple) and len(told) == 1:
                        answer = told[0]
                    else:  # of what failed: its type, the exception and its traceback
                        why = told if isinstance(told, BaseException) else told[1]
                        answer = self._explained(why, so_far)
                    yield pending.pop(future), answer
        except CANCELLED as problem:
            raise self._lost(so_far) from problem

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


def _minor(python: str) -> str:
    return ".".join(python.split(".")[:2])


def within(limit_s: float, start: Callable[[], Any]) -> Any:
    """Call a function that may never return, as where something else listens or a process stands.

    Raises:
        TimeoutError: it did not return in time.

    """
    outcome: SimpleQueue[tuple[Any, Exception | None]] = SimpleQueue()

    def run() -> None:
        try:
            outcome.put((start(), None))
        except Exception as problem:
            outcome.put((None, problem))

    threading.Thread(target=run, daemon=True).start()
    try:
        result, problem = outcome.get(timeout=limit_s)
    except Empty:
        raise TimeoutError(f"no answer in {limit_s:g} s") from None
    if problem is not None:
        raise problem
    return result


INSTALL = "pip install 'cubicfish[scale]'"

WAIT_S = 60.0
"""How long to wait for a worker where there is none."""

# A scheduler that is there answers within milliseconds.
_CONNECT_S = 5.0
_SLACK_S = 1.0
_CLOSE_S = 5.0
_LOGGERS = ("distributed", "tornado", "asyncio")


@contextmanager
def connect(address: str, *, wait_s: float = WAIT_S) -> Iterator[Cluster]:
    """Reach a scheduler and check its workers; on leaving, what has not begun is cancelled.

    Args:
        address: such as ``tcp://host:8786``. Whoever runs the scheduler can run anything here.
        wait_s: how long to wait, now and later, while there is no worker.

    Raises:
        ClusterError: dask is missing here, nobody answers, no worker comes, or a worker has
            other versions.

    """
    try:
        import dask.config
        from distributed import Client
    except ImportError as problem:
        raise ClusterError(f"a scheduler needs dask ({problem}): {INSTALL}") from problem
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        stack.enter_context(dask.config.set({"distributed.comm.timeouts.connect": _CONNECT_S}))
        client = _client(Client, address)
        stack.callback(_close, client)
        cluster = Cluster(client, shown(address), wait_s)
        cluster.wait_for_worker()
        cluster.check_versions()
        yield cluster


def _client(kind: Any, address: str) -> Any:
    import distributed

    class Client(kind):  # type: ignore[misc]
        """A client that does not complain, when it is forgotten, of a peer that left it hanging."""

        def __del__(self) -> None:
            """It was closed, or never connected."""

    def start() -> Any:
        return Client(address, timeout=_CONNECT_S, set_as_default=False, name="cubicfish")

    try:
        return within(_CONNECT_S + _SLACK_S, start)
    except ValueError as problem:
        raise ClusterError(
            f"{shown(address)} is no address of a scheduler ({problem}): "
            "give one such as tcp://host:8786"
        ) from problem
    except OSError as problem:
        raise ClusterError(
            f"no scheduler answers at {shown(address)}: is 'dask scheduler' running there, "
            "and is this its address?"
        ) from problem
    except Exception as problem:  # whatever the other side does not understand
        if address.startswith(("tls:", "wss:")) and isinstance(problem, TypeError):
            raise ClusterError(
                f"{shown(address)} needs certificates: name them in dask's configuration, under "
                "distributed.comm.tls"
            ) from problem
        said = " ".join(str(problem).split())
        raise ClusterError(
            f"{shown(address)} does not understand distributed {distributed.__version__} ({said}): "
            "run the same version there"
        ) from problem


def _close(client: Any) -> None:
    with suppress(OSError, RuntimeError, *CANCELLED):
        client.close(timeout=_CLOSE_S)


@contextmanager
def _quiet() -> Iterator[None]:
    """What goes wrong is said once, by an error: dask's own log goes nowhere meanwhile."""
    known = list(logging.root.manager.loggerDict)
    loggers = [logging.getLogger(name) for name in known if name.split(".")[0] in _LOGGERS]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            # It compares versions too, of more than what matters here.
            warnings.filterwarnings("ignore", message="Mismatched versions found")
            yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
