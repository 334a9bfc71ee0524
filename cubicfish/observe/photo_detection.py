"""Detection in one photo: its grids and markers, or why there are none.

Grids of photos that were searched before are remembered, so that unchanged photos are not searched
again. An entry is named by the SHA-256 of the photo's bytes and by what searches: the version of
the package and of its finder's source. What the photo shows does not depend on its name or place.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cubicfish import __version__
from cubicfish.errors import OutputError, PhotoError
from cubicfish.files.whole_files import whole_file
from cubicfish.find import detection
from cubicfish.find.detection.diagnose import explain_no_grids
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.grids import FoundGrids, Grid, round_pixels
from cubicfish.find.detection.ladder import MOST_PIXELS
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.photos import demosaic as mosaic
from cubicfish.photos import photos
from cubicfish.photos.photos import Photo, Picture, PictureFile, grey
from cubicfish.target.target import Target

if TYPE_CHECKING:
    from cubicfish.find.detection.markers import MarkedCorners

_OF_GRID = [field.name for field in fields(Grid)]


@dataclass(frozen=True, kw_only=True)
class GridCache:
    """A folder with one file per photo.

    Attributes:
        folder: where the entries are; made when the first is written. None keeps nothing.

    """

    folder: Path | None = None

    def key(self, data: bytes, boards: Sequence[tuple[int, int]]) -> str:
        """Name of the entry of a photo with these bytes, searched for boards of such sizes."""
        if self.folder is None:
            return ""
        sizes = hashlib.sha256(repr(sorted(map(sorted, boards))).encode()).hexdigest()[:8]
        return f"{hashlib.sha256(data).hexdigest()[:32]}-{sizes}-{_hash_sources()}"

    def load(self, key: str) -> FoundGrids | None:
        """The entry, or None where there is none or it is damaged."""
        if self.folder is None:
            return None
        try:
            path = self.folder / f"{key}.npz"
            if not path.is_file():  # a pipe would be waited for
                return None
            # Through memory: numpy leaves a damaged file open.
            data = io.BytesIO(path.read_bytes())
            with np.load(data, allow_pickle=False) as entry:
                if str(entry["key"]) != key:  # another photo's, under a name that is not its own
                    return None
                count = int(entry["count"])
                width, height = (int(side) for side in entry["image_size"])
                return FoundGrids(
                    grids=tuple(
                        Grid(**{name: entry[f"{name}_{index}"][()] for name in _OF_GRID})
                        for index in range(count)
                    ),
                    refused=entry["refused"],
                    image_size=(width, height),
                )
        except Exception:  # whatever an entry raises that is missing, cut short or overwritten
            return None

    def keep(self, key: str, found: FoundGrids) -> FoundGrids:
        """Save what was found, without the digits that differ from one process to another."""
        grids = tuple(replace(one, pixel=round_pixels(one.pixel)) for one in found.grids)
        found = replace(found, grids=grids)
        self.save(key, found)
        return found

    def save(self, key: str, found: FoundGrids) -> None:
        """Write an entry; a cache that cannot be written is no cache, and no error."""
        if self.folder is None:
            return
        parts = {
            f"{name}_{index}": getattr(grid, name)
            for index, grid in enumerate(found.grids)
            for name in _OF_GRID
        }
        try:
            with whole_file(self.folder / f"{key}.npz", overwrite=True) as temporary:
                np.savez_compressed(
                    temporary,
                    key=key,
                    count=len(found.grids),
                    refused=found.refused,
                    image_size=np.array(found.image_size),
                    allow_pickle=False,
                    **parts,
                )
        except OutputError:
            return


@cache
def _hash_sources() -> str:
    """The package's version and a hash of the source that reads pictures and finds grids."""
    digest = hashlib.sha256(__version__.encode())
    finding = sorted(Path(str(detection.__file__)).parent.glob("*.py"))
    reading = [Path(str(module.__file__)) for module in (photos, mosaic)]
    for path in (Path(__file__), *reading, *finding):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoDetection:
    """What was detected in a photo.

    Attributes:
        grids: its grids; None where it is of no use.
        refusal: why nothing was searched for, or found, in it.
        marked: the corners that its markers name, where the target has any.

    """

    grids: FoundGrids | None
    refusal: Finding | None = None
    marked: MarkedCorners | None = None

    @property
    def is_empty(self) -> bool:
        """Whether no corner was found: none that markers name, where the target has any."""
        named = self.marked
        return not (len(named) if named is not None else self.grids and self.grids.grids)


def detect_in_photo(
    photo: Photo, *, target: Target | None, cache: GridCache | None
) -> PhotoDetection:
    """Read a photo and search it.

    Args:
        photo: the photo.
        target: the calibration target; None where nobody says which it is, and nobody asks why
            there is none.
        cache: what was found in photos that were searched before; None searches it.

    """
    try:
        # A photo is known again by its file's bytes, also where its picture is at hand.
        needed = photo.picture is None or cache is not None
        data = PictureFile.read(photo.path).data if photo.has_file and needed else b""
        picture = lru_cache(maxsize=1)(partial(_read_picture, photo, data))
        # What is in memory has no bytes to know it by.
        kept = cache if cache and data and photo.size is None else GridCache()
        find = lru_cache(maxsize=1)(partial(_find_squares, data, picture, target, kept))
        if target is not None and target.has_markers:
            detected = _look_for_markers(picture, target, find)
        else:
            detected = PhotoDetection(grids=find())
    except PhotoError as error:
        why = make_refusal(photo.name, Code.CANNOT_BE_READ, problem=str(error))
        return PhotoDetection(grids=None, refusal=why)
    if target is None or not detected.is_empty:
        return detected
    if target.has_markers and find().grids:
        return replace(detected, refusal=_explain_no_markers(photo.name, picture(), target))
    why = explain_no_grids(picture(), find())
    return replace(detected, refusal=replace(why, severity=Severity.CARE, images=(photo.name,)))


def _find_squares(
    data: bytes, picture: Callable[[], Picture], target: Target | None, kept: GridCache
) -> FoundGrids:
    """The grids of squares in a picture, or what is kept of it."""
    boards = _list_boards(target)
    key = kept.key(data, boards)
    return kept.load(key) or kept.keep(key, find_grids(picture(), boards))


def _list_boards(target: Target | None) -> list[tuple[int, int]]:
    """(Columns, rows) of the boards that show as grids of squares."""
    boards = () if target is None else target.boards
    return [(board.columns, board.rows) for board in boards if board.has_squares]


def _read_picture(photo: Photo, data: bytes) -> Picture:
    if photo.picture is None and data:
        return photo.sized(grey(PictureFile(path=photo.path, data=data).picture()))
    return photo.read_grey()


def make_refusal(name: str, code: Code, case: str = "", **figures: int | str) -> Finding:
    """Why a photo is of no use."""
    return Finding(code=code, case=case, severity=Severity.CARE, images=(name,), figures=figures)


def _explain_no_markers(name: str, picture: Picture, target: Target) -> Finding:
    """Why nothing is named where squares are: no marker of the target, or some that do not do."""
    from cubicfish.find.detection.markers_measure import markers_of  # for them alone

    read = markers_of(picture, target)
    if not read:
        return make_refusal(name, Code.NO_MARKERS)
    return make_refusal(name, Code.NO_MARKERS, "unplaced", markers=read)


def _look_for_markers(
    picture: Callable[[], Picture], target: Target, find: Callable[[], FoundGrids]
) -> PhotoDetection:
    """What markers name, by the first look that shows any: each costs more than those before."""
    look = partial(_detect_markers, picture, target)
    if target.has_only_markers:
        # Markers say where their boards are: nothing else is searched for squares.
        alone = look(None)
        if not alone.is_empty:
            return alone
    grids = find()
    plain = look(grids)
    width, height = grids.image_size
    if not plain.is_empty or 4 * width * height > MOST_PIXELS:
        return plain
    for known in (None, grids) if target.has_only_markers else (grids,):
        closer = look(known, closely=True)
        if not closer.is_empty:
            return closer
    return plain


def _detect_markers(
    picture: Callable[[], Picture],
    target: Target,
    grids: FoundGrids | None,
    *,
    closely: bool = False,
) -> PhotoDetection:
    from cubicfish.find.detection.markers import find_marked_corners  # for them alone

    marked = find_marked_corners(picture(), target, grids, closely=closely)
    marked = replace(marked, pixel=round_pixels(marked.pixel))
    if grids is None:
        height, width = picture().shape
        grids = FoundGrids.not_searched((width, height))
    return PhotoDetection(grids=grids, marked=marked)
