"""Photos -> named corners of the target's boards, with what became of every photo."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cubicfish_cli.correspondences import Corners
from cubicfish_cli.detection.diagnose import explain_no_grids
from cubicfish_cli.detection.finder import find_grids
from cubicfish_cli.detection.grid_cache import GridCache
from cubicfish_cli.detection.grids import FoundGrids, Grid
from cubicfish_cli.detection.markers import MarkedCorners, find_marked_corners
from cubicfish_cli.errors import DetectionError, PhotoError
from cubicfish_cli.executors.executor import Executor
from cubicfish_cli.executors.pool import map_photos, settled, workers_for
from cubicfish_cli.identification.marked import (
    has_markers,
    marked_corners,
    otherwise_printed,
    unseen_markers,
)
from cubicfish_cli.identification.name_grids import GridReport, Identified, name_grids
from cubicfish_cli.identification.refusals import (
    counted_squares,
    grid_boards,
    nothing_named,
    wrong_object,
)
from cubicfish_cli.identification.remarks import remark_of
from cubicfish_cli.identification.wrong_drawing.miscounted import counted, miscounted
from cubicfish_cli.identification.wrong_drawing.misdrawn import misdrawn
from cubicfish_cli.photos import Photo, Picture, decode_picture, grey, read_file
from cubicfish_cli.target import Target
from cubicfish_cli.words.catalogue import catalogue
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding
from cubicfish_cli.words.phrases import plural

_NOT_NAMED = "no corner can be named"


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoReport:
    """What became of one photo.

    Attributes:
        name: the photo's name.
        refusal: why nothing was looked for, or found, in it; None where something was.
        remarks: what is told of its grids and boards: left out, or named by convention.
        boards: names of the boards that were found in it, in the target's order.
        corners: how many corners were named.
        added: how many of them a second pass added.
        exact: whether these are surely the corners that they are named as; see
            :class:`cubicfish_cli.identification.name_grids.Identified`.
        found: everything that was found in it, named or not; None when it could not be used.
        grids: what became of each of ``found.grids``.

    """

    name: str
    refusal: Finding | None = None
    remarks: tuple[Finding, ...] = ()
    boards: tuple[str, ...] = ()
    corners: int = 0
    added: int = 0
    exact: bool = True
    found: FoundGrids | None = None
    grids: tuple[GridReport, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is told of it, thing by thing."""
        return self.remarks if self.refusal is None else (self.refusal,)

    @property
    def lost(self) -> bool:
        """Whether it gave no corners, for a reason that is known."""
        none_named = bool(self.grids) and not any(grid.named for grid in self.grids)
        return self.refusal is not None or (none_named and bool(self.remarks))

    @property
    def problem(self) -> str | None:
        """One line that says why it gave no corners; None when it did."""
        return "; ".join(finding.line for finding in self.findings) if self.lost else None

    @property
    def notes(self) -> tuple[str, ...]:
        """One line for each grid that was left out, or named by convention."""
        return tuple(remark.line for remark in self.remarks)


@dataclass(frozen=True, kw_only=True, eq=False)
class Detection:
    """The corners found in a set of photos.

    Attributes:
        corners: the named corners; ``images`` are the photos that have some.
        photos: a report on every photo, in the order given.
        findings: what is likely wrong with photos or target, where many grids fit nowhere.
        other_colours: whether the only board is light where the target says that it is dark.

    """

    corners: Corners
    photos: tuple[PhotoReport, ...]
    findings: tuple[Finding, ...] = ()
    other_colours: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """What a worker hands back: the grids, or why there are none."""

    grids: FoundGrids | None
    refusal: Finding | None = None
    marked: MarkedCorners | None = None
    digest: str = ""  # of the file's bytes


def detect_corners(
    photos: Sequence[Photo],
    target: Target,
    *,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    cache: GridCache | None = None,
    executor: Executor | None = None,
) -> Detection:
    """Find and name the corners of ``target`` in photos.

    Photos that cannot be read, or are not of the size that most have, are reported and passed
    over. The result does not depend on ``jobs``.

    Args:
        photos: where the photos are.
        target: the object.
        jobs: processes to use; None for one a processor.
        progress: called with photos done and all photos.
        cache: what was found in photos that were searched before; None searches them all.
        executor: who looks at the photos instead of processes here.

    Raises:
        ClusterError: ``executor`` cannot do the work.
        DetectionError: no corner could be named in any photo; the text says what to check.

    """
    found = []
    look = partial(_find, target=target, cache=cache)
    seen = photos if executor is None else [photo.absolute() for photo in photos]
    for one in map_photos(look, seen, workers_for(jobs, len(photos)), executor):
        found.append(one)
        if progress is not None:
            progress(len(found), len(photos))
    size = _common_size(found)
    if size is None:
        raise _refused(_nothing_read(found))
    found = [_of_size(one, photo.name, size) for one, photo in zip(found, photos, strict=True)]
    usable = [index for index, one in enumerate(found) if one.grids is not None]
    names = [photos[index].name for index in usable]
    reports = [
        PhotoReport(name=photo.name, refusal=one.refusal)
        for photo, one in zip(photos, found, strict=True)
    ]
    copies = _copies(names, [found[index].digest for index in usable])
    findings = [] if copies is None else [copies]
    other_colours = False
    if has_markers(target):
        marked = [_marked(found[index]) for index in usable]
        corners = marked_corners(marked, target, size, names)
        finding = _why_unseen([(photos[index], found[index]) for index in usable], corners, target)
        findings += [] if finding is None else [finding]
        if not len(corners.pixel):
            if finding is not None:
                raise DetectionError(_NOT_NAMED, do=finding.line)
            raise _refused(_no_markers(len(found), target))
        for number, index in enumerate(usable):
            reports[index] = _marked_report(names[number], found[index], corners, number)
    else:
        grids = [_grids(found[index]) for index in usable]
        identified = name_grids(grids, target, size, names)
        corners = identified.corners
        refusal = counted_squares(identified, target)
        if refusal is not None:
            raise _refused(refusal)

        def picture(number: int) -> Picture | None:
            return _brightness(photos[usable[number]])

        counts = counted(identified, target, picture)
        refusal = wrong_object(identified, counts, target) if len(corners.pixel) else None
        finding = None if counts else misdrawn(identified, target)
        if finding is None and refusal is not None:
            raise _refused(refusal)
        finding = finding or miscounted(counts, target, len(usable))
        findings += [] if finding is None else [finding]
        other_colours = identified.other_colours
        if other_colours:
            findings.append(_other_colours(target))
        if finding is not None and not len(corners.pixel):
            raise DetectionError(_NOT_NAMED, do=finding.line)
        if not len(corners.pixel):
            raise _nothing_named(found, identified, target)
        for number, index in enumerate(usable):
            reports[index] = _report(names[number], found[index], identified, number, target)
    return Detection(
        corners=_only_seen(corners),
        photos=tuple(reports),
        findings=tuple(findings),
        other_colours=other_colours,
    )


def _copies(names: Sequence[str], digests: Sequence[str]) -> Finding | None:
    """Photos that are the same file as an earlier one, byte by byte."""
    first: dict[str, str] = {}
    pairs = []
    for name, digest in zip(names, digests, strict=True):
        if digest and first.setdefault(digest, name) != name:
            pairs.append((first[digest], name))
    if not pairs:
        return None
    return Finding(
        code=Code.REPEATS,
        case="copies",
        images=tuple(name for name in names if any(name in pair for pair in pairs)),
        figures={"repeats": [f"{one} = {other}" for one, other in pairs]},
    )


def _other_colours(target: Target) -> Finding:
    board = grid_boards(target.as_printed())[0]
    first = board.first_square
    return Finding(
        code=Code.MIRRORED,
        case="colours_in_mirror" if target.mirrored else "colours",
        boards=(board.name,),
        figures={
            "board": board.name,
            "first_square": first,
            "other": "light" if first == "dark" else "dark",
        },
    )


def _find(photo: Photo, *, target: Target, cache: GridCache | None) -> _Found:
    try:
        data = read_file(photo.path) if photo.picture is None else b""
    except PhotoError as error:
        return _Found(grids=None, refusal=_unreadable(photo, error))
    digest = hashlib.sha256(data).hexdigest() if data else ""
    return replace(_searched(photo, data, target, cache), digest=digest)


def _searched(photo: Photo, data: bytes, target: Target, cache: GridCache | None) -> _Found:
    markers = has_markers(target)
    try:
        cache = cache if data else None  # what is in memory has no bytes to know it by
        key = cache.key(data) if cache else ""
        known = cache.load(key) if cache else None
        if known is not None and known.grids and not markers:
            return _Found(grids=known)
        picture = grey(decode_picture(photo.path, data)) if data else photo.read_grey()
    except PhotoError as error:
        return _Found(grids=None, refusal=_unreadable(photo, error))
    grids = _settled(find_grids(picture)) if known is None else known
    if cache and known is None:
        cache.save(key, grids)
    if markers:
        marked = find_marked_corners(picture, target, grids)
        marked = replace(marked, pixel=settled(marked.pixel))
        why = None if len(marked) else _why_no_markers(photo, picture, grids)
        return _Found(grids=grids, refusal=why, marked=marked)
    return _Found(grids=grids, refusal=None if grids.grids else _why_nothing(photo, picture, grids))


def _settled(found: FoundGrids) -> FoundGrids:
    grids = tuple(replace(grid, pixel=settled(grid.pixel)) for grid in found.grids)
    return replace(found, grids=grids)


def _unreadable(photo: Photo, error: PhotoError) -> Finding:
    return _of_photo(photo.name, Code.CANNOT_BE_READ, problem=str(error))


def _of_photo(name: str, code: Code, case: str = "", **figures: int | str) -> Finding:
    """Why a photo is of no use."""
    return Finding(code=code, case=case, severity=Severity.CARE, images=(name,), figures=figures)


def _why_nothing(photo: Photo, picture: Picture, found: FoundGrids) -> Finding:
    why = explain_no_grids(picture, found)
    return replace(why, severity=Severity.CARE, images=(photo.name,))


def _common_size(found: Sequence[_Found]) -> tuple[int, int] | None:
    """The size that most photos have; of equally frequent ones the first."""
    sizes = Counter(one.grids.image_size for one in found if one.grids is not None)
    return sizes.most_common(1)[0][0] if sizes else None


def _of_size(one: _Found, name: str, size: tuple[int, int]) -> _Found:
    if one.grids is None or one.grids.image_size == size:
        return one
    width, height = one.grids.image_size
    figures = {"width": width, "height": height, "most_width": size[0], "most_height": size[1]}
    case = "turned" if (height, width) == size else ""
    return _Found(grids=None, refusal=_of_photo(name, Code.OTHER_SIZE, case, **figures))


def _brightness(photo: Photo) -> Picture | None:
    """What a photo shows, once more; None where it is there no longer."""
    try:
        return photo.read_grey()
    except PhotoError:
        return None


def _grids(one: _Found) -> tuple[Grid, ...]:
    return one.grids.grids if one.grids is not None else ()


def _report(
    name: str, one: _Found, identified: Identified, number: int, target: Target
) -> PhotoReport:
    grids = identified.grids[number]
    named = [grid for grid in grids if grid.place is not None]
    boards = sorted({grid.place.board for grid in grids if grid.place is not None})
    remarks = (remark_of(name, grid) for grid in grids)
    return PhotoReport(
        name=name,
        refusal=one.refusal,
        remarks=tuple(remark for remark in remarks if remark is not None),
        boards=tuple(target.boards[board].name for board in boards),
        corners=sum(grid.corners for grid in named),
        exact=bool(identified.exact[number]),
        found=one.grids,
        grids=grids,
    )


def _why_unseen(
    photos: Sequence[tuple[Photo, _Found]], corners: Corners, target: Target
) -> Finding | None:
    """Why no photo shows the markers of some boards, where it is that they are otherwise."""
    unseen = unseen_markers(corners, target)
    if not unseen:
        return None

    def richest() -> Iterator[tuple[Picture, FoundGrids]]:
        for photo, one in sorted(photos, key=lambda both: -sum(map(len, _grids(both[1])))):
            shown = _brightness(photo)
            if shown is not None and one.grids is not None:
                yield shown, one.grids

    return otherwise_printed(richest(), target, unseen)


def _marked(one: _Found) -> MarkedCorners:
    if one.marked is None:
        raise ValueError("a photo of a target with markers was not searched for them")
    return one.marked


def _marked_report(name: str, one: _Found, corners: Corners, number: int) -> PhotoReport:
    own = corners.image == number
    return PhotoReport(
        name=name,
        refusal=one.refusal,
        remarks=tuple(
            Finding(
                code=Code.TWICE_IN_VIEW,
                severity=Severity.CARE,
                images=(name,),
                boards=(corners.boards[board],),
            )
            for board in _marked(one).contradictory
        ),
        boards=tuple(corners.boards[board] for board in np.unique(corners.board[own])),
        corners=int(own.sum()),
        found=replace(one.grids, grids=()) if one.grids is not None else None,
    )


def _why_no_markers(photo: Photo, picture: Picture, found: FoundGrids) -> Finding:
    if not found.grids:
        return _why_nothing(photo, picture, found)
    return _of_photo(photo.name, Code.NO_MARKERS)


def _no_markers(photos: int, target: Target) -> Finding:
    families = sorted({board.markers.dictionary for board in target.boards if board.markers})
    figures = {"photos": photos, "families": ", ".join(families)}
    return Finding(code=Code.NO_MARKERS, case="all", severity=Severity.BAD, figures=figures)


def _only_seen(corners: Corners) -> Corners:
    """The same corners, without the photos that have none."""
    seen, image = np.unique(corners.image, return_inverse=True)
    return replace(
        corners,
        images=tuple(corners.images[index] for index in seen),
        image=image.astype(np.intp),
    )


def _refused(finding: Finding) -> DetectionError:
    return DetectionError(finding.why, do=finding.do)


def _nothing_read(found: Sequence[_Found]) -> Finding:
    if not found:
        return Finding(code=Code.NO_PHOTO, severity=Severity.BAD)
    first = next(one.refusal.line for one in found if one.refusal)
    case = "none_usable" if len(found) == 1 else "several"
    figures = {"first": first, "more": len(found) - 1}
    return Finding(code=Code.NO_PHOTO, case=case, severity=Severity.BAD, figures=figures)


def _nothing_named(
    found: Sequence[_Found], identified: Identified, target: Target
) -> DetectionError:
    if any(identified.grids):
        return _refused(nothing_named(identified, target))
    refusals = [one.refusal for one in found if one.refusal]
    lines = Counter(refusal.line for refusal in refusals)
    most = max(refusals, key=lambda refusal: lines[refusal.line])
    if (most.code, "all") in catalogue().sayings:
        figures = {**most.figures, "photos": len(found)}
        return DetectionError(replace(most, case="all", figures=figures).line)
    return DetectionError(f"{plural(len(found), 'photo')}, no checkerboard: {most.line}")
