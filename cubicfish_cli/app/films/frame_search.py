"""Searching many pictures of one camera for boards, until more pictures add hardly anything.

A quick search shows what each picture would add. Only if it misses boards, with small squares for
example, are they detected as `detect` does.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from cubicfish_cli.app.detection import first_pass
from cubicfish_cli.app.diagnosis.corner_count import squares_of_grids
from cubicfish_cli.app.diagnosis.evidence import GridEvidence
from cubicfish_cli.app.executors.pool import Work
from cubicfish_cli.app.films.choose import FEWEST, Choice, Patch, Seen, choose
from cubicfish_cli.app.films.measure import sharpness
from cubicfish_cli.app.films.scan import still_px
from cubicfish_cli.app.listener import Event
from cubicfish_cli.app.photo_detection import GridCache, detect_in_photo
from cubicfish_cli.app.photos import Photo
from cubicfish_cli.app.run import Run
from cubicfish_cli.app.sufficiency.information_gain import InformationGain
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.errors import DetectionError, FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.corners.detection.grids import FoundGrids
from cubicfish_cli.corners.identification.quick_detect import (
    QuickDetection,
    name_quick_detections,
    quick_detect_grids,
    quick_detect_markers,
)

# Where fewer of the pictures show the target, they do not tell which pictures are good.
_FEW, _FEW_SHARE = 3, 0.5
# Pictures have no more to add when hardly any of the last few is chosen.
_HARDLY_ANY = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What pictures show.

    Attributes:
        patches: corners by the names of the pictures that have any.
        pairs: the same as pairs; None where no target is known.
        target: the calibration target that they are of.
        findings: what is wrong with the target, as the pictures show it.

    """

    patches: dict[str, tuple[Patch, ...]] = field(default_factory=dict)
    pairs: Observations | None = None
    target: Target | None = None
    findings: tuple[Finding, ...] = ()

    def with_more(self, more: Found) -> Found:
        """Return these and what other pictures show."""
        one, other = self.pairs, more.pairs
        both = other if one is None else one if other is None else Observations.joined([one, other])
        return Found(
            patches={**self.patches, **more.patches},
            pairs=both,
            target=more.target or self.target,
            findings=(*self.findings, *more.findings),
        )

    @property
    def miscounted(self) -> Finding | None:
        """The finding that boards have other counts of corners than the target says; or None."""
        serious = (one for one in self.findings if one.severity is not Severity.NOTE)
        return next((one for one in serious if one.code is Code.CORNER_COUNT), None)


def found_in(
    photos: Sequence[Photo], targets: Sequence[Target] | None, work: Work, cache: Path | None
) -> Found:
    """Find corners of a target in photos, or grids as they are if none is known.

    Args:
        photos: all of one size.
        targets: what the target may be; None looks for any checkerboard.
        work: searches them, on one or several processes.
        cache: a folder that keeps what is found in files.

    Raises:
        DetectionError: no photo shows the target.

    """
    if targets:
        detection = first_pass(photos, targets, work, cache)
        return replace(_make_found_of_corners(detection.corners), findings=detection.findings)
    kept = None if cache is None else GridCache(folder=cache)
    found = work.done(partial(detect_in_photo, target=None, cache=kept), photos)
    return _make_found_of_grids([photo.name for photo in photos], [one.grids for one in found])


def _quick_detect(photo: Photo, *, marked: Target | None) -> QuickDetection | None:
    grey = photo.grey_if_readable()
    if grey is None:
        return None
    return quick_detect_grids(grey) if marked is None else quick_detect_markers(grey, marked)


def _make_found_of_grids(names: Sequence[str], found: Sequence[FoundGrids | None]) -> Found:
    patches = {
        name: tuple(Patch(board=-1, cells=grid.cells, pixel=grid.pixel) for grid in one.grids)
        for name, one in zip(names, found, strict=True)
        if one is not None and one.grids
    }
    return Found(patches=patches)


def _make_found_of_corners(corners: Observations) -> Found:
    cells = np.column_stack([corners.column, corners.row])
    patches = {}
    for number in np.unique(corners.image).tolist():
        here = corners.image == number
        patches[corners.images[number]] = tuple(
            Patch(
                board=int(board),
                cells=cells[own],
                pixel=corners.pixel[own],
                certain=bool(corners.certain[own].all()),
            )
            for board in np.unique(corners.board[here])
            for own in (here & (corners.board == board),)
        )
    pairs = corners if len(corners.pixel) else None
    return Found(patches=patches, pairs=pairs, target=corners.target)


@dataclass(kw_only=True, eq=False)
class Search:
    """A search through pictures, and what is chosen of them.

    Attributes:
        photos, seen: the pictures, and what is known of each.
        size: (width, height) of them.
        most: how many may be chosen.
        targets: what the target may be; None where none is known.
        run: how the work is done.
        what: what the pictures are, in the plural, for messages.
        at_once: how many are searched quickly before checking whether more would add anything.
        quick_jobs: number of processes for quick detection.
        searched: numbers of the pictures that were searched.
        choice: what is chosen of these.

    """

    photos: Sequence[Photo]
    seen: list[Seen]
    size: tuple[int, int]
    most: int
    targets: Sequence[Target] | None
    run: Run
    what: str
    at_once: int
    quick_jobs: int | None
    searched: set[int] = field(default_factory=set)
    choice: Choice = field(init=False)

    def search(self, good: Sequence[int], others: Sequence[int]) -> None:
        """Search good pictures quickly; only where these show little, others, and all fully.

        Args:
            good: numbers of pictures.
            others: those of worse ones.

        Raises:
            DetectionError: none shows the target, or they show another count of its corners.

        """
        found = Found()
        self._choose(found)
        for numbers in (good, others):
            found = self._search_quickly(numbers, found)
            if self._is_well_seen(found):
                return
        # All at once: it takes many photos to see what is wrong with the target.
        for numbers in (good, [*good, *others]) if others else (good,):
            try:
                found = self.detect(numbers)
            except DetectionError:
                if len(numbers) == len(good) + len(others):
                    raise
                continue
            self.searched.update(numbers)
            self._choose(found)
            if self._is_well_seen(found):
                return
        if found.miscounted is not None:
            raise DetectionError(found.miscounted.why, do=found.miscounted.do)

    def detect_quickly(self, numbers: Sequence[int]) -> Found:
        """Return what quick detection finds in some pictures."""
        photos = [self.photos[at] for at in numbers]
        names = [photo.name for photo in photos]
        work = replace(self.run, jobs=self.quick_jobs).work(f"Glancing at {self.what}")
        marked = [one for one in self.targets or () if one.has_markers][:1]
        seen = work.done(partial(_quick_detect, marked=marked[0] if marked else None), photos)
        if not self.targets:
            return _make_found_of_grids(
                names, [one if isinstance(one, FoundGrids) else None for one in seen]
            )
        corners, identified = name_quick_detections(seen, self.targets, self.size, names)
        found = _make_found_of_corners(corners)
        if identified is None or found.target is None:
            return found
        evidence = GridEvidence(
            photos=len(names),
            names=names,
            picture=lambda number: None,
            target=found.target,
            with_boards=len(names),
            lost=(),
            identified=identified,
        )
        return replace(found, findings=tuple(squares_of_grids(evidence)))

    def detect(self, numbers: Sequence[int]) -> Found:
        """Return what full detection finds in some pictures."""
        photos = [self.photos[at] for at in numbers]
        return found_in(photos, self.targets, self.run.work("Finding boards"), self.run.cache)

    def _search_quickly(self, numbers: Sequence[int], found: Found) -> Found:
        """Search pictures quickly, from first to last, until more add hardly anything."""
        rounds = math.ceil(len(numbers) / self.at_once)
        for first in range(rounds):
            some = numbers[first::rounds]
            found = found.with_more(self.detect_quickly(some))
            if found.target is not None:
                self.targets = [found.target]
            self.searched.update(some)
            self._choose(found)
            chosen = set(self.choice.order)
            new = chosen.intersection(some)
            nothing_new = self.choice.ended == "enough" and len(new) <= _HARDLY_ANY * len(some)
            if self.choice.ended == "asked" or (first and chosen - new and nothing_new):
                break
        return found

    def _is_well_seen(self, found: Found) -> bool:
        """Return whether the patches are those of the target, and enough for a camera."""
        seen, searched = len(found.patches), len(self.searched)
        if found.miscounted is not None or seen < max(_FEW, _FEW_SHARE * searched):
            return False
        return seen == searched or len(self.choice.order) >= min(FEWEST, self.most)

    def _choose(self, found: Found) -> None:
        """Choose by what pictures add to the camera, or by what they show if none is fitted."""
        names = [photo.name for photo in self.photos]
        self.seen = [
            replace(one, patches=found.patches.get(name, ()))
            for one, name in zip(self.seen, names, strict=True)
        ]

        def gains(quality: FloatArray) -> InformationGain | None:
            if found.pairs is None:
                return None
            try:
                return InformationGain(found.pairs, names, quality)
            except FitError:
                return None

        self.choice = choose(self.seen, self.size, self.most, still_px(self.size), gains)


def choose_photos(
    photos: Sequence[Photo], targets: Sequence[Target], run: Run, *, most: int
) -> tuple[list[Photo], str]:
    """Choose the photos that are worth calibrating from, in the order given.

    Args:
        photos: photos of one camera.
        targets: what the calibration target may be.
        run: how the work is done.
        most: how many photos may be chosen.

    Returns:
        The photos, and why there are no more, in a sentence.

    Raises:
        DetectionError: none shows the target.

    """
    measured = replace(run, executor=None).work("Measuring sharpness").done(_measure_photo, photos)
    known = Counter(one[0] for one in measured if one is not None)
    if not known:
        raise DetectionError("none of the photos can be read: check the files")
    size = known.most_common(1)[0][0]
    pairs = zip(photos, measured, strict=True)
    sharp = {photo: one[1] for photo, one in pairs if one is not None and one[0] == size}
    usual = list(sharp)
    search = Search(
        photos=usual,
        seen=[Seen(sharpness=one) for one in sharp.values()],
        size=size,
        most=most,
        targets=targets,
        run=run,
        what="photos",
        at_once=len(usual),
        quick_jobs=run.jobs,
    )
    search.search(range(len(usual)), ())
    return [usual[at] for at in sorted(search.choice.order)], why_ended(search.choice, "photo")


def why_ended(choice: Choice, what: str) -> str:
    """Return why no more pictures were chosen, in a sentence; ``what`` they are."""
    return Event(f"chosen_{choice.ended}").line(chosen=len(choice.order), what=what)


def _measure_photo(photo: Photo) -> tuple[tuple[int, int], float] | None:
    """Return a photo's (width, height) and sharpness; None for a damaged one, which is left out."""
    grey = photo.grey_if_readable()
    return None if grey is None else ((grey.shape[1], grey.shape[0]), sharpness(grey))
