"""Work on many photos, with results in order whoever does it."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from cubicfish.errors import ClusterError, CubicfishError
from cubicfish.photos.photos import one_opencv_thread

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Something that does the same work on many items, such as a cluster."""

    def each(
        self, work: Callable[[Item], Answer], items: Sequence[Item]
    ) -> Iterator[tuple[int, Answer | CubicfishError]]:
        """Do ``work`` on every item and yield (number of the item, answer) as they are done.

        A :class:`CubicfishError` that ``work`` raises is an answer. An item may be worked on more
        than once, where a machine is lost before it has answered: work that writes must be able
        to replace what it wrote before.

        Args:
            work: a function of a module, or a partial one, that can be pickled. It is unpickled
                once in each process, so what it keeps serves many items.
            items: what can be pickled too; their paths are absolute.

        Raises:
            CubicfishError: the work cannot be done there at all.

        """
        ...


class _Named(Protocol):
    @property
    def name(self) -> str:
        """What messages call it."""
        ...


Photo = TypeVar("Photo", bound=_Named)

# Fewer photos than this are not worth starting other processes for.
_ITEMS_FOR_POOL = 4


def workers_for(jobs: int | None, items: int) -> int:
    """How many processes to use: ``jobs``, or one per processor where there is work for them."""
    if jobs is None:
        if items < _ITEMS_FOR_POOL:
            return 1
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs or 1, items))


@dataclass(frozen=True, kw_only=True)
class Work:
    """Who looks at many photos, and who hears how far that is.

    Attributes:
        jobs: processes to use; None for one per processor.
        progress: called with items done and all items.
        executor: who does it instead of processes here.

    """

    jobs: int | None = None
    progress: Callable[[int, int], None] = lambda done, total: None
    executor: Executor | None = None

    def done(self, work: Callable[[Photo], Answer], items: Sequence[Photo]) -> list[Answer]:
        """Answer ``work`` of every item, in their order, whoever does it; both can be pickled.

        OpenCV runs one thread in each process.

        Raises:
            DetectionError: a process was ended from outside.
            CubicfishError: what ``work`` raises; the executor cannot do it.

        """
        workers = workers_for(self.jobs, len(items))
        answers: dict[int, Answer] = {}
        with one_opencv_thread():
            found: Iterator[tuple[int, Answer | CubicfishError]] = enumerate(map(work, items))
            if self.executor is not None:
                found = self.executor.each(work, items)
            elif workers > 1:
                from cubicfish.workers.processes import by_processes

                found = enumerate(by_processes(work, items, workers))
            for number, answer in found:
                if isinstance(answer, ClusterError):
                    raise ClusterError(f"{items[number].name}: {answer}") from answer
                if isinstance(answer, CubicfishError):
                    raise answer
                answers[number] = answer
                self.progress(len(answers), len(items))
        return [answers[number] for number in range(len(items))]
