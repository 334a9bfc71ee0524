"""Tasks that run in a worker's process: the function is unpickled once, each photo is a task.

An order is pickled as (versions, proof, pickled work): those who cannot do the work find out
before they unpickle it.
"""

from __future__ import annotations

import importlib
import os
import pickle
import platform
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

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


def task() -> Callable[[bytes, bytes], Any]:
    """What is sent as a task: like its arguments, a scheduler without this package can read it."""

    def do(wanted: bytes, item: bytes) -> Any:

        return do_one(wanted, item)

    return do
