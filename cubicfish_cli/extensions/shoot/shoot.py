"""The loop of a shoot: photos as they come, what is wrong with each, and what to do next."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import cv2
import numpy as np

from cubicfish import (
    CubicfishError,
    DetectionError,
    Listener,
    Observations,
    PhotoError,
    Run,
    Target,
    detect,
    read_picture,
)
from cubicfish.files import write_files
from cubicfish.find import PhotoReport
from cubicfish.judge import Code
from cubicfish.photos import Photo, PictureFile, find_photos
from cubicfish_cli.extensions.shoot import words
from cubicfish_cli.extensions.shoot.camera import Camera
from cubicfish_cli.extensions.shoot.guidance import Guidance, Guide, held_out_px, same_place
from cubicfish_cli.extensions.shoot.server import Page
from cubicfish_cli.extensions.shoot.words import Flaw
from cubicfish_cli.films.choose import Scale, Seen
from cubicfish_cli.films.measure import sharpness
from cubicfish_cli.render.small_pictures import thumbnail
from cubicfish_cli.words.remarks import problem_of
from cubicfish_cli.words.sentences import render_error

LEFT_OUT = "left-out.txt"
"""In the photos' folder: names of those that are left out, a line each."""
_FRAME = "shoot_{:04d}.png"
_POLL_SECONDS = 0.2
# A file that cannot be read may still be on its way for so long after it last grew.
_ON_ITS_WAY_SECONDS = 5.0
# Photos that were there before are searched so many at a time; of fewer each is shown.
_AT_A_TIME, _FEW = 32, 3
_SHOWN_PIXELS, _QUALITY = 1280, 80
_ASIDE = 5  # one photo of so many is set aside
# Whether the corners have the right names is told by so many photos: a wrong target fits none.
_CHECKED = 3
_FAR_PX = 12.0  # squares below this many pixels are hard to find
_CUT_SQUARES = 1.5  # a board that ends so near to the picture's edge may go on beyond it
_Stamp = tuple[int, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class Taken:
    """A photo of a shoot.

    Attributes:
        path: where it is.
        stamp: when its file was last written, and its size; None before it is written.
        corners: the named corners that it shows; None where there are none.
        sharpness: as `films/measure.py` has it; NaN where it was not measured.
        flaws: what is wrong with it.
        problem: why it shows no corners, in words.

    """

    path: Path
    stamp: _Stamp | None
    corners: Observations | None = None
    sharpness: float = np.nan
    flaws: tuple[Flaw, ...] = ()
    problem: str = ""

    @property
    def remarks(self) -> str:
        """What is wrong with it, in words."""
        return self.problem or "; ".join(map(words.FLAWS.__getitem__, self.flaws))


@dataclass(kw_only=True, eq=False)
class Shoot:
    """A shoot, of which the photos in the folder and what is left out are all that lasts.

    Attributes:
        folder: of the photos.
        targets: what they may show.
        run: how the work is done.
        goal_px: the uncertainty wanted; None for what is usual.
        camera: what takes photos; None where somebody else does.
        page: where it is shown; None for nowhere.
        asked: what the user asks for.
        say: called with a line about each thing that happens.
        calibrate: makes the calibration of photos, and returns what to say of it and its report.
        first: what the page says before the first photo.
        taken: the photos, by their names and in that order.
        left_out: names of those that are left out.
        guidance: what the others say; None before the first.

    """

    folder: Path
    targets: Sequence[Target]
    run: Run
    goal_px: float | None
    camera: Camera | None
    page: Page | None
    asked: Queue[dict[str, Any]]
    say: Callable[[str], None]
    calibrate: Callable[[Sequence[Path]], tuple[str, Path]]
    first: Mapping[str, Any]
    taken: dict[str, Taken] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    guidance: Guidance | None = None
    _guide: Guide | None = None
    _held_out: tuple[float, dict[str, float]] | None = None
    _waiting: dict[Path, _Stamp | None] = field(default_factory=dict)
    _last: str = ""
    _shots: int = 0
    _unmeasured: bool = False
    _checked: set[str] = field(default_factory=set)
    _ended: dict[str, Any] = field(default_factory=dict)
    _next_look: float = 0.0

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        with suppress(OSError):
            self.left_out |= {*(self.folder / LEFT_OUT).read_text(encoding="utf-8").splitlines()}
        self.run = replace(self.run, listener=Listener())
        if self.camera is not None:
            self._begin(self.camera.size)

    def _begin(self, size: tuple[int, int]) -> None:
        """Guide to the first photo, once it is known how large photos are."""
        self._guide = Guide(self.targets[0], size, self.goal_px)
        self.guidance = self._guide.after(None)

    def go_on(self) -> None:
        """Take, look and guide until the user ends it; Ctrl-C ends it at any time."""
        self._tell()
        asked: dict[str, Any] = {}
        while self.do(asked):
            took, news = self._take_frame(), self._find_new()
            for first in range(0, len(news), _AT_A_TIME):
                self._look(news[first : first + _AT_A_TIME])
            if took or news:
                self._follow()
            try:
                asked = self.asked.get(timeout=_POLL_SECONDS)
            except Empty:
                asked = {}
                if not self._waiting:
                    self._use_pause()

    def do(self, asked: Mapping[str, Any]) -> bool:
        """Do what the user asks for; False where that is the end."""
        what, name = asked.get("do"), asked.get("photo")
        if what == "leave_out" and name in self.taken:
            self.left_out ^= {str(name)}
            text = "".join(f"{one}\n" for one in sorted(self.left_out))
            write_files({self.folder / LEFT_OUT: text}, overwrite=True)
            self._follow()
        elif what == "finish":
            self._tell(busy=True)
            try:
                said, report = self.calibrate(self.used())
                self._ended = {"said": said, "report": report.is_file()}
                if self.page is not None:
                    self.page.report = report
            except CubicfishError as problem:
                if self.page is None:
                    raise
                said = render_error(problem)
                self._ended = {"said": said, "report": False}
            self.say(said)
            self._tell()
            return self.page is not None
        return what != "stop"

    def used(self) -> list[Path]:
        """The photos of the calibration: the folder, or all in it that are not left out."""
        photos = self._list()
        used = [photo.path for photo in photos if photo.name not in self.left_out]
        return [self.folder] if len(used) == len(photos) else used

    def _list(self) -> list[Photo]:
        with suppress(PhotoError):  # there is none yet
            return find_photos([self.folder])
        return []

    def _look(self, photos: Sequence[Photo]) -> None:
        """Search whole new photos, of few each by itself, and say what is wrong with them."""
        few = len(photos) <= _FEW
        for part in [[photo] for photo in photos] if few else [photos]:
            self._show(part[-1])
            self._enter(self._search(part, closely=few))

    def _use_pause(self) -> None:
        """Do what takes long while nobody waits: measure the error, and check the target."""
        guidance = self.guidance
        if not self._unmeasured:
            self._check()
            return
        self._unmeasured = False
        if guidance is not None and guidance.pairs is not None:
            aside = np.isin(guidance.pairs.images, [*self.taken][_ASIDE - 1 :: _ASIDE])
            self._held_out = held_out_px(guidance.pairs, np.flatnonzero(aside))
        self._tell()
        self.say(self._summary())

    def _check(self) -> None:
        """Try what may be wrong with the target, by the first photos."""
        seen = [one.path for one in self.taken.values() if one.corners is not None]
        path = next((one for one in seen if one.name not in self._checked), None)
        if path is None or len(self._checked) >= _CHECKED:
            return
        self._checked.add(path.name)
        found = self._search([Photo(name=path.name, path=path)], closely=False, faults=True)
        if found and found[0].corners is None:
            self._enter(found)
            self._follow()

    def _enter(self, found: Sequence[Taken]) -> None:
        """Keep what is known of photos, in the order of their names, and say it."""
        for one in found:
            self.taken[one.path.name] = one
            corners = 0 if one.corners is None else len(one.corners.pixel)
            self.say(f"{one.path.name}: {one.remarks or f'{corners} corners'}")
        self.taken = dict(sorted(self.taken.items(), key=lambda one: Photo.natural_key(one[0])))
        self._tell()

    def _show(self, photo: Photo) -> None:
        """Show a photo at once, before it is searched."""
        with suppress(PhotoError):
            picture = read_picture(photo.path)
            if self._guide is None:
                self._begin((picture.shape[1], picture.shape[0]))
            if self.page is not None:
                look = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
                small = thumbnail(picture, _SHOWN_PIXELS)
                self.page.picture = cv2.imencode(".jpg", small, look)[1].tobytes()
            self._last, self._shots = photo.name, self._shots + 1
            self._tell()

    def _search(
        self, photos: Sequence[Photo], *, closely: bool, faults: bool = False
    ) -> list[Taken]:
        """What photos show, and what is wrong with each; of those that are whole."""
        reports, corners, why = list[PhotoReport | None](), None, ""
        try:
            found = detect(photos, self.targets, self.run, again=False, faults=faults)
            reports, corners = [*found.photos], found.corners
            unreadable = [one.refusal for one in found.photos if one.refusal is not None]
        except DetectionError as problem:
            reports, why = [None for _ in photos], render_error(problem)
            unreadable = [*problem.findings]
        broken = {Code.CANNOT_BE_READ, Code.NO_PHOTO} & {one.code for one in unreadable}
        known = []
        for photo, report in zip(photos, reports, strict=True):
            own = Taken(path=photo.path, stamp=_stamp(photo.path), problem=why)
            if corners is not None and photo.name in corners.images:
                own = replace(own, corners=corners.of(photo.name).only_seen()[0])
                own = self._measure(own, photo, closely=closely)
            elif report is not None:
                own = replace(own, problem=problem_of(report) or "")
            known.append(own)
        return [
            one
            for one in known
            if one.corners is not None or not (broken and _is_on_its_way(one.stamp))
        ]

    def _measure(self, own: Taken, photo: Photo, *, closely: bool) -> Taken:
        grey = photo.grey_if_readable() if closely else None
        own = replace(own, sharpness=np.nan if grey is None else sharpness(grey))
        return replace(own, flaws=self._find_flaws(own))

    def _find_flaws(self, one: Taken) -> tuple[Flaw, ...]:
        corners, others = one.corners, self._usable()
        if corners is None:
            return ()
        others.pop(one.path.name, None)
        sharp = [self.taken[name].sharpness for name in others]
        sharp = [value for value in (*sharp, one.sharpness) if np.isfinite(value)]
        names = np.column_stack([corners.board, corners.column, corners.row])
        side = _typical_side(corners)
        edge = np.minimum(corners.pixel, np.array(corners.image_size) - 1 - corners.pixel).min(1)
        boards = corners.target.boards if corners.target else ()
        count = np.bincount(corners.board, minlength=len(boards))
        whole = np.array([board.columns * board.rows for board in boards])
        # Of several boards one may be cut where another is whole.
        cut = (count < whole).all() and (edge < _CUT_SQUARES * side).any()
        blurred = len(sharp) > _FEW and Scale.of(
            [Seen(sharpness=value) for value in sharp], 1.0
        ).is_spoilt(Seen(sharpness=one.sharpness))
        found = {
            Flaw.BLURRED: blurred,
            Flaw.FAR: side < _FAR_PX,
            Flaw.CUT: bool(cut),
            Flaw.SAME: any(same_place(names, corners.pixel, other) for other in others.values()),
        }
        return tuple(flaw for flaw, is_so in found.items() if is_so)

    def _usable(self) -> dict[str, Observations]:
        """The corners of photos of one target and one size that are not left out."""
        seen = {name: one.corners for name, one in self.taken.items() if one.corners is not None}
        kinds = {name: (one.image_size, id(one.target)) for name, one in seen.items()}
        most = max(Counter(kinds.values()).items(), key=lambda one: one[1], default=(None, 0))[0]
        return {
            name: one
            for name, one in seen.items()
            if name not in self.left_out and kinds[name] == most
        }

    def _follow(self) -> None:
        """Fit a quick camera to the photos, and say what to do next."""
        used = self._usable()
        if self._guide is not None:
            pairs = Observations.joined([*used.values()]) if used else None
            self.guidance, self._held_out = self._guide.after(pairs), None
        self._unmeasured = True
        self._tell()
        self.say(words.next_words(self.guidance))

    def _summary(self) -> str:
        held, _ = self._held_out or (None, {})
        return words.summary(self.guidance, len(self._usable()), held)

    def _find_new(self) -> list[Photo]:
        """Photos that are new, or were written anew, and are whole."""
        begun = time.monotonic()
        if begun < self._next_look:
            return []
        photos = self._list()
        stamps = {photo.path: _stamp(photo.path) for photo in photos}
        gone = self.taken.keys() - {photo.name for photo in photos}
        for name in gone:
            del self.taken[name]
        if gone:
            self._follow()
        known = {one.path: one.stamp for one in self.taken.values()}
        changed = [one for one in photos if stamps[one.path] != known.get(one.path)]
        # What did not grow since the last look is whole.
        new = [one for one in changed if self._waiting.get(one.path) == stamps[one.path]]
        self._waiting = {one.path: stamps[one.path] for one in changed}
        self._next_look = begun + 10 * (time.monotonic() - begun)
        return new

    def _take_frame(self) -> bool:
        """Keep the camera's best frame where it shows something new, as a whole file."""
        if self.camera is None:
            return False
        number = next(n for n in range(1, 10**6) if _FRAME.format(n) not in self.taken)
        path = self.folder / _FRAME.format(number)
        photo = None if path.exists() else self.camera.best(path)
        if photo is None or photo.picture is None:
            return False
        found = self._search([photo], closely=True)
        if not found or found[0].corners is None or {Flaw.SAME, Flaw.BLURRED} & {*found[0].flaws}:
            return False
        write_files({path: PictureFile.of(path, photo.picture).data}, overwrite=False)
        self._show(Photo(name=path.name, path=path))
        self._enter([replace(found[0], stamp=_stamp(path))])
        return True

    def _tell(self, *, busy: bool = False) -> None:
        """Tell the page all that is known."""
        if self.page is None:
            return
        said, guide = self.guidance, self._guide
        advice = said.advice if said else None
        self.page.tell(
            {
                "first": self.first,
                "busy": busy,
                "ended": self._ended,
                "shots": self._shots,
                "live": self.camera is not None,
                "over": self._why_over(),
                "size": guide and guide.size,
                "last": self._last_record(),
                "cells": said and said.cells(),
                "ghost": guide.ghost(said) if guide and said else None,
                "next": words.next_words(said),
                "summary": self._summary(),
                "now": advice.now.p95_px if advice and advice.now else None,
                "goal": said and said.goal_px,
                "enough": bool(advice and advice.enough),
                "photos": self._photo_records(),
            }
        )

    def _why_over(self) -> str:
        camera = self.camera
        if camera is None or camera.is_alive():
            return ""
        return words.OVER if camera.problem is None else render_error(camera.problem)

    def _last_record(self) -> dict[str, Any]:
        last = self.taken.get(self._last)
        seen = last.corners if last else None
        return {
            "name": self._last,
            "remarks": last.remarks if last else "",
            "corners": [] if seen is None else seen.pixel.round(1).tolist(),
        }

    def _photo_records(self) -> list[dict[str, Any]]:
        errors = self.guidance.errors if self.guidance else {}
        _, held = self._held_out or (None, {})
        return [
            {
                "name": name,
                "px": errors.get(name),
                "held": held.get(name),
                "out": name in self.left_out,
                "remarks": one.remarks,
            }
            for name, one in self.taken.items()
        ]


def _stamp(path: Path) -> _Stamp | None:
    try:
        known = path.stat()
    except OSError:
        return None
    return known.st_mtime_ns, known.st_size


def _is_on_its_way(stamp: _Stamp | None) -> bool:
    return stamp is not None and time.time() - stamp[0] / 1e9 < _ON_ITS_WAY_SECONDS


def _typical_side(corners: Observations) -> float:
    """Pixels between neighbours along the rows, in the median."""
    step = np.diff(np.column_stack([corners.board, corners.row, corners.column]), axis=0)
    next_to = (step == (0, 0, 1)).all(axis=1)
    side = np.linalg.norm(np.diff(corners.pixel, axis=0), axis=1)[next_to]
    return float(np.median(side)) if len(side) else np.inf
