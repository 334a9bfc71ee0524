"""Executor interface for distributed work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from cubicfish_cli.errors import CubicfishError

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Something that does the same work on many items, such as a cluster."""

    def each(
        self,
        work: Callable[[Item], Answer],
        items: Sequence[Item],
        *,
        writes_below: Path | None = None,
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do ``work`` on every item and yield (number of the item, answer) as they are done.

        A :class:`CubicfishError` that ``work`` raises is an answer. An item may be worked on more
        than once, where a machine is lost before it has answered: work that writes must be able
        to replace what it wrote before.

        Args:
            work: a function of a module, or a partial one, that can be pickled. It is unpickled
                once in each process, so what it keeps serves many items.
            items: what can be pickled too; their paths are absolute.
            writes_below: the folder that the work writes into; the executor must have the same.

        Raises:
            CubicfishError: the work cannot be done there at all.

        """
        ...
