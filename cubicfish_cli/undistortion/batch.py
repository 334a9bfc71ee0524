"""Many photos: decoded, remapped and encoded on several threads, a few in memory at a time.

One thread more than work at a time: the disk takes as long as a tenth of the work, and while
some wait for it the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from os.path import abspath, commonpath
from pathlib import Path
from threading import BoundedSemaphore
from typing import Any

from cubicfish_cli.errors import ClusterError, CubicfishError
from cubicfish_cli.executors.pool import Executor
from cubicfish_cli.files import remove_orphans, write_files
from cubicfish_cli.photos import decode_picture, one_opencv_thread, read_file, shown
from cubicfish_cli.undistortion.images import (
    Rendering,
    check_outputs,
    encode_picture,
    naming,
    remap_picture,
)
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


def undistort_photos(
    jobs: Sequence[PhotoJob],
    maps: MapsOf,
    rendering: Rendering,
    *,
    workers: int,
    overwrite: bool,
    progress: Callable[[int, int], None],
    executor: Executor | None = None,
) -> dict[str, CubicfishError]:
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
        Name of each that failed, in the order of ``jobs``, and why.

    Raises:
        ClusterError: ``executor`` cannot do the work.

    """
    work = partial(_problem_of, maps=maps, rendering=rendering)
    if executor is None:
        slots = BoundedSemaphore(workers)
        answers = _by_threads(partial(work, overwrite=overwrite, slots=slots), jobs, workers)
    else:
        answers = _by_executor(partial(work, overwrite=True), jobs, executor, overwrite=overwrite)
    problems: dict[int, CubicfishError | None] = {}
    progress(0, len(jobs))
    with closing(answers):
        for number, problem in answers:
            problems[number] = problem
            progress(len(problems), len(jobs))
    failed = ((job.name, problems[number]) for number, job in enumerate(jobs))
    return {name: problem for name, problem in failed if problem is not None}


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
        ViewError: a map is not for photos of this size; ``maps`` may raise others.
        OutputError: an output exists and ``overwrite`` is false, or cannot be written, or cannot
            hold such a picture.

    """
    check_outputs(job.wanted, overwrite=overwrite)
    data = read_file(job.source)
    with slots or nullcontext():
        picture = decode_picture(job.source, data, floats=True)
        height, width = picture.shape[:2]
        with naming(job.source):
            own = maps(job.source, (width, height))
        files = {}
        for number, (path, made) in enumerate(zip(job.outputs, own, strict=True)):
            if number not in job.kept:
                with naming(job.source):
                    part = remap_picture(picture, made, rendering)
                files[path] = encode_picture(path, part, quality=rendering.quality, like=data)
        del data, picture  # the disk may take its time
    write_files(files, overwrite=overwrite)


def _problem_of(job: PhotoJob, **how: Any) -> CubicfishError | None:
    try:
        undistort_photo(job, **how)
    except CubicfishError as problem:
        return problem
    return None


Answers = Generator[tuple[int, CubicfishError | None], None, None]
"""Numbers of the jobs as they are done, and why one could not be."""


def _by_threads(
    work: Callable[[PhotoJob], CubicfishError | None], jobs: Sequence[PhotoJob], workers: int
) -> Answers:
    """Do the work here, never more than twice as many jobs begun as there are workers."""
    if workers == 1 or len(jobs) == 1:
        yield from enumerate(map(work, jobs))
        return
    numbers = iter(range(len(jobs)))
    with one_opencv_thread(), ThreadPoolExecutor(workers + 1) as threads:
        try:
            doing = {threads.submit(work, jobs[n]): n for n in islice(numbers, 2 * workers)}
            while doing:
                done, _ = wait(doing, return_when=FIRST_COMPLETED)
                for future in done:
                    yield doing.pop(future), future.result()
                doing |= {threads.submit(work, jobs[n]): n for n in islice(numbers, len(done))}
        except BaseException:
            threads.shutdown(wait=True, cancel_futures=True)
            raise


def _by_executor(
    work: Callable[[PhotoJob], CubicfishError | None],
    jobs: Sequence[PhotoJob],
    executor: Executor,
    *,
    overwrite: bool,
) -> Answers:
    """Have an executor do the work.

    What may be written is decided here, before the work: what a machine finds there later is
    what another one wrote that was lost before it could say so.
    """
    free: dict[int, PhotoJob] = {}
    for number, job in enumerate(jobs):
        try:
            check_outputs(job.wanted, overwrite=overwrite)
        except CubicfishError as refused:
            yield number, refused
        else:
            free[number] = _absolute(job)
    if not free:
        return
    numbers, folders = list(free), {path.parent for job in free.values() for path in job.outputs}
    below, any_done = Path(commonpath(folders)), False
    try:
        for index, problem in executor.each(work, list(free.values()), writes_below=below):
            if isinstance(problem, ClusterError):  # which does not know the photo
                about = shown(jobs[numbers[index]].source)
                problem = ClusterError(str(problem), about=about, apart=True)
            any_done = True
            yield numbers[index], problem
    except ClusterError as error:
        if not any_done:
            raise
        raise ClusterError(f"{error}; --skip-existing keeps what is done") from error
    finally:
        # What workers that were killed have left: others may have looked there before.
        for folder in folders:
            remove_orphans(folder)


def _absolute(job: PhotoJob) -> PhotoJob:
    outputs = tuple(Path(abspath(path)) for path in job.outputs)
    return replace(job, source=Path(abspath(job.source)), outputs=outputs)
