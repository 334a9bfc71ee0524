"""Threads that libraries take by themselves, where they gain nothing by it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import ThreadpoolController


class Shared:
    """A state of the process: who enters first makes it, who leaves last ends it.

    Several threads may be inside at once. What ``state()`` gives is for a ``with`` block, and
    decorates functions.
    """

    def __init__(self, begin: Callable[[], Any], end: Callable[[Any], None]) -> None:
        """Be made by ``begin``, and ended by ``end``, which takes what ``begin`` gave."""
        self._begin, self._end = begin, end
        self._lock, self._inside = threading.Lock(), 0
        self._before: Any = None

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Be inside."""
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


def _one_thread() -> Any:
    return ThreadpoolController().limit(limits=1, user_api="blas")


one_blas_thread = Shared(_one_thread, lambda limits: limits.restore_original_limits())
"""Matrices of a fit are small: more threads of linear algebra than one only wait for each other."""
