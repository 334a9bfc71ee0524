"""Many photos: decoded, remapped and encoded on several threads, a few in memory at a time.

One thread more than work at a time: the disk takes as long as a tenth of the work, and while
some wait for it the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from threading import BoundedSemaphore

from cubicfish_cli.errors import CubicfishError
from cubicfish_cli.photos import decode_picture, one_opencv_thread, read_file, shown
from cubicfish_cli.undistortion.images import Rendering, check_outputs, render_files, write_files
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

    """

    name: str
    source: Path
    outputs: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class Failure:
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
) -> list[Failure]:
    """Undistort photos; one that fails does not stop the others.

    Every output appears whole or not at all, also when this is interrupted.

    Args:
        jobs: the photos.
        maps: how each is rendered.
        rendering: how pixels are made.
        workers: photos to work on at a time.
        overwrite: whether outputs may be replaced.
        progress: called with the number of photos done and of all.

    Returns:
        What failed, in the order of ``jobs``.

    """
    failures: dict[int, Failure] = {}
    slots = BoundedSemaphore(workers)

    def work(number: int) -> None:
        try:
            undistort_photo(jobs[number], maps, rendering, overwrite=overwrite, slots=slots)
        except CubicfishError as error:
            failures[number] = Failure(job=jobs[number], error=error)

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
    """Undistort one photo into all its outputs.

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
    check_outputs(job.outputs, overwrite=overwrite)
    data = read_file(job.source)
    with slots or nullcontext():
        picture = decode_picture(job.source, data, floats=True)
        height, width = picture.shape[:2]
        try:
            own = maps(job.source, (width, height))
        except CubicfishError as problem:
            raise type(problem)(f"{shown(job.source)}: {problem}") from problem
        outputs = list(zip(job.outputs, own, strict=True))
        files = render_files(job.source, data, picture, outputs, rendering)
        del data, picture  # the disk may take its time
    write_files(files, overwrite=overwrite)


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
