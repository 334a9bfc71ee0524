"""What a camera is calibrated from or measured on: photos, films or tables -> 2D-3D pairs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cubicfish import (
    CorrespondenceError,
    Detection,
    Event,
    Finding,
    Observations,
    Run,
    load_corners,
)
from cubicfish.files import Fingerprint
from cubicfish_cli.inputs.paths import (
    InputKind,
    is_recording,
    is_video,
    named_photos,
    not_excluded,
)
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.words.phrases import plural
from cubicfish_cli.words.remarks import line_of
from cubicfish_cli.words.sentences import record_of

if TYPE_CHECKING:
    from cubicfish import Calibration
    from cubicfish.photos import Photo

# Of more photos than these, some are as good as all.
_MANY = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """Corners or points with their world points, and what they came from.

    Attributes:
        pairs: the corners or points, sorted by photo.
        corners: the named corners in the order that they came in; None for points without names.
        detection: what was found in each photo; None for CSV files.
        files: every file that was read, in order, as it was before.
        target_file: the target's.
        chosen: why no more photos were chosen, in a sentence; None where all were taken.

    """

    pairs: Observations
    files: tuple[Fingerprint, ...]
    corners: Observations | None = None
    detection: Detection | None = None
    target_file: Fingerprint | None = None
    chosen: str | None = None

    @property
    def given(self) -> Detection | Observations:
        """What was given, as a fit takes it."""
        return self.detection or self.pairs

    @property
    def photos(self) -> list[Path]:
        """The photos' files; none of CSV files."""
        return [] if self.detection is None else [file.path for file in self.files]

    @property
    def photo_findings(self) -> list[Finding]:
        """What is reported of photos and grids."""
        photos = () if self.detection is None else self.detection.photos
        return [one for photo in photos for one in photo.findings]

    def named_by(self, fitted: Calibration) -> Inputs:
        """The same with the names that a fit gave the corners."""
        corners = self.corners and fitted.named(self.corners)
        return replace(self, pairs=fitted.named(self.pairs), corners=corners)

    def without(self, exclude: Sequence[Path]) -> Inputs:
        """The same of a table without the rows of some photos.

        Raises:
            PhotoError: as :func:`not_excluded`.

        """
        photos = [(name, Path(name)) for name in self.pairs.images]
        pairs = self.pairs.of_photos(np.array(not_excluded(photos, exclude)))
        return replace(self, pairs=pairs, corners=self.corners and pairs)

    def nominal(self, target: TargetSource) -> str | None:
        """The text of a target that is in no file yet."""
        thing = self.pairs.target
        return thing.text() if target.needs_file and thing is not None else None

    def remarks(self, more: Iterable[Finding] = ()) -> dict[str, Any]:
        """What is reported of photos and grids, in lines and as records, and records of others."""
        found = self.photo_findings
        return {
            "photo_problems": None if self.detection is None else list(map(line_of, found)),
            "remarks": [record_of(one) for one in (*found, *more)],
        }


def load_inputs(
    kind: InputKind,
    inputs: Sequence[Path],
    target: TargetSource,
    run: Run,
    *,
    image_size: tuple[int, int] | None = None,
    most: int | None = None,
    exclude: Sequence[Path] = (),
    unplaced: bool = False,
    made: Sequence[Photo] = (),
) -> Inputs:
    """Read pairs from photos, one corners.csv or one correspondences.csv, which are checked.

    Args:
        kind: what the inputs are.
        inputs: the photos, or the table.
        target: what they show.
        run: how the work is done.
        image_size: (width, height) of the photos, for tables that do not say.
        most: of more photos than these, those that add most are taken.
        exclude: photos that are left out, by their names or by patterns.
        unplaced: whether the places of the target's boards may be unknown.
        made: those of the inputs whose pictures are at hand, and are not read again.

    Raises:
        CubicfishError: an input cannot be used.

    """
    if kind == "photos":
        loaded = _find_in_photos(inputs, target, run, most, exclude, unplaced, made)
    elif kind == "corners":
        target_file, file = target.fingerprint(), Fingerprint.of(inputs[0])
        corners = load_corners(
            inputs[0], target.load(run.listener, unplaced=unplaced)[0], image_size=image_size
        )
        loaded = Inputs(pairs=corners, corners=corners, files=(file,), target_file=target_file)
    else:
        file = Fingerprint.of(inputs[0])
        loaded = Inputs(pairs=load_corners(inputs[0], image_size=image_size), files=(file,))
    if exclude and kind != "photos":
        loaded = loaded.without(exclude)
    pixel = loaded.pairs.pixel
    if len(pixel) > 1 and float((pixel.max(axis=0) - pixel.min(axis=0)).max()) < 1:
        x, y = pixel[0]
        raise CorrespondenceError(
            f"all {plural(len(pixel), 'corner')} are at x {x:g}, y {y:g}: check the columns x and y"
        )
    return loaded


def _find_in_photos(
    inputs: Sequence[Path],
    target: TargetSource,
    run: Run,
    most: int | None,
    exclude: Sequence[Path],
    unplaced: bool,
    made: Sequence[Photo],
) -> Inputs:
    # Tables need no finder of corners, and begin at once without it.
    from cubicfish import detect

    target_file = target.fingerprint()
    targets = target.load(run.listener, unplaced=unplaced)
    photos, ended = named_photos(inputs, run.listener, exclude), None
    pictures = {one.path: one.picture for one in made}
    photos = [replace(one, picture=pictures.get(one.path)) for one in photos]
    if most is not None and len(photos) > most:
        from cubicfish_cli.films.frame_search import choose_photos

        count = len(photos)
        photos, ended = choose_photos(photos, targets, run, most=most)
        run.listener.tell(Event.PHOTOS_CHOSEN, chosen=len(photos), photos=count, ended=ended)
    elif most is None and len(photos) > _MANY:
        run.listener.tell(Event.MANY_PHOTOS, photos=len(photos))
    files = tuple(Fingerprint.of(photo.path) for photo in photos)
    detection = detect(photos, targets, run)
    return Inputs(
        pairs=detection.corners,
        corners=detection.corners,
        detection=detection,
        files=files,
        target_file=target_file,
        chosen=ended,
    )


def films_among(inputs: Sequence[Path]) -> list[Path]:
    """Those of the inputs that are films, recordings or patterns of such, by their names."""
    return [path for path in inputs if is_video(path) or is_recording(path)]
