"""Time limits for calls that may never return."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any


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
