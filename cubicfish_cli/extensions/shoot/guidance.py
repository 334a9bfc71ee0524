"""What corners so far say of a camera, and where to hold the target next."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import (
    Calibration,
    CubicfishError,
    FloatArray,
    Observations,
    Target,
    TargetError,
    calibrate,
    evaluate,
)
from cubicfish.judge import FitRecord
from cubicfish.models import RadialCamera
from cubicfish.scene import Scene, Viewpoint
from cubicfish.sufficiency import Goal
from cubicfish_cli.extensions.advice.advise import Advice, advise
from cubicfish_cli.extensions.advice.limited_lens import LimitedLens, limited_lens
from cubicfish_cli.extensions.advice.proposals import place_words, tilt_words
from cubicfish_cli.films.choose import Seen, choose
from cubicfish_cli.films.frame_search import patches_of_corners
from cubicfish_cli.films.scan import still_px
from cubicfish_cli.render.board_shapes import dark_squares, paper

# Before a lens is known, it is taken for one that sees so far from its axis, in a round picture
# that fits the shorter side: a view of any lens has room inside that.
_GUESSED_DEG = 100.0
_FIRST_VIEWS = 4
# The ghost may reach so far beyond the field; its paper is drawn in so many pieces along a side.
_BEYOND_DEG, _PIECES = 8.0, 6
# Two photos show the target in the same place where corners are nearer than this share of the
# picture's diagonal, in the median: less than half of what two steps of a hand differ by.
_SAME_PLACE = 0.04
# A quick camera is fitted to so many photos at most, those that cover most: more would take longer
# and longer, and the last of them say little.
MOST_FITTED = 60
# Makes one number of a corner's board, column and row.
_ONE_NUMBER = np.array([10**8, 10**4, 1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Guidance:
    """What photos so far say.

    Attributes:
        pairs: the corners that speak for all: of so many photos that a fit takes no longer.
        fitted: the quick camera; None where they do not determine one.
        errors: RMS error of each photo, pixels.
        advice: what they leave open; None where that cannot be said.
        goal_px: the uncertainty wanted over 95 % of the field.
        view: where the target should be in the next photo; None where it is enough.
        lens: that of ``view``.

    """

    pairs: Observations | None = None
    fitted: Calibration | None = None
    errors: Mapping[str, float] = field(default_factory=dict)
    advice: Advice | None = None
    goal_px: float
    view: Viewpoint | None
    lens: RadialCamera | LimitedLens

    @property
    def words(self) -> str:
        """Where the target should be next, as an instruction; empty where it is enough."""
        if self.view is None:
            return ""
        way = self.view.direction
        return f"Hold the target {place_words(way)}, {tilt_words(self.view.front, way)}."

    def cells(self) -> dict[str, Any] | None:
        """The field in squares for a page: which hold corners, and how uncertain each is, px."""
        if self.advice is None or self.fitted is None:
            return None
        cells = self.advice.gaps.cells
        row, column = np.nonzero(cells.field)
        at = (np.stack([column, row], axis=-1) + 0.5) * cells.cell - 0.5
        sigma = self.fitted.fit.uncertainty.at(np.asarray(at, float))
        sigma = np.full(len(row), np.nan) if sigma is None else sigma
        known = zip(column, row, cells.hit[row, column], sigma, strict=True)
        squares = [
            [int(x), int(y), int(hit), round(float(px), 3) if np.isfinite(px) else None]
            for x, y, hit, px in known
        ]
        return {"side": cells.cell, "squares": squares}


class Guide:
    """Says what to photograph next of a target, with photos of one size."""

    def __init__(
        self, target: Target, image_size: tuple[int, int], goal_px: float | None = None
    ) -> None:
        """Begin without photos.

        Args:
            target: the calibration target.
            image_size: (width, height) of the photos, pixels.
            goal_px: the uncertainty wanted over 95 % of the field; None for what is usual.

        """
        self.target, self.size = target, image_size
        self.goal_px = Goal.of(FitRecord(), image_size, goal_px).p95_px
        self._chosen, self._weighed = set[str](), set[str]()
        self._errors = dict[str, float]()

    def after(self, pairs: Observations | None) -> Guidance:
        """Return what named corners of photos say; None of no photo."""
        known: dict[str, Any] = {"goal_px": self.goal_px}
        count = 0 if pairs is None else len(pairs.images)
        views: Sequence[Viewpoint] = ()
        with suppress(CubicfishError, np.linalg.LinAlgError):  # too little for a camera
            if pairs is not None:
                known["pairs"] = telling = self._choose(pairs)
                known["fitted"] = fitted = quick_camera(telling)
                known["errors"] = self._measure(fitted, pairs)
                # Other poses each time: one that a hand could not take is not asked for again.
                known["advice"] = advice = advise(
                    fitted, fitted.pairs, fitted.target, goal_px=self.goal_px, seed=count
                )
                views = [one.view for one in advice.proposals]
                new = [one for one in views if not self._is_taken(one, pairs)]
                # A few photos of a flat board may make a camera that is far off.
                firm = count >= _FIRST_VIEWS or not fitted.fit.flat
                if advice.enough or (views and firm):
                    view = None if advice.enough else [*new, *views][0]
                    lens = limited_lens(fitted.camera, _BEYOND_DEG)
                    return Guidance(view=view, lens=lens, **known)
        views = self._first_views
        view = views[count % len(views)] if views else None
        return Guidance(view=view, lens=self._guessed, **known)

    def _choose(self, pairs: Observations) -> Observations:
        """The photos that say most, of those that did before and the new ones."""
        here = set(pairs.images)
        pool = self._chosen | (here - self._weighed) if self._chosen <= here else here
        self._chosen, self._weighed = pool, here
        if len(pool) > MOST_FITTED:
            some = _of_names(pairs, pool)
            patches = patches_of_corners(some)
            seen = [Seen(sharpness=1.0, patches=patches[name]) for name in some.images]
            order = choose(seen, self.size, MOST_FITTED, still_px(self.size)).order
            self._chosen = {some.images[one] for one in order}
        return _of_names(pairs, self._chosen)

    def _measure(self, fitted: Calibration, pairs: Observations) -> dict[str, float]:
        """The photos' errors: of those that were not fitted by the camera when they were new."""
        new = set(pairs.images) - self._chosen - self._errors.keys()
        if new:
            with suppress(CubicfishError):
                seen = evaluate(fitted.camera, _of_names(pairs, new))
                self._errors |= {one.image: one.rms_px for one in seen.photos}
        self._errors |= {one.image: one.rms_px for one in fitted.fit.per_image}
        return {name: self._errors[name] for name in pairs.images if name in self._errors}

    def _is_taken(self, view: Viewpoint, pairs: Observations) -> bool:
        seen = view.seen
        names = np.column_stack([seen.board, seen.column, seen.row])[seen.visible]
        return same_place(names, view.pixel, pairs) is not None

    @cached_property
    def _guessed(self) -> RadialCamera:
        width, height = self.size
        rim = np.radians(_GUESSED_DEG)  # r(θ) = θ - θ³ / 3 rim², which ends there
        focal = min(self.size) / 2 / (2 * rim / 3)
        middle = (width - 1) / 2, (height - 1) / 2
        profile = -1 / (3 * rim**2), 0, 0, 0
        return RadialCamera.from_parameters([focal, focal, *middle, *profile], self.size)

    @cached_property
    def _first_views(self) -> list[Viewpoint]:
        """Views of the first photos: tilted to several sides, all over the picture."""
        scene = Scene(target=self.target, lens=self._guessed, image_size=self.size)
        try:
            found = map(scene.view, scene.choose_poses(_FIRST_VIEWS))
        except TargetError:  # points without a print, or squares too small for such a lens
            return []
        return [view for view in found if view is not None]

    def ghost(self, guidance: Guidance) -> dict[str, str] | None:
        """The next view's paper and dark squares, as SVG paths in pixels of the picture."""
        view = guidance.view
        if view is None:
            return None
        shown = np.unique(view.seen.board[view.seen.visible])
        boards = [self.target.with_flat_boards().boards[one] for one in shown]

        def path(polygons: Iterable[FloatArray]) -> str:
            world = np.concatenate(list(polygons))
            place = guidance.lens.project(view.points(world))
            whole = place[np.isfinite(place).all(axis=(1, 2))]
            return "".join(
                "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in polygon) + "Z" for polygon in whole
            )

        squares = (board.origin + dark_squares(board) @ board.axes[:2] for board in boards)
        return {"paper": path(paper(board, _PIECES) for board in boards), "dark": path(squares)}


def _of_names(pairs: Observations, names: Collection[str]) -> Observations:
    return pairs.of_photos(np.flatnonzero([name in names for name in pairs.images]))


def same_place(names: npt.NDArray[np.intp], pixel: FloatArray, pairs: Observations) -> str | None:
    """The photo that shows the target in the same place as another one does; None of none.

    Args:
        names: (N, 3) board, column and row of the other one's corners.
        pixel: (N, 2) where these are.
        pairs: the corners of photos.

    """
    if not len(pairs.pixel) or not len(names):
        return None
    known, every = (
        one @ _ONE_NUMBER
        for one in (names, np.column_stack([pairs.board, pairs.column, pairs.row]))
    )
    order = np.argsort(known)
    same = order[np.minimum(np.searchsorted(known[order], every), len(order) - 1)]
    rows = np.flatnonzero(known[same] == every)
    away = np.linalg.norm(pairs.pixel[rows] - pixel[same[rows]], axis=1)
    near = _SAME_PLACE * float(np.hypot(*pairs.image_size))
    for photo, name in enumerate(pairs.images):
        common = away[pairs.image[rows] == photo]
        if 2 * len(common) >= len(names) and np.median(common) < near:
            return name
    return None


def quick_camera(pairs: Observations) -> Calibration:
    """Fit a camera to corners, for guidance: the target as drawn, no photo held out.

    Raises:
        CubicfishError: they do not determine one.

    """
    return calibrate(pairs, refine_target="off", hold_out=False)


def held_out_px(
    pairs: Observations, aside: npt.NDArray[np.intp]
) -> tuple[float, dict[str, float]] | None:
    """The RMS error of photos that are set aside, by a camera that never saw them.

    Args:
        pairs: the corners of all photos.
        aside: indices of those that are set aside.

    Returns:
        Of all of them, and of each by its name; None where the others determine no camera.

    """
    rest = np.setdiff1d(np.arange(len(pairs.images), dtype=np.intp), aside)
    if not len(aside) or not len(rest):
        return None
    try:
        seen = evaluate(quick_camera(pairs.of_photos(rest)).camera, pairs.of_photos(aside))
    except CubicfishError:
        return None
    return seen.errors.rms_px, {photo.image: photo.rms_px for photo in seen.photos}
