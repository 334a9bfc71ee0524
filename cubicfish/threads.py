"""Limits for threads that libraries start by themselves where they gain nothing by it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import ThreadpoolController


class Shared:
    """A state of the process, which the first thread that enters begins and the last one ends.

    Several threads may be inside at once. ``state()`` is a context manager, and decorates
    functions.
    """

    def __init__(self, begin: Callable[[], Any], end: Callable[[Any], None]) -> None:
        """Define the state by ``begin``, and ``end``, which takes what ``begin`` returned."""
        self._begin, self._end = begin, end
        self._lock, self._inside = threading.Lock(), 0
        self._before: Any = None

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Enter the state, and leave it after the block."""
        with self._lock:
            if self._inside == 0:
                self._before = self._begin()
            self._inside += 1
        try:
            yield
        finally:
            with self._lock:
                self._inside -= 1
                if self._inside == 0:
                    self._end(self._before)


def _limit_to_one_thread() -> Any:
    return ThreadpoolController().limit(limits=1, user_api="blas")


one_blas_thread = Shared(_limit_to_one_thread, lambda limits: limits.restore_original_limits())
"""One thread of linear algebra: a fit's matrices are small, and more threads would only wait."""
