"""Glances at many pictures of one camera: roughly what each shows, before any is searched in full.

A glance costs a fraction of a full search; see `find/identification/quick_detect.py`. Pictures of a
film are looked at where those before and after show boards.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial

from cubicfish.diagnosis.corner_count import squares_of_grids
from cubicfish.diagnosis.evidence import GridEvidence
from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.markers import MarkedCorners
from cubicfish.find.identification.identified import (
    Detection,
    PhotoReport,
    marked_corners,
    nameless,
)
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.find.identification.quick_detect import (
    QuickDetection,
    quick_detect,
    quick_detect_near,
)
from cubicfish.judge.finding import Finding
from cubicfish.photos.photos import Photo
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.workers.pool import Work

_NONE_MARKED = MarkedCorners.none()


@dataclass(kw_only=True, eq=False)
class Glances:
    """What pictures of one camera show at a glance.

    Attributes:
        photos: the pictures.
        size: (width, height) of them, pixels; what is not of this size is passed over.
        is_film: whether each picture is like those before and after it, as in a film.

    """

    photos: Sequence[Photo]
    size: tuple[int, int]
    is_film: bool = False
    _seen: dict[int, QuickDetection | None] = field(default_factory=dict)
    _again: set[int] = field(default_factory=set)
    _looked_for: Target | None = None

    def look(self, numbers: Sequence[int], targets: Sequence[Target], work: Work) -> Detection:
        """Look at some pictures, and name what they show.

        Of a film also at others, once more, that showed nothing before, if a board is seen next to
        them.

        Args:
            numbers: of the pictures, in any order.
            targets: what the target may be; of those with markers one is looked for. None finds
                any checkerboard, and its corners have no names.
            work: who looks at the pictures.

        Returns:
            The named corners of the target that explains most, and a report on each picture. Only
            the counts of its corners are judged. Without targets what was found is in the reports
            alone.

        """
        with_markers = [one for one in targets if one.has_markers]
        target = next(iter([*with_markers, *targets]), None)
        looking, every = list(numbers), list(numbers)
        while looking:
            self._look_at(looking, target, work)
            looking = self._list_beside(looking)
            self._again.update(looking)
            every += [number for number in looking if number not in every]
        names = [self.photos[number].name for number in every]
        seen = [self._seen[number] for number in every]
        if target is None:
            return nameless(names, [_grids_of(one) for one in seen], self.size)
        if target.has_markers:
            marked = [one if isinstance(one, MarkedCorners) else _NONE_MARKED for one in seen]
            return _report(marked_corners(marked, target, self.size, names))
        return self._name_by_geometry(seen, targets, names)

    def shows(self, number: int) -> bool:
        """Whether a board was seen in a picture; False for those that were not looked at."""
        return _is_any(self._seen.get(number))

    @property
    def any_seen(self) -> bool:
        """Whether a board was seen in any picture."""
        return any(map(_is_any, self._seen.values()))

    def _look_at(self, numbers: Sequence[int], target: Target | None, work: Work) -> None:
        same = target is self._looked_for
        looks = [
            _Look(
                photo=self.photos[one],
                near=self._seen_next_to(one) if self.is_film else None,
                before=self._seen.get(one) if same and not self.shows(one) else None,
            )
            for one in numbers
        ]
        self._looked_for = target
        found = work.done(partial(_quick_detect, target=target), looks)
        self._seen.update(zip(numbers, found, strict=True))

    def _list_beside(self, looked: Iterable[int]) -> list[int]:
        """Pictures that are to be looked at once more: next to boards, and without any so far.

        A board that is lost in one picture is looked for where it is in the next.
        """
        beside = {at for one in looked if self.shows(one) for at in self._next_to(one)}
        return sorted(at for at in beside - self._again if not self.shows(at))

    def _next_to(self, number: int) -> list[int]:
        """The pictures before and after one of a film, of those that were looked at."""
        if not self.is_film:
            return []
        before = max((at for at in self._seen if at < number), default=None)
        after = min((at for at in self._seen if at > number), default=None)
        return [at for at in (before, after) if at is not None]

    def _seen_next_to(self, number: int) -> tuple[QuickDetection, ...]:
        near = (self._seen[one] for one in self._next_to(number))
        return tuple(one for one in near if one is not None)

    def _name_by_geometry(
        self, seen: Sequence[QuickDetection | None], targets: Sequence[Target], names: Sequence[str]
    ) -> Detection:
        found = [_grids_of(one) for one in seen]
        grids = [one.grids if one and one.image_size == self.size else () for one in found]
        named = [(name_grids(grids, target, self.size, names), target) for target in targets]
        identified, target = max(named, key=lambda one: len(one[0].corners.pixel))
        evidence = GridEvidence(
            photos=len(names),
            names=names,
            picture=lambda number: None,
            target=target,
            with_boards=len(names),
            lost=(),
            identified=identified,
        )
        return _report(identified.corners, squares_of_grids(evidence))


def _report(corners: Observations, findings: Sequence[Finding] = ()) -> Detection:
    """What is known of pictures, all of which the corners list."""
    reports = (PhotoReport(name=name) for name in corners.images)
    photos = tuple(report.with_corners(corners, n) for n, report in enumerate(reports))
    return Detection(corners=corners.only_seen()[0], photos=photos, findings=tuple(findings))


def _grids_of(seen: QuickDetection | None) -> FoundGrids | None:
    return seen if isinstance(seen, FoundGrids) else None


def _is_any(seen: QuickDetection | None) -> bool:
    """Whether a picture shows any board."""
    return seen is not None and len(seen.each()) > 0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Look:
    """A picture that is looked at.

    Attributes:
        photo: where it is.
        near: what the pictures of a film before and after it show; None for a photo.
        before: what it showed at the last look for the same, which is no board; None at the first.

    """

    photo: Photo
    near: tuple[QuickDetection, ...] | None
    before: QuickDetection | None = None

    @property
    def name(self) -> str:
        """The picture's."""
        return self.photo.name


def _quick_detect(one: _Look, *, target: Target | None) -> QuickDetection | None:
    grey = one.photo.grey_if_readable()
    if grey is None:
        return None
    if one.near is None:
        return quick_detect(grey, target)
    return quick_detect_near(grey, target, one.near, one.before)
