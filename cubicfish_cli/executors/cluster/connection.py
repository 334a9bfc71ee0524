"""Connecting to a dask scheduler, with failures said in one line."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from cubicfish_cli.errors import ClusterError
from cubicfish_cli.executors.cluster.patience import within
from cubicfish_cli.executors.cluster.workers import CANCELLED, Cluster
from cubicfish_cli.photos import shown

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
