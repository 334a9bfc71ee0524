"""The next photos to take, and how much each would lower the uncertainty.

For each sampled pose, the normal equations of the fit are extended by the corners that would be
seen from there, with the pose's own six unknowns eliminated, and give a new uncertainty over the
field. The best pose is taken, then the best one after it, and so on: three good photos, not three
alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish.judge import FieldUncertainty
from cubicfish.models import angle_from_axis
from cubicfish.scene import Viewpoint
from cubicfish.sufficiency import CoverageGaps, Goal, Knowledge

MOST_PHOTOS = 12
"""Photos are counted up to this many; beyond it another target or camera is the better advice."""
_MIDDLE_DEG = 12.0
# Below this slant a face looks at the camera.
_HEAD_ON_DEG = 12.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal:
    """A photo to take.

    Attributes:
        view: the pose, and the corners that would be seen.
        before, after: uncertainty over the field, with the proposals before this one.

    """

    view: Viewpoint
    before: FieldUncertainty
    after: FieldUncertainty

    @property
    def words(self) -> str:
        """Where the target should be, as an instruction."""
        place = place_words(self.view.direction)
        return f"the target {place}, {tilt_words(self.view.front, self.view.direction)}"

    @property
    def gain(self) -> float:
        """Share by which it lowers the median uncertainty over the field."""
        return 1 - self.after.median_px / max(self.before.median_px, 1e-300)

    def as_record(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        rotation, translation = self.view.pose
        return {
            "words": self.words,
            "camera_from_world": {
                "rotation_vector": np.asarray(rotation).tolist(),
                "translation": np.asarray(translation).tolist(),
            },
            "corners": int(self.view.seen.visible.sum()),
            "distance": float(np.median(self.view.away)),
            "before": self.before.as_record(),
            "after": self.after.as_record(),
            "gain": self.gain,
        }


def proposed(
    knowledge: Knowledge,
    views: Sequence[Viewpoint],
    gaps: CoverageGaps,
    rays: FloatArray,
    goal: Goal,
    proposals: int,
    *,
    count: bool = True,
) -> tuple[tuple[Proposal, ...], int | None]:
    """Choose the next photos, and count how many of them reach the goal, if that is wanted."""
    added = knowledge.of_photos([view.seen.camera[view.seen.visible] for view in views])
    filled = np.array([_find_filled(view, gaps) for view in views])
    empty, squares = gaps.cells.empty, max(gaps.cells.field.sum(), 1)
    chosen: list[Proposal] = []
    tried, score = np.arange(len(views)), np.zeros(len(views))
    state, level = knowledge, knowledge.over(rays)
    needed = None
    while len(chosen) < min(MOST_PHOTOS, len(views)):
        sums = state.over_with([added[one] for one in tried], rays)
        fill = (filled[tried] & empty).sum(axis=(1, 2)) / squares
        left = np.array([_measure_left(after, level) for after in sums])
        score[tried] = left - fill
        first = int(np.argmin(score[tried]))
        best, after = tried[first], sums[first]
        chosen.append(Proposal(view=views[best], before=level, after=after))
        state, level = state + added[best], after
        empty &= ~filled[best]
        # The same photo twice would say little new about a real lens and a real target.
        score[best] = np.inf
        # Beside more photos a photo adds less: those that added least before are not the next.
        tried = np.argsort(score)[: min(max(len(views) // 2, 1), len(views) - len(chosen))]
        covered = 1 - empty.sum() / squares >= goal.coverage
        if needed is None and level.p95_px <= goal.p95_px and covered:
            needed = len(chosen)
        if len(chosen) >= proposals and (needed is not None or not count):
            break
    return tuple(chosen[:proposals]), needed


def _find_filled(view: Viewpoint, gaps: CoverageGaps) -> npt.NDArray[np.bool_]:
    """Return which squares of the picture (rows, columns) a view puts corners into."""
    cells = gaps.cells
    column, row = np.floor(view.pixel / cells.cell).astype(int).T
    inside = (row >= 0) & (column >= 0)
    inside &= (row < cells.field.shape[0]) & (column < cells.field.shape[1])
    filled = np.zeros_like(cells.field)
    filled[row[inside], column[inside]] = True
    return filled


def _measure_left(after: FieldUncertainty, before: FieldUncertainty) -> float:
    """Return the share of the uncertainty that is left, on the whole and where it is worst."""
    return (after.median_px / before.median_px + after.p95_px / before.p95_px) / 2


def place_words(ray: FloatArray) -> str:
    """Describe where in the picture a ray (3,) is: ``in the lower right of the picture, ...``."""
    angle = float(np.degrees(angle_from_axis(ray)))
    if angle < _MIDDLE_DEG:
        return "in the middle of the picture"
    side = CoverageGaps.side_of(ray[:2])
    word = {"bottom": "at", "top": "at", "left": "on", "right": "on"}.get(side, "in")
    return f"{word} the {side} of the picture, {angle:.0f}° from the axis"


def tilt_words(front: FloatArray, middle: FloatArray) -> str:
    """Describe a board's tilt: ``its face turned 35° to the left``: its left edge is farther.

    Args:
        front: (3,) where the face looks, a unit vector in the camera frame.
        middle: (3,) where it is.

    """
    x, y, z = ray = middle / np.linalg.norm(middle)
    angle = float(np.degrees(np.arccos(np.clip(-front @ ray, -1, 1))))
    if angle < _HEAD_ON_DEG:
        return "facing the camera"
    # The camera's own x and y, turned along with its axis to the ray the short way.
    share = 1 / max(1 + z, 1e-9)
    right = np.array([1 - x * x * share, -x * y * share, -x])
    down = np.array([-x * y * share, 1 - y * y * share, -y])
    side = CoverageGaps.side_of(np.array([right @ front, down @ front]))
    where = {"bottom": "downwards", "top": "upwards"}.get(side, f"to the {side}")
    return f"its face turned {angle:.0f}° {where}"
