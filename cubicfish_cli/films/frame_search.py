"""Searching many pictures of one camera for boards, until more pictures add hardly anything.

A quick search shows what each picture would add. Only if it misses boards, with small squares for
example, are they detected as `detect` does: some of the pictures in which it saw none tell that.
Pictures of a film are searched where those before and after show boards.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cubicfish import (
    Detection,
    DetectionError,
    Finding,
    FitError,
    FloatArray,
    Observations,
    Run,
    Target,
    detect,
)
from cubicfish.judge import Code, Severity
from cubicfish.observe import Glances
from cubicfish.photos import Photo
from cubicfish.sufficiency import InformationGain
from cubicfish_cli.films.choose import FEWEST, Choice, Patch, Seen, choose
from cubicfish_cli.films.measure import sharpness
from cubicfish_cli.films.scan import still_px
from cubicfish_cli.words.events import why_ended

# Where fewer of the pictures show the target, they do not tell which pictures are good.
_FEW, _FEW_SHARE = 3, 0.5
# So many pictures, from all over, tell whether those are empty in which a quick search saw nothing:
# if it missed boards in a fifth of them, it goes unnoticed once in fifteen times.
_PROBES = 12
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

    @classmethod
    def of(cls, detection: Detection) -> Found:
        """Return what was detected; grids as they are where no target is known."""
        corners = detection.corners
        if corners.target is None:
            return cls(patches=_make_patches_of_grids(detection))
        pairs = corners.only_seen()[0] if len(corners.pixel) else None
        return cls(
            patches=patches_of_corners(corners),
            pairs=pairs,
            target=corners.target,
            findings=detection.findings,
        )

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
        return next((one for one in serious if one.code == Code.CORNER_COUNT), None)


def _spread(numbers: Sequence[int], most: int) -> list[int]:
    """Return so many of the numbers at most, from all over."""
    rounds = max(1, math.ceil(len(numbers) / most))
    return list(numbers[rounds // 2 :: rounds])


def _make_patches_of_grids(detection: Detection) -> dict[str, tuple[Patch, ...]]:
    shown = {one.name: one.found.grids for one in detection.photos if one.found is not None}
    return {
        name: tuple(Patch(board=-1, cells=grid.cells, pixel=grid.pixel) for grid in grids)
        for name, grids in shown.items()
        if grids
    }


def patches_of_corners(corners: Observations) -> dict[str, tuple[Patch, ...]]:
    """What each photo shows, by its name, as far as its corners have names."""
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
    return patches


@dataclass(kw_only=True, eq=False)
class Search:
    """A search through pictures, and what is chosen of them.

    Attributes:
        glances: the pictures, and what they show at a glance.
        seen: what is known of each picture.
        most: how many may be chosen.
        targets: what the target may be; None where none is known.
        run: how the work is done.
        what: what the pictures are, in the plural, for messages.
        at_once: how many are searched quickly before checking whether more would add anything.
        quick_jobs: number of processes for quick detection.
        searched: numbers of the pictures that were searched.
        choice: what is chosen of these.

    """

    glances: Glances
    seen: list[Seen]
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
        every = [*good, *others]
        if self._is_all_seen(found, every):
            return
        if self.glances.is_film and not self.glances.any_seen:
            self.detect(_spread(every, self.at_once))  # and no other if these show nothing
        self._search_fully(good, others)

    def _is_all_seen(self, found: Found, every: Sequence[int]) -> bool:
        """Return whether nothing is to be seen in those pictures that seem to be empty."""
        unseen = [at for at in every if self.glances.photos[at].name not in found.patches]
        if found.miscounted is not None or len(found.patches) < _FEW:
            return False
        # Boards that were seen and cannot be named may be others than the target says.
        unnamed = sum(map(self.glances.shows, unseen))
        return unnamed <= _HARDLY_ANY * len(every) and self._are_empty(unseen, _PROBES)

    def _search_fully(self, good: Sequence[int], others: Sequence[int]) -> None:
        """Detect boards in good pictures, and in all where these show little.

        All at once: it takes many photos to see what is wrong with the target.
        """
        for numbers in (good, [*good, *others]) if others else (good,):
            try:
                found = self.detect(numbers)
            except DetectionError:
                if len(numbers) == len(good) + len(others) or self._are_empty(others, _PROBES):
                    raise
                continue
            self.searched.update(numbers)
            self._choose(found)
            if self._is_well_seen(found):
                return
        if found.miscounted is not None:
            raise DetectionError(findings=[found.miscounted])

    def _are_empty(self, numbers: Sequence[int], most: int) -> bool:
        """Return whether hardly any of a few among these pictures, from all over, shows the target.

        A finding on the target's counts is one that the others may explain.
        """
        probes = _spread(numbers, most)
        try:
            found = self.detect(probes)
        except DetectionError:
            return True
        return found.miscounted is None and len(found.patches) <= _HARDLY_ANY * len(probes)

    def detect_quickly(self, numbers: Sequence[int]) -> Found:
        """Return what quick detection finds in some pictures.

        In others too that were searched before, of a film, if a board is found next to them.
        """
        work = replace(self.run, jobs=self.quick_jobs).work(f"Glancing at {self.what}")
        return Found.of(self.glances.look(numbers, self.targets or (), work))

    def detect(self, numbers: Sequence[int]) -> Found:
        """Return what full detection finds in some pictures."""
        photos = [self.glances.photos[at] for at in numbers]
        return Found.of(
            detect(photos, self.targets or (), self.run, again=False, step="Finding boards")
        )

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
        names = [photo.name for photo in self.glances.photos]
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

        size = self.glances.size
        self.choice = choose(self.seen, size, self.most, still_px(size), gains)


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
        glances=Glances(photos=usual, size=size),
        seen=[Seen(sharpness=one) for one in sharp.values()],
        most=most,
        targets=targets,
        run=run,
        what="photos",
        at_once=len(usual),
        quick_jobs=run.jobs,
    )
    search.search(range(len(usual)), ())
    order = search.choice.order
    return [usual[at] for at in sorted(order)], why_ended(search.choice.ended, len(order), "photo")


def _measure_photo(photo: Photo) -> tuple[tuple[int, int], float] | None:
    """Return a photo's (width, height) and sharpness; None for a damaged one, which is left out."""
    grey = photo.grey_if_readable()
    return None if grey is None else ((grey.shape[1], grey.shape[0]), sharpness(grey))
