"""From what the user named (photos, or CSV files of corners or pairs) to 2D-3D pairs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.cache_folder import cache_folder
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import verbosity
from cubicfish_cli.cli.target_choice import TargetChoice, say_default
from cubicfish_cli.cli.terminal import progress, say
from cubicfish_cli.errors import MISSING, CorrespondenceError, CubicfishError
from cubicfish_cli.wording import quoted

if TYPE_CHECKING:
    from cubicfish_cli.executors.executor import Executor
    from cubicfish_cli.files import Fingerprint
    from cubicfish_cli.identification.identified import Detection, PhotoReport
    from cubicfish_cli.observations import Observations
    from cubicfish_cli.photos import Photo
    from cubicfish_cli.target import Target
    from cubicfish_cli.words.finding import Finding

# Of more photos than these, some are as good as all.
_MANY = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Corners or points with their world points, and what they came from.

    Attributes:
        pairs: the corners or points, sorted by photo.
        corners: the named corners in the order that they came in; None for points without names.
        detection: what was found in each photo; None for CSV files.
        files: every file that was read, in order, as it was before.
        target_file: the target's.

    """

    pairs: Observations
    files: tuple[Fingerprint, ...]
    corners: Observations | None = None
    detection: Detection | None = None
    target_file: Fingerprint | None = None

    @property
    def given(self) -> Detection | Observations:
        """What was given, as the library takes it."""
        return self.detection or self.pairs


def load_pairs(
    inputs: Sequence[Path],
    *,
    correspondences: Path | None,
    target: TargetChoice,
    size: tuple[int, int] | None,
    jobs: int | None,
    no_cache: bool,
    best: int | None = None,
) -> Pairs:
    """Read pairs from photos, from one corners.csv, or from one correspondences.csv.

    Of more photos than ``best``, those that add most are taken.

    Raises:
        click.UsageError: the inputs do not go together.
        CubicfishError: an input cannot be used.

    """
    check_inputs(inputs, correspondences=correspondences, target=target)
    tables = _tables(inputs)
    if correspondences is not None:
        loaded = _from_correspondences(correspondences, size)
    elif not tables:
        loaded = _from_photos(inputs, target, jobs, no_cache, best)
    elif _holds_world_points(tables[0]):
        loaded = _from_correspondences(tables[0], size)
    else:
        loaded = _from_corners(tables[0], target, size)
    _refuse_one_place(loaded)
    return loaded


def _refuse_one_place(loaded: Pairs) -> None:
    """Raise :class:`CorrespondenceError` where all corners are in one pixel: a column is wrong."""
    pixel = loaded.pairs.pixel
    if len(pixel) > 1 and float((pixel.max(axis=0) - pixel.min(axis=0)).max()) < 1:
        x, y = pixel[0]
        raise CorrespondenceError(
            f"all {count(len(pixel), 'corner')} are at x {x:g}, y {y:g}: check the columns x and y"
        )


def check_inputs(
    inputs: Sequence[Path], *, correspondences: Path | None, target: TargetChoice
) -> None:
    """Refuse at once, before anything is loaded or done, what cannot be read as pairs.

    Raises:
        click.UsageError: the inputs do not go together.
        CubicfishError: one is not there.

    """
    if correspondences is not None:
        if inputs:
            raise click.UsageError("give photos (or corners.csv) or --correspondences, not both")
        _refuse_missing([correspondences])
        return
    if not inputs:
        raise click.UsageError("name photos, a folder of photos, or a corners.csv")
    tables = _tables(inputs)
    if tables and len(inputs) > 1:
        raise click.UsageError(f"{quoted(str(tables[0]))} must be the only input, as all CSV files")
    _refuse_missing(inputs)
    if not (tables and _holds_world_points(tables[0])):
        target.check()


def _tables(inputs: Sequence[Path]) -> list[Path]:
    return [path for path in inputs if path.suffix.lower() == ".csv"]


def _refuse_missing(paths: Sequence[Path]) -> None:
    for path in paths:
        if not os.path.lexists(path) and not has_magic(str(path)):
            raise CubicfishError(f"{path} {MISSING}")


def _holds_world_points(path: Path) -> bool:
    """Whether the header of a CSV file is that of correspondences."""
    try:
        if not path.is_file():  # a pipe might be waited for
            return False
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            lines = [file.readline(10_000) for _ in range(2)]
    except OSError:
        return False  # the reader says what is wrong with it
    header = lines[1] if lines[0].startswith("#") else lines[0]
    return {"X", "Y", "Z"} <= {cell.strip() for cell in header.split(",")}


def _from_correspondences(path: Path, size: tuple[int, int] | None) -> Pairs:
    from cubicfish_cli.corner_files.observations_csv import load_correspondences
    from cubicfish_cli.files import fingerprint

    file = fingerprint(path)
    return Pairs(pairs=load_correspondences(path, image_size=size), files=(file,))


def _from_corners(path: Path, choice: TargetChoice, size: tuple[int, int] | None) -> Pairs:
    from cubicfish_cli.corner_files.observations_csv import load_corners
    from cubicfish_cli.files import fingerprint

    say_default(choice)
    target_file, file = choice.fingerprint(), fingerprint(path)
    target = choice.load()[0]
    corners = load_corners(path, target, image_size=size)
    return Pairs(
        pairs=corners.by_photo(),
        corners=corners,
        files=(file,),
        target_file=target_file,
    )


def _from_photos(
    inputs: Sequence[Path],
    choice: TargetChoice,
    jobs: int | None,
    no_cache: bool,
    best: int | None,
) -> Pairs:
    from cubicfish_cli.cli.choosing import best_photos
    from cubicfish_cli.files import fingerprint

    say_default(choice)
    target_file = choice.fingerprint()
    targets = choice.load()
    photos = photos_of(inputs)
    if best is not None and len(photos) > best:
        photos = best_photos(photos, choice, best, jobs, no_cache=no_cache)
    elif best is None and len(photos) > _MANY:
        say(f"{len(photos):,} photos: --best 60 calibrates from those that add most.")
    files = tuple(fingerprint(photo.path) for photo in photos)
    detection = detect(photos, targets, jobs, no_cache=no_cache)
    return Pairs(
        pairs=detection.corners,
        corners=detection.corners,
        detection=detection,
        files=files,
        target_file=target_file,
    )


def photos_of(inputs: Sequence[str | Path]) -> list[Photo]:
    """The photos that the user named; what may be missed among them is said.

    Raises:
        PhotoError: there are none, or one cannot be used.

    """
    from cubicfish_cli.photos import find_photos

    remarks: list[str] = []
    photos = find_photos(inputs, remarks)
    for line in remarks:
        say(line)
    return photos


def refuse_other_sizes(inputs: Sequence[Path], size: tuple[int, int]) -> None:
    """Refuse photos none of which a camera is for, before they are searched.

    Raises:
        PhotoError: there are none that can be read, or all are of another size.

    """
    from cubicfish_cli.errors import PhotoError
    from cubicfish_cli.photos import find_photos, photo_size

    seen = None
    for photo in find_photos(inputs) if not _tables(inputs) else ():
        try:
            seen = photo_size(photo.path)
        except PhotoError:  # a damaged one is left out with a word later
            continue
        if seen == size:
            return
    if seen is not None:
        raise PhotoError(
            "the photos have {}x{} pixels and the camera is for {}x{}: use photos of the camera's "
            "own size, or name its camera with --model".format(*seen, *size)
        )


def photo_problems(detection: Detection) -> list[str]:
    """One line for every photo that gave nothing, and for every grid that was left out."""
    from cubicfish_cli.identification.identified import line_of

    return [line_of(one) for photo in detection.photos for one in photo.findings]


def photo_remarks(detection: Detection | None, more: Sequence[Finding] = ()) -> dict[str, Any]:
    """What is told of photos and grids for ``--json``: lines, and records of those and others."""
    of_photos = [one for photo in detection.photos for one in photo.findings] if detection else []
    return {
        "photo_problems": None if detection is None else photo_problems(detection),
        "remarks": [one.as_record() for one in (*of_photos, *more)],
    }


def mark_of(finding: Finding) -> str:
    """How a line about a finding begins."""
    return "note" if finding.severity.value == "note" else "warning"


def say_photo_problems(detection: Detection) -> None:
    """Say them, and once what several photos share, unless all is wanted (``--verbose``)."""
    from cubicfish_cli.identification.identified import remark_lines

    if verbosity() > 0:
        lines = photo_problems(detection)
    else:
        lines = remark_lines([one for photo in detection.photos for one in photo.findings])
    for line in lines:
        say(line)


def lost_word(photo: PhotoReport) -> str:
    """A word for why a photo gave no corners."""
    from cubicfish_cli.words.codes import Code

    why = photo.refusal.code if photo.refusal is not None else None
    if why in (Code.OTHER_SIZE, Code.CANNOT_BE_READ):
        return "another size" if why is Code.OTHER_SIZE else "cannot be read"
    return "left out" if why is None else "nothing found"


def why_lost(detection: Detection) -> dict[str, str]:
    """Photos that gave nothing, and a word for why."""
    return {photo.name: lost_word(photo) for photo in detection.photos if photo.lost}


def detect(
    photos: Sequence[Photo],
    targets: Sequence[Target],
    jobs: int | None,
    *,
    no_cache: bool,
    executor: Executor | None = None,
    again: bool = True,
) -> Detection:
    """Find and name the corners of a target in photos, in two passes with progress bars.

    Of several targets, the one that explains most corners is taken. Without ``again`` the second
    pass is left out.
    """
    from cubicfish_cli.identification.second_pass import second_pass
    from cubicfish_cli.library.detection import first_look

    say(f"Looking for corners in {count(len(photos), 'photo')}.")
    kept = None if no_cache else cache_folder()
    with progress("Finding corners") as callback:
        detection = first_look(
            photos, targets, jobs=jobs, progress=callback, cache=kept, executor=executor
        )
    target = detection.corners.target
    if again and target is not None:
        with progress("Looking again") as callback:
            detection = second_pass(
                photos, detection, target, jobs=jobs, progress=callback, executor=executor
            )
    added = sum(photo.added for photo in detection.photos)
    if added:
        say(f"A second look, where a fitted camera expects them, added {count(added, 'corner')}.")
    return detection
