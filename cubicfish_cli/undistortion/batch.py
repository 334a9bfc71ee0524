"""Many photos: decoded, remapped and encoded on several threads, a few in memory at a time."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Container, Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, Self

import numpy.typing as npt

from cubicfish import (
    ClusterError,
    CubicCamera,
    CubicfishError,
    Run,
    UndistortMap,
    View,
    shown,
    undistort,
)
from cubicfish.files import write_files
from cubicfish.files.whole_files import remove_orphans
from cubicfish.photos import PictureFile
from cubicfish.photos.photos import one_opencv_thread
from cubicfish.views import ChosenView, Interpolation, ViewOptions, choose_view
from cubicfish_cli.undistortion.images import encode_picture, naming

if TYPE_CHECKING:
    from cubicfish.workers import Executor

Size = tuple[int, int]
"""(width, height), pixels."""
MAKING = RLock()
"""Held while maps are made, since one thread makes them for all."""
# Pixels of a view whose map, of nine bytes per pixel, is kept from one photo to the next.
_MOST_KEPT = 30_000_000


@dataclass(frozen=True, kw_only=True)
class Job:
    """A photo, or the photos of a rig's shot, and the pictures to be made of it.

    Attributes:
        name: its name in messages.
        photos: name of the camera -> its photo; a single camera's name is "".
        outputs: part of the view -> the path of its picture; the name of a single part is "".

    """

    name: str
    photos: Mapping[str, Path]
    outputs: Mapping[str, Path]

    @property
    def source(self) -> Path:
        """The photo, or the first of several."""
        return next(iter(self.photos.values()))

    def lacking(self, paths: Container[Path]) -> Self:
        """The same with those of its outputs only that are among paths."""
        outputs = {part: path for part, path in self.outputs.items() if path in paths}
        return replace(self, outputs=outputs)


Render = Callable[[Job, Mapping[str, npt.NDArray[Any]]], Mapping[str, npt.NDArray[Any]]]
"""(job, its photos by their cameras' names) -> the pictures of all parts that the job wants."""


Write = Callable[..., CubicfishError | None]
"""Called as :func:`write_one`, (job, overwrite=...) -> why its outputs could not be written."""


class Views:
    """The views of a run; called with a photo, it renders them.

    A view from the camera's place is the same for all photos of a size: its maps are made once,
    from any thread, unless they are so large that each photo is rendered some rows at a time. Sizes
    are (width, height), pixels.

    Attributes:
        interpolation: how pixels are interpolated.
        calibrated_size: that of the photos that the camera was calibrated from.
        rescaled: other sizes -> the first photo of each; empty where the view does not go by size.

    """

    calibrated_size: Size = (0, 0)
    rescaled: Mapping[Size, Path] = {}

    @staticmethod
    def size_of(path: Path) -> Size:
        """(width, height) of a photo."""
        return PictureFile.read(path).size

    def __init__(
        self, camera: CubicCamera, wanted: View | ViewOptions | None, interpolation: Interpolation
    ) -> None:
        """Prepare for photos of this camera.

        Args:
            camera: the camera.
            wanted: the view, or its options.
            interpolation: how pixels are interpolated.

        """
        self._camera, self._wanted, self.interpolation = camera, wanted, interpolation
        self._chosen: dict[Size, ChosenView] = {}
        self.calibrated_size, self.rescaled = camera.image_size, {}

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the maps, which are made faster than they are sent."""
        return {**vars(self), "_chosen": {}}

    def chosen(self, source: Path, size: Size) -> ChosenView:
        """The view of a photo of ``size``, and the camera that took it.

        Raises:
            ViewError: there is no such view of this photo.

        """
        if size not in self._chosen:
            self._chosen[size] = choose_view(self._camera.for_photos(size), self._wanted)
            if size != self.calibrated_size:
                self.rescaled = {**self.rescaled, size: source}
        return self._chosen[size]

    def maps(self, source: Path, size: Size) -> Mapping[str, UndistortMap]:
        """Part of the view -> its map."""
        with MAKING:
            return self.chosen(source, size).maps

    def chosen_of(self, job: Job) -> ChosenView:
        """The view of a job's photo, which is looked at for its size."""
        return self.chosen(job.source, self.size_of(job.source))

    def writer(self, quality: int | None) -> Write:
        """The function that writes the results of a job; the quality is that of pictures."""
        return partial(write_one, render=self, quality=quality)

    def __call__(
        self, job: Job, photos: Mapping[str, npt.NDArray[Any]]
    ) -> dict[str, npt.NDArray[Any]]:
        """The pictures of a job; :func:`write_many` calls it."""
        picture, how = photos[""], self.interpolation
        size = picture.shape[1], picture.shape[0]
        with MAKING:
            chosen = self.chosen(job.source, size)
            maps = chosen.maps if math.prod(chosen.first.size) <= _MOST_KEPT else None
        if maps is None:
            assert chosen.camera is not None
            return {
                part: undistort(picture, chosen.camera, chosen.views[part], interpolation=how)
                for part in job.outputs
            }
        return {part: undistort(picture, maps[part], interpolation=how) for part in job.outputs}


def write_many(jobs: Sequence[Job], write: Write, run: Run) -> dict[str, CubicfishError]:
    """Write the results of many photos, shots or videos; one that fails does not stop the others.

    Every output appears whole or not at all, also when this is interrupted.

    Args:
        jobs: the photos.
        write: writes the results of one.
        run: how the work is done. For its executor ``write`` must be picklable, and an executor may
            replace outputs that it finds: a machine wrote them and was lost before it could report
            them.

    Returns:
        The name of each job that failed, in the order of ``jobs``, and why.

    Raises:
        ClusterError: the executor cannot do the work.

    """
    progress = run.listener.counting("Undistorting")
    workers = run.jobs or os.cpu_count() or 1
    if run.executor is not None and jobs:
        answers = _run_in_executor(partial(write, overwrite=True), jobs, run.executor)
    elif workers == 1 or len(jobs) == 1:
        answers = ((number, write(job, overwrite=run.overwrite)) for number, job in enumerate(jobs))
    else:
        answers = _run_in_threads(partial(write, overwrite=run.overwrite), jobs, workers)
    problems: dict[int, CubicfishError | None] = {}
    progress(0, len(jobs))
    with closing(answers):
        for number, problem in answers:
            problems[number] = problem
            progress(len(problems), len(jobs))
    failed = ((job.name, problems[number]) for number, job in enumerate(jobs))
    return {name: problem for name, problem in failed if problem is not None}


def write_one(
    job: Job, render: Render, *, quality: int | None = None, overwrite: bool
) -> CubicfishError | None:
    """Write the pictures of one photo or shot.

    Args:
        job: the photo.
        render: makes the pictures of the photo.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.
        overwrite: whether existing outputs may be replaced.

    Returns:
        Why it could not be written: a :class:`PhotoError` if a photo cannot be read, a
        :class:`ViewError` if there are no pictures of such photos, an :class:`OutputError` if an
        output exists, cannot be written, or cannot hold such a picture; None if it was written.

    """
    try:
        files = {camera: PictureFile.read(path) for camera, path in job.photos.items()}
        photos = {camera: file.picture(floats=True) for camera, file in files.items()}
        with naming(job.source) if "" in job.photos else nullcontext():
            pictures = render(job, photos)
        like = next(iter(files.values())).data
        made = {
            path: encode_picture(path, pictures[part], quality=quality, like=like)
            for part, path in job.outputs.items()
        }
        write_files(made, overwrite=overwrite)
    except CubicfishError as problem:
        return problem
    return None


Answers = Generator[tuple[int, CubicfishError | None], None, None]
"""The numbers of the jobs in the order in which they are done, and why one failed, or None."""


def _run_in_threads(
    work: Callable[[Job], CubicfishError | None], jobs: Sequence[Job], workers: int
) -> Answers:
    """Do the work here; OpenCV's own threads gain only where nothing else works beside it."""
    with one_opencv_thread(), ThreadPoolExecutor(workers) as threads:
        try:
            numbers = {threads.submit(work, job): number for number, job in enumerate(jobs)}
            for future in as_completed(numbers):
                yield numbers[future], future.result()
        finally:
            threads.shutdown(cancel_futures=True)


def _run_in_executor(
    work: Callable[[Job], CubicfishError | None], jobs: Sequence[Job], executor: Executor
) -> Answers:
    folders = {path.parent for job in jobs for path in job.outputs.values()}
    any_done = False
    try:
        for number, problem in executor.each(work, list(map(_make_absolute, jobs))):
            if isinstance(problem, ClusterError):  # the executor does not know the photo
                about = shown(jobs[number].source)
                problem = ClusterError(str(problem), about=about, apart=True)
            any_done = True
            yield number, problem
    except ClusterError as error:
        if not any_done:
            raise
        raise ClusterError(f"{error}; --skip-existing keeps what is done") from error
    finally:
        # What killed workers have left: others may have searched these folders before.
        for folder in folders:
            remove_orphans(folder)


def _make_absolute(job: Job) -> Job:
    photos, outputs = (
        {key: Path(os.path.abspath(path)) for key, path in paths.items()}
        for paths in (job.photos, job.outputs)
    )
    return replace(job, photos=photos, outputs=outputs)
