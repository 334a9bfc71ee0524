"""Pictures, in memory or in files -> named corners, with what became of each; and their files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cubicfish.arrays import Refusal
from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.diagnosis.evidence import GridEvidence, MarkerEvidence, PhotoEvidence
from cubicfish.errors import DetectionError
from cubicfish.files.whole_files import StrPath
from cubicfish.find.identification.identified import (
    FEWEST_CORNERS,
    Detection,
    PhotoReport,
    marked_corners,
    nameless,
    nominal_target_fits,
    remarks_of,
)
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.find.identification.second_pass import (
    Prediction,
    predicted_corners,
    with_added,
)
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.listener import Event
from cubicfish.observe.first_square import begins_otherwise, boards_begun_otherwise
from cubicfish.observe.photo_detection import (
    GridCache,
    PhotoDetection,
    detect_in_photo,
    make_refusal,
)
from cubicfish.photos.photos import Photo, find_photos, is_reduced, refuse_no_picture
from cubicfish.run import Run
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.workers.pool import Work

if TYPE_CHECKING:
    from cubicfish.find.detection.markers import MarkedCorners

Image = npt.NDArray[Any]


def detect(
    photos: StrPath | Mapping[str, Image] | Iterable[Image] | Iterable[StrPath] | Sequence[Photo],
    target: Target | Sequence[Target],
    run: Run = Run(jobs=1),
    *,
    again: bool = True,
    faults: bool = True,
    step: str = "Finding corners",
) -> Detection:
    """Find the corners of ``target`` in photos and name them, as ``cubicfish detect`` does.

    A second pass follows where a camera fitted to the corners expects more. Photos that cannot be
    used are reported in the result, and passed over.

    Args:
        photos: arrays (H, W) or (H, W, 1 to 4), uint8 or uint16, colours in BGR order, by name or
            in a list (then named ``photo_0`` and so on); or files, folders and globs; or photos in
            files and in memory. Pictures must be as the sensor made them: :func:`read_picture` does
            not turn them, as cv2.imread may.
        target: the calibration target; of several, with the same boards but for their colours, the
            one that explains most, which is ``corners.target`` of the result. Without any, grids of
            squares are found, all of one size, which the reports on photos have: their corners have
            no names.
        run: how the work is done, by default in this process. With more of them, a script must
            start its work below ``if __name__ == "__main__":``.
        again: whether a second pass follows, and the listener is told of both.
        faults: whether it is tried what may be wrong with the target although corners could be
            named, which may take seconds. Without that, they may have the names of others.
        step: what progress is called.

    Returns:
        Corners with pixels (N, 2) and their target, and what became of each photo.

    Raises:
        ClusterError: the executor cannot do the work.
        DetectionError: an array is no picture, or no corner could be named in any photo; the
            text says what to check.
        PhotoError: there is no such file, or it is no photo.

    """
    photos = _make_photos(photos)
    targets = [target] if isinstance(target, Target) else [*target]
    if not again:
        return first_pass(photos, targets, run.work(step), run.cache, faults=faults)
    run.listener.tell(Event.LOOKING, photos=len(photos))
    detection = first_pass(photos, targets, run.work(step), run.cache, faults=faults)
    best = detection.corners.target
    if best is not None:
        work = run.work("Looking again")
        detection = second_pass(photos, detection, predicted_corners(detection, best), work)
    added = sum(photo.added for photo in detection.photos)
    if added:
        run.listener.tell(Event.LOOKED_AGAIN, corners=added)
    return detection


@dataclass(frozen=True, kw_only=True, eq=False)
class _Expected:
    """A photo that a fitted camera expects corners in.

    Attributes:
        photo: where it is.
        expected: where it should show corners.

    """

    photo: Photo
    expected: Prediction

    @property
    def name(self) -> str:
        """The photo's."""
        return self.photo.name


def second_pass(
    photos: Sequence[Photo], detection: Detection, expected: Mapping[str, Prediction], work: Work
) -> Detection:
    """Add the corners that a camera fitted to the first pass predicts and the photos show.

    Args:
        photos: the photos that ``detection`` is of, in its order.
        detection: the first pass.
        expected: what it predicts of photos, by their names.
        work: who searches the photos.

    Returns:
        The detection with the added corners; the same one where nothing is expected.

    """
    size = detection.corners.image_size
    seen = {one.name: replace(one, size=size) for one in _make_paths_absolute(photos, work)}
    again = [_Expected(photo=seen[name], expected=one) for name, one in expected.items()]
    return with_added(detection, work.done(_search_again, again)) if again else detection


def _search_again(one: _Expected) -> Observations:
    return one.expected.seen_in(one.photo.read_grey())


def _make_paths_absolute(photos: Sequence[Photo], work: Work) -> Sequence[Photo]:
    """The photos by paths that hold wherever the work is done."""
    return photos if work.executor is None else [photo.absolute() for photo in photos]


def first_pass(
    photos: Sequence[Photo],
    targets: Sequence[Target],
    work: Work,
    cache: StrPath | None = None,
    *,
    faults: bool = True,
) -> Detection:
    """Find and name the corners of the one of several targets that explains most of them.

    Photos that cannot be read, or are not of the size that most have, are reported and passed
    over; those that are of that size but for a small factor are brought to it. The
    result does not depend on who does the work.

    Args:
        photos: the photos.
        targets: as for :func:`detect`.
        work: who searches the photos.
        cache: a folder in which what is found in files is kept; None searches them all.
        faults: as for :func:`detect`.

    Raises:
        ClusterError: the executor cannot do the work.
        DetectionError: no corner could be named by any of them; the text is that of the last, and
            says what to check.

    """
    kept = None if cache is None else GridCache(folder=Path(cache).absolute())
    detect_one = partial(detect_in_photo, target=next(iter(targets), None), cache=kept)

    def search(some: Sequence[Photo]) -> Sequence[PhotoDetection]:
        return work.done(detect_one, _make_paths_absolute(some, work))

    found = search(photos)
    if not targets:
        size = _find_common_size(found) or (0, 0)
        return nameless([photo.name for photo in photos], [one.grids for one in found], size)
    photos, found, resized = _at_one_size(photos, found, search)
    named, why = list[Detection](), DetectionError("")
    for target in targets:
        try:
            named.append(_name_corners(photos, found, target, faults=faults))
        except DetectionError as error:  # the last says why, where none does better
            why = error
    first = max(named, key=lambda one: (len(one.corners.pixel), -len(one.findings)), default=why)
    best = _begun_as_seen(first, targets[0], photos, kept, work)
    if isinstance(best, DetectionError):
        raise best
    return replace(best, findings=(*resized, *best.findings))


# A corner's error in a copy is so many times larger, in the pixels of the others: from here on a
# photo weighs too little beside them to be worth the doubt.
_MOST_TIMES = 2


def _at_one_size(
    photos: Sequence[Photo],
    found: Sequence[PhotoDetection],
    search: Callable[[Sequence[Photo]], Sequence[PhotoDetection]],
) -> tuple[Sequence[Photo], Sequence[PhotoDetection], list[Finding]]:
    """Read copies of another size in the size that most photos have, and search them in that.

    Whether the camera was set otherwise for such a photo, its fit shows.
    """
    most = _find_common_size(found)
    copies: dict[tuple[int, int], list[int]] = {}
    for index, one in enumerate(found):
        size = most if one.grids is None else one.grids.image_size
        if size is not None and most is not None and _is_near_copy(size, most):
            copies.setdefault(size, []).append(index)
    if most is None or not copies:
        return photos, found, []
    again = sorted(index for indices in copies.values() for index in indices)
    photos, found = [*photos], [*found]
    for index in again:
        photos[index] = replace(photos[index], size=most)
    for index, one in zip(again, search([photos[index] for index in again]), strict=True):
        found[index] = one
    return (
        photos,
        found,
        [
            Finding(
                code=Code.OTHER_SIZE,
                case="copy",
                images=tuple(photos[index].name for index in indices),
                figures=_figures_of_sizes(size, most),
            )
            for size, indices in copies.items()
        ],
    )


def _is_near_copy(size: tuple[int, int], most: tuple[int, int]) -> bool:
    widths = size[0], most[0]
    return is_reduced(size, most) and max(widths) < _MOST_TIMES * min(widths)


def _begun_as_seen(
    known: Detection | DetectionError,
    target: Target,
    photos: Sequence[Photo],
    cache: GridCache | None,
    work: Work,
) -> Detection | DetectionError:
    """The same, or what is read where boards of markers begin with the other square, if more."""
    corners = known.corners if isinstance(known, Detection) else None
    target = corners.target or target if corners is not None else target
    for index, board in boards_begun_otherwise(target, corners, known.findings).items():
        other = target.with_boards({index: board})
        detect_one = partial(detect_in_photo, target=other, cache=cache)
        found = work.done(detect_one, _make_paths_absolute(photos, work))
        try:
            seen = _name_corners(photos, found, other)
        except DetectionError:
            continue
        before = 0 if corners is None else int((corners.board == index).sum())
        now = int((seen.corners.board == index).sum())
        if now > before:
            told = begins_otherwise(board, now, before)
            target, corners = other, seen.corners
            known = replace(seen, findings=(told, *seen.findings))
    return known


def _make_photos(
    photos: StrPath | Mapping[str, Image] | Iterable[Image] | Iterable[StrPath] | Sequence[Photo],
) -> list[Photo]:
    if isinstance(photos, str | os.PathLike):
        return find_photos([photos])
    given: list[Any]
    if isinstance(photos, Mapping):
        names, given = list(photos), list(photos.values())
    else:
        given = list(photos)
        if given and all(isinstance(one, Photo) for one in given):
            return given
        if given and all(isinstance(one, str | os.PathLike) for one in given):
            return find_photos(given)
        names = [f"photo_{index}" for index in range(len(given))]
    if not given:
        raise DetectionError("no photo was given: pass pictures, or the names of files")
    names = list(Refusal(error=DetectionError).names(names, "photos"))
    for name, one in zip(names, given, strict=True):
        refuse_no_picture(one, name, DetectionError, kinds=(np.uint8, np.uint16))
    return [
        Photo(name=name, path=Path(name), picture=np.ascontiguousarray(one), has_file=False)
        for name, one in zip(names, given, strict=True)
    ]


# With these, where they are bad, names would be those of other corners.
_REFUSED = (Code.ANOTHER_TARGET, Code.CORNER_COUNT, Code.NOTHING_NAMED, Code.NO_MARKERS)


def _name_corners(
    photos: Sequence[Photo],
    found: Sequence[PhotoDetection],
    target: Target,
    *,
    faults: bool = True,
) -> Detection:
    """Name the corners of ``target`` that were found in photos.

    Raises:
        DetectionError: no corner could be named in any photo; the text says what to check.

    """
    size = _find_common_size(found)
    if size is None:
        raise DetectionError(findings=[_explain_nothing_read(found)])
    showing = [_is_showing_boards(one) for one in found]
    found = [
        _refuse_other_size(one, photo.name, size) for one, photo in zip(found, photos, strict=True)
    ]
    usable = [index for index, one in enumerate(found) if one.grids is not None]
    name = _name_by_markers if target.has_markers else _name_by_geometry
    names, used = [photos[index].name for index in usable], [found[index] for index in usable]
    target, told = _placed(names, used, target, size)
    corners, named, make_evidence = name(names, used, target, size)
    reports = _report_on_all(photos, found, dict(zip(usable, named, strict=True)), corners)
    lost = [report.loss for report in compress(reports, showing)]
    evidence = make_evidence(
        photos=len(photos),
        names=corners.images,
        picture=lambda number: photos[usable[number]].grey_if_readable(),
        target=target,
        with_boards=sum(showing),
        lost=[why for why in lost if why is not None],
    )
    findings = [*told]
    if faults or not len(corners.pixel):
        findings += find_faults(evidence)
    _refuse(findings, named=len(corners.pixel) > 0)
    if not len(corners.pixel):
        raise _explain_no_checkerboard(found)
    return Detection(
        corners=corners.only_seen()[0],
        photos=tuple(reports),
        findings=tuple(findings),
        other_colours=evidence.other_colours,
    )


def _report_on_all(
    photos: Sequence[Photo],
    found: Sequence[PhotoDetection],
    named: Mapping[int, PhotoReport],
    corners: Observations,
) -> list[PhotoReport]:
    """A report on each photo; on those that were ``named``, by index, with their corners."""
    reports = [
        PhotoReport(name=photo.name, refusal=detected.refusal)
        for photo, detected in zip(photos, found, strict=True)
    ]
    for number, (index, report) in enumerate(named.items()):
        reports[index] = report.with_corners(corners, number)
    return reports


def _placed(
    names: Sequence[str],
    detected: Sequence[PhotoDetection],
    target: Target,
    size: tuple[int, int],
) -> tuple[Target, list[Finding]]:
    """The target with the places that it does not know, as photos of one size show them."""
    if not target.unplaced:
        return target, []
    from cubicfish.observe.places import placed_by_grids, told_of_places, with_places

    if target.has_markers:
        marked = [one.marked for one in detected if one.marked is not None]
        placed = with_places(marked_corners(marked, target, size, names), target)
    else:
        grids = [one.grids.grids for one in detected if one.grids is not None]
        placed = placed_by_grids(grids, target, size, names)
    return placed, told_of_places(target, placed, target.board_names)


_Named = tuple[Observations, list[PhotoReport], Callable[..., PhotoEvidence]]
"""Named corners, a report on each photo, and what makes evidence of both."""


def _name_by_markers(
    names: Sequence[str],
    detected: Sequence[PhotoDetection],
    target: Target,
    size: tuple[int, int],
) -> _Named:
    """The corners that markers name in photos of one size."""
    marked = [one.marked for one in detected if one.marked is not None]
    grids = [one.grids for one in detected if one.grids is not None]
    corners = marked_corners(marked, target, size, names)
    reports = [
        PhotoReport(
            name=name,
            refusal=one.refusal,
            remarks=_report_twice_in_view(own, name, target),
            found=replace(shown, grids=()),
        )
        for name, one, own, shown in zip(names, detected, marked, grids, strict=True)
    ]
    return corners, reports, partial(MarkerEvidence, corners=corners, grids=grids)


def _name_by_geometry(
    names: Sequence[str],
    detected: Sequence[PhotoDetection],
    target: Target,
    size: tuple[int, int],
) -> _Named:
    """The corners that grids in photos of one size have by where they lie."""
    grids = [one.grids.grids for one in detected if one.grids is not None]
    identified = name_grids(grids, target, size, names)
    fits = nominal_target_fits(identified.grids, target)
    reports = [
        PhotoReport(
            name=name,
            refusal=one.refusal,
            remarks=remarks_of(name, own, odd=fits),
            exact=bool(exact),
            found=one.grids,
            grids=own,
        )
        for name, one, own, exact in zip(
            names, detected, identified.grids, identified.exact, strict=True
        )
    ]
    return identified.corners, reports, partial(GridEvidence, identified=identified)


def _refuse(findings: Sequence[Finding], *, named: bool) -> None:
    """Refuse corners that would have the names of others; or none, where that is explained."""
    for finding in findings:
        if finding.severity is Severity.BAD and finding.code in _REFUSED:
            raise DetectionError(findings=[finding])
        if finding.severity is not Severity.NOTE and not named:
            raise DetectionError(findings=[finding])


def _is_showing_boards(detected: PhotoDetection) -> bool:
    """Whether a photo shows squares in rows, and so many that they are likely a board's."""
    if detected.marked is not None and len(detected.marked) >= FEWEST_CORNERS:
        return True
    grids = () if detected.grids is None else detected.grids.grids
    return any(len(grid) >= FEWEST_CORNERS for grid in grids)


def _find_common_size(found: Sequence[PhotoDetection]) -> tuple[int, int] | None:
    """The size that most photos have; of equally frequent ones the first."""
    sizes = Counter(one.grids.image_size for one in found if one.grids is not None)
    return sizes.most_common(1)[0][0] if sizes else None


def _refuse_other_size(one: PhotoDetection, name: str, size: tuple[int, int]) -> PhotoDetection:
    if one.grids is None or one.grids.image_size == size:
        return one
    case = "turned" if one.grids.image_size[::-1] == size else ""
    figures = _figures_of_sizes(one.grids.image_size, size)
    return PhotoDetection(grids=None, refusal=make_refusal(name, Code.OTHER_SIZE, case, **figures))


def _figures_of_sizes(size: tuple[int, int], most: tuple[int, int]) -> dict[str, int]:
    return {"width": size[0], "height": size[1], "most_width": most[0], "most_height": most[1]}


def _report_twice_in_view(marked: MarkedCorners, name: str, target: Target) -> tuple[Finding, ...]:
    twice = partial(Finding, code=Code.TWICE_IN_VIEW, severity=Severity.CARE, images=(name,))
    return tuple(twice(boards=(target.boards[one].name,)) for one in marked.contradictory)


def _explain_nothing_read(found: Sequence[PhotoDetection]) -> Finding:
    if not found:
        return Finding(code=Code.NO_PHOTO, severity=Severity.BAD)
    first = next(one.refusal for one in found if one.refusal)
    case = "none_usable" if len(found) == 1 else "several"
    figures = {"first": first, "more": len(found) - 1}
    return Finding(code=Code.NO_PHOTO, case=case, severity=Severity.BAD, figures=figures)


def _explain_no_checkerboard(found: Sequence[PhotoDetection]) -> DetectionError:
    """Why no photo shows anything: what most of them say."""
    refusals = [one.refusal for one in found if one.refusal]
    kinds = Counter((refusal.code, refusal.case) for refusal in refusals)
    most = max(refusals, key=lambda refusal: kinds[refusal.code, refusal.case])
    most = replace(most, figures={**most.figures, "photos": len(found)})
    photos = f"{len(found):,} photo{'s' * (len(found) != 1)}"
    return DetectionError(f"{photos}, no checkerboard", findings=[most])
