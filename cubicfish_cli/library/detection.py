"""Pictures, in memory or on disk -> named corners."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.detection.look import GridCache
from cubicfish_cli.errors import DetectionError
from cubicfish_cli.executors.executor import Executor
from cubicfish_cli.identification.identified import Detection
from cubicfish_cli.identification.second_pass import second_pass
from cubicfish_cli.library.detect_corners import detect_corners
from cubicfish_cli.photos import MAX_PIXELS, Photo, find_photos
from cubicfish_cli.target import Target

StrPath = str | os.PathLike[str]
Image = npt.NDArray[Any]

_CHANNELS = (1, 2, 3, 4)
_FIRST_SHARE = 2 / 3  # of the time that both passes take, roughly


def detect(
    photos: StrPath | Mapping[str, Image] | Iterable[Image] | Iterable[StrPath],
    target: Target,
    *,
    jobs: int | None = 1,
    cache: StrPath | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Detection:
    """Find the corners of ``target`` in photos and name them, as ``cubicfish detect`` does.

    A second look follows where a camera fitted to the corners expects more. Photos that cannot be
    used are reported in the result, and passed over.

    Args:
        photos: arrays (H, W) or (H, W, 1 to 4), uint8 or uint16, colours in BGR order, by name or
            in a list (then named ``photo_0`` and so on); or files, folders and globs. Pictures
            must be as the sensor made them: :func:`read_picture` does not turn them, as cv2.imread
            may.
        target: the object.
        jobs: processes to use; None for one a processor. With more than one, a script must
            start its work below ``if __name__ == "__main__":``.
        cache: a folder in which what is found in files is kept; by default nothing is.
        progress: called with what is done now, in words, and the share done, 0 to 1.

    Returns:
        Corners with pixels (N, 2) and their target, and what became of each photo.

    Raises:
        DetectionError: an array is no picture, or no corner could be named in any photo; the
            text says what to check.
        PhotoError: there is no such file, or it is no photo.

    """
    found = _photos(photos)

    def first(done: int, photos: int) -> None:
        if progress is not None:
            progress("finding corners", _FIRST_SHARE * done / photos)

    def again(done: int, photos: int) -> None:
        if progress is not None:
            progress("looking again", _FIRST_SHARE + (1 - _FIRST_SHARE) * done / photos)

    detection = first_look(found, [target], jobs=jobs, progress=first, cache=cache)
    return second_pass(found, detection, target, jobs=jobs, progress=again)


def first_look(
    photos: Sequence[Photo],
    targets: Sequence[Target],
    *,
    jobs: int | None,
    progress: Callable[[int, int], None] | None = None,
    cache: StrPath | None = None,
    executor: Executor | None = None,
) -> Detection:
    """Find and name the corners of the one of several targets that explains most of them.

    Args:
        photos: the photos.
        targets: at least one; ``corners.target`` of the result says which it is.
        jobs: processes to use; None for one a processor.
        progress: called with photos done and all photos.
        cache: a folder in which what is found in files is kept.
        executor: who looks at the photos instead of processes here.

    Raises:
        DetectionError: no corner could be named by any of them; the text is that of the last.

    """
    with ExitStack() as stack:
        if cache is None and len(targets) > 1:  # photos are searched once for all targets
            cache = stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
        grids = None if cache is None else GridCache(folder=Path(cache).absolute())
        look = partial(
            detect_corners, photos, jobs=jobs, progress=progress, cache=grids, executor=executor
        )
        found: list[Detection] = []
        for number, target in enumerate(targets, start=1):
            try:
                found.append(look(target))
            except DetectionError:  # the last says why, where none does better
                if number == len(targets) and not found:
                    raise
    return max(found, key=lambda one: len(one.corners.pixel))


def _photos(
    photos: StrPath | Mapping[str, Image] | Iterable[Image] | Iterable[StrPath],
) -> list[Photo]:
    if isinstance(photos, str | os.PathLike):
        return find_photos([photos])
    if isinstance(photos, Mapping):
        names, given = list(photos), list(photos.values())
    else:
        given = list(photos)
        if given and all(isinstance(one, str | os.PathLike) for one in given):
            return find_photos(given)
        names = [f"photo_{index}" for index in range(len(given))]
    if not given:
        raise DetectionError("no photo was given: pass pictures, or the names of files")
    names = list(Refusal(error=DetectionError).names(names, "photos"))
    return [
        Photo(name=name, path=Path(name), picture=_picture(one, name))
        for name, one in zip(names, given, strict=True)
    ]


def _picture(value: object, name: str) -> Image:
    if not isinstance(value, np.ndarray):
        raise DetectionError(
            f"{name} is no array but {type(value).__name__}: pass either arrays or names of files"
        )
    if value.ndim not in (2, 3) or (value.ndim == 3 and value.shape[2] not in _CHANNELS):
        raise DetectionError(
            f"{name} has the shape {value.shape}, not (H, W) or (H, W, 1 to 4): "
            "pass a list of pictures"
        )
    if value.dtype not in (np.uint8, np.uint16):
        raise DetectionError(f"{name} holds {value.dtype} numbers: pass uint8 or uint16")
    if not 0 < value.shape[0] * value.shape[1] <= MAX_PIXELS:
        raise DetectionError(
            f"{name} has {value.shape[1]}x{value.shape[0]} pixels: 1 to "
            f"{MAX_PIXELS / 1e6:g} million are allowed"
        )
    return np.ascontiguousarray(value)
