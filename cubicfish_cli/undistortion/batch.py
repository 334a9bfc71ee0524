"""Many photos: decoded, remapped and encoded on several threads, a few in memory at a time.

One thread more than work at a time: the disk takes as long as a tenth of the work, and while
some wait for it the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from os.path import abspath, commonpath
from pathlib import Path
from threading import BoundedSemaphore

from cubicfish_cli.errors import ClusterError, CubicfishError
from cubicfish_cli.executors.pool import Executor
from cubicfish_cli.files import remove_orphans, write_files
from cubicfish_cli.photos import decode_picture, one_opencv_thread, read_file, shown
from cubicfish_cli.undistortion.images import Rendering, check_outputs, render_files
from cubicfish_cli.undistortion.maps import UndistortMap

MapsOf = Callable[[Path, tuple[int, int]], Sequence[UndistortMap]]
"""(photo, its (width, height)) -> the maps that render it, one for each of its outputs."""


@dataclass(frozen=True, kw_only=True)
class PhotoJob:
    """A photo to undistort.

    Attributes:
        name: what messages call it.
        source: the photo.
        outputs: where its views go, in the order of its maps.
        kept: the numbers of those outputs that are there already and stay as they are.

    """

    name: str
    source: Path
    outputs: tuple[Path, ...]
    kept: frozenset[int] = frozenset()

    @property
    def wanted(self) -> list[Path]:
        """The outputs that are to be written."""
        return [path for number, path in enumerate(self.outputs) if number not in self.kept]


@dataclass(frozen=True, kw_only=True)
class FailedPhoto:
    """A photo that could not be undistorted, and why."""

    job: PhotoJob
    error: CubicfishError


def undistort_photos(
    jobs: Sequence[PhotoJob],
    maps: MapsOf,
    rendering: Rendering,
    *,
    workers: int,
    overwrite: bool,
    progress: Callable[[int, int], None],
    executor: Executor | None = None,
) -> list[FailedPhoto]:
    """Undistort photos; one that fails does not stop the others.

    Every output appears whole or not at all, also when this is interrupted.

    Args:
        jobs: the photos.
        maps: how each is rendered.
        rendering: how pixels are made.
        workers: photos to work on at a time.
        overwrite: whether outputs may be replaced.
        progress: called with the number of photos done and of all.
        executor: who does the work instead of this process; ``maps`` must then be picklable, and
            ``workers`` says nothing.

    Returns:
        What failed, in the order of ``jobs``.

    Raises:
        ClusterError: ``executor`` cannot do the work.

    """
    if executor is not None:
        return _undistort_there(
            jobs, maps, rendering, overwrite=overwrite, progress=progress, executor=executor
        )
    failures: dict[int, FailedPhoto] = {}
    slots = BoundedSemaphore(workers)

    def work(number: int) -> None:
        try:
            undistort_photo(jobs[number], maps, rendering, overwrite=overwrite, slots=slots)
        except CubicfishError as error:
            failures[number] = FailedPhoto(job=jobs[number], error=error)

    progress(0, len(jobs))
    if workers == 1 or len(jobs) == 1:
        for number in range(len(jobs)):
            work(number)
            progress(number + 1, len(jobs))
    else:
        with one_opencv_thread(), ThreadPoolExecutor(workers + 1) as threads:
            try:
                for done in _in_order_of_completion(threads, work, len(jobs), 2 * workers):
                    progress(done, len(jobs))
            except BaseException:
                threads.shutdown(wait=True, cancel_futures=True)
                raise
    return [failures[number] for number in sorted(failures)]


def undistort_photo(
    job: PhotoJob,
    maps: MapsOf,
    rendering: Rendering,
    *,
    overwrite: bool,
    slots: AbstractContextManager[object] | None = None,
) -> None:
    """Undistort one photo into all its outputs, but for those that are kept.

    Args:
        job: the photo.
        maps: how it is rendered.
        rendering: how pixels are made.
        overwrite: whether outputs may be replaced.
        slots: entered while there is work for a processor, and left to wait for the disk.

    Raises:
        PhotoError: the photo cannot be read.
        CubicfishError: as :func:`~.images.render_files`; ``maps`` may raise others.
        OutputError: an output exists and ``overwrite`` is false, or cannot be written.

    """
    check_outputs(job.wanted, overwrite=overwrite)
    data = read_file(job.source)
    with slots or nullcontext():
        picture = decode_picture(job.source, data, floats=True)
        height, width = picture.shape[:2]
        try:
            own = maps(job.source, (width, height))
        except CubicfishError as problem:
            raise type(problem)(str(problem), about=shown(job.source), apart=True) from problem
        outputs = enumerate(zip(job.outputs, own, strict=True))
        wanted = [output for number, output in outputs if number not in job.kept]
        files = render_files(job.source, data, picture, wanted, rendering)
        del data, picture  # the disk may take its time
    write_files(files, overwrite=overwrite)


def _undistort_there(
    jobs: Sequence[PhotoJob],
    maps: MapsOf,
    rendering: Rendering,
    *,
    overwrite: bool,
    progress: Callable[[int, int], None],
    executor: Executor,
) -> list[FailedPhoto]:
    """Undistort photos by an executor.

    What may be written is decided here, before the work: what a machine finds there later is
    what another one wrote that was lost before it could say so.
    """
    failures: dict[int, FailedPhoto] = {}
    free: list[int] = []
    for number, job in enumerate(jobs):
        try:
            check_outputs(job.wanted, overwrite=overwrite)
        except CubicfishError as error:
            failures[number] = FailedPhoto(job=job, error=error)
        else:
            free.append(number)
    progress(len(failures), len(jobs))
    if free:
        absolute = [_absolute(jobs[number]) for number in free]
        below = Path(commonpath([path.parent for job in absolute for path in job.outputs]))
        work = partial(_undistort_again, maps=maps, rendering=rendering)
        done = len(failures)
        try:
            for index, problem in executor.each(work, absolute, writes_below=below):
                if problem is not None:
                    job = jobs[free[index]]
                    if isinstance(problem, ClusterError):  # which does not know the photo
                        about = shown(job.source)
                        problem = ClusterError(str(problem), about=about, apart=True)
                    failures[free[index]] = FailedPhoto(job=job, error=problem)
                done += 1
                progress(done, len(jobs))
        except ClusterError as problem:
            if done == len(failures):
                raise
            raise ClusterError(f"{problem}; --skip-existing keeps what is done") from problem
        finally:
            # What workers that were killed have left: others may have looked there before.
            for folder in {path.parent for job in absolute for path in job.outputs}:
                remove_orphans(folder)
    return [failures[number] for number in sorted(failures)]


def _absolute(job: PhotoJob) -> PhotoJob:
    return replace(
        job,
        source=Path(abspath(job.source)),
        outputs=tuple(Path(abspath(path)) for path in job.outputs),
    )


def _undistort_again(job: PhotoJob, *, maps: MapsOf, rendering: Rendering) -> None:
    undistort_photo(job, maps, rendering, overwrite=True)


def _in_order_of_completion(
    threads: ThreadPoolExecutor, work: Callable[[int], None], count: int, ahead: int
) -> Iterator[int]:
    """Run ``work`` on 0..count−1, never more than ``ahead`` of them begun; yield how many did."""
    numbers = iter(range(count))
    pending: set[Future[None]] = {threads.submit(work, n) for n in islice(numbers, ahead)}
    finished = 0
    while pending:
        done, pending = wait(pending, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()
            finished += 1
            yield finished
        pending |= {threads.submit(work, n) for n in islice(numbers, len(done))}
