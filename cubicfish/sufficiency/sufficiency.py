"""Whether photos so far are enough, and which parts of the picture they leave empty.

Photos are enough if the verdict asks for none: advice, report and commands all go by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish.angles import angle_from_axis, azimuth
from cubicfish.fit.coverage import FieldCells
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import FitRecord
from cubicfish.judge.uncertainty import FieldUncertainty, of_size
from cubicfish.judge.verdict import COVERAGE, FEW_OF_A_PLANE, FEW_PHOTOS, GOAL_PX, Verdict
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.point import PointCamera
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# The middle, which has no sides, reaches so far; of the rest the outer ring has this share.
_MIDDLE_FIELD_DEG = 20.0
_OUTER_RING = 0.4
# A part counts as empty when so many of its squares hold no corner.
_EMPTY_SHARE = 0.6
# Clockwise from the right, y down, an eighth of a turn each.
_SIDES = (
    "right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the picture without corners.

    Attributes:
        sides: words such as ``upper left``; all eight is a ring, none the middle.
        from_deg, to_deg: angles from the axis.
        share: of the field's squares that are empty there, of all squares of the field.

    """

    sides: tuple[str, ...]
    from_deg: float
    to_deg: float
    share: float

    def as_record(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "sides": list(self.sides),
            "from_deg": self.from_deg,
            "to_deg": self.to_deg,
            "share": self.share,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverageGaps:
    """Coverage gaps: what photos so far do not show.

    Attributes:
        parts: empty parts of the field, the largest first.
        cells: the field in squares, and which hold corners.

    """

    parts: tuple[Part, ...]
    cells: FieldCells

    @classmethod
    def of(cls, camera: CubicCamera | PointCamera, pairs: Observations) -> CoverageGaps:
        """Look for parts of the field without corners: of the middle, and of two rings around it.

        Args:
            camera: the camera; no parts are known of one without rays.
            pairs: the corners that it was fitted to.

        """
        cells = FieldCells.of(camera, pairs.pixel)
        if not isinstance(camera, CubicCamera):
            return cls(parts=(), cells=cells)
        row, column = np.nonzero(cells.field)
        rays = camera.unproject((np.stack([column, row], axis=-1) + 0.5) * cells.cell - 0.5)
        seen = np.isfinite(rays[:, 0])
        rays, gone = rays[seen], cells.empty[row, column][seen]
        angle, side = np.degrees(angle_from_axis(rays)), _find_eighth(rays[:, :2])
        rim = max(camera.max_angle_deg, _MIDDLE_FIELD_DEG)
        outer = rim - _OUTER_RING * (rim - _MIDDLE_FIELD_DEG)
        parts = []
        for low, high in ((0.0, _MIDDLE_FIELD_DEG), (_MIDDLE_FIELD_DEG, outer), (outer, rim)):
            ring = (angle >= low) & (angle < high)
            ways = {"": ring}
            if low:
                ways = {word: ring & (side == number) for number, word in enumerate(_SIDES)}
            lost = [
                word for word, own in ways.items() if own.any() and gone[own].mean() >= _EMPTY_SHARE
            ]
            if lost:
                share = sum(gone[ways[word]].sum() for word in lost) / len(rays)
                sides = tuple(lost) if low else ()
                parts.append(Part(sides=sides, from_deg=low, to_deg=high, share=float(share)))
        return cls(parts=tuple(sorted(parts, key=lambda part: -part.share)), cells=cells)

    @staticmethod
    def side_of(offset: FloatArray) -> str:
        """Return which side an offset (2,) from the axis is on, such as upper left."""
        return _SIDES[int(_find_eighth(offset))]


def _find_eighth(offset: FloatArray) -> IntArray:
    """Return the eighth of the picture of offsets (..., 2) from the axis, an index of _SIDES."""
    turn = azimuth(offset)
    eighth: IntArray = np.rint(turn / (np.pi / 4)).astype(np.intp) % 8
    return eighth


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What a camera's photos need to be enough.

    Attributes:
        p95_px: the uncertainty to aim at over 95 % of the field, pixels.
        photos: how many photos at least.
        coverage: the share of the field that corners cover at least.
        is_asked: whether more uncertainty than that is not enough, whatever the verdict.

    """

    p95_px: float
    photos: int
    coverage: float
    is_asked: bool = False

    @classmethod
    def of(cls, fit: FitRecord, image_size: tuple[int, int], asked_px: float | None = None) -> Goal:
        """Return what photos of a size need, by the record of a fit to some of them.

        Args:
            fit: the record.
            image_size: (width, height), pixels.
            asked_px: the uncertainty that somebody asks for, pixels; None for that of the record,
                or what is usual.

        """
        return cls(
            p95_px=asked_px or fit.goal_px or default_goal(image_size),
            photos=FEW_OF_A_PLANE[0] if fit.flat else FEW_PHOTOS,
            coverage=COVERAGE[0],
            is_asked=asked_px is not None,
        )

    def explain_unmet(self, judged: Verdict, now: FieldUncertainty | None = None) -> list[Finding]:
        """Return why photos so far are not enough; an empty list if they are.

        Args:
            judged: the camera's verdict.
            now: its uncertainty over the field, if known.

        """
        reasons = [one for one in judged.reasons if one.asks_for_photos]
        if judged.level == "bad" and judged.reasons[0] not in reasons:
            first = {"reason": judged.reasons[0]}
            reasons.insert(0, Finding(code=Code.NOT_TRUSTED, severity=Severity.BAD, figures=first))
        said = any(one.code == Code.UNCERTAIN for one in reasons)
        if self.is_asked and not said and now is not None and now.p95_px > self.p95_px:
            figures = {"p95_px": now.p95_px, "goal_px": self.p95_px}
            reasons.append(Finding(code=Code.NOT_CERTAIN, severity=Severity.CARE, figures=figures))
        return reasons


def default_goal(image_size: tuple[int, int]) -> float:
    """Return the uncertainty to aim at by default, pixels."""
    return GOAL_PX * of_size(image_size)
