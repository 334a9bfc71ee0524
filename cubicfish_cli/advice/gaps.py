"""What photos so far do not show: parts of the picture, tilts and distances.

Places in the picture and tilts in a photographer's words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish_cli.angles import angle_from_axis, azimuth
from cubicfish_cli.fitting.findings import FieldCells, field_cells
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.units import length_words

_BAND_DEG = 20.0
# A part counts as empty when so many of its squares hold no corner.
_EMPTY_SHARE = 0.6
_FACING_DEG, _TILTED_DEG = 20.0, 20.0
_FEW_CORNERS = 6
_TILT_SHARE = 0.06
_FEW_FACES = 4
# Distances that differ by less than this factor are one distance.
_SPREAD = 1.5
_WAYS = ("right", "down", "left", "up")


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the picture without corners.

    Attributes:
        sides: indices of SIDES; all eight is a ring, none the middle.
        from_deg, to_deg: angles from the axis.
        share: of the field's squares that are empty there, of all squares of the field.

    """

    sides: tuple[int, ...]
    from_deg: float
    to_deg: float
    share: float

    @property
    def words(self) -> str:
        """``upper left, 60–80° from the axis``."""
        reach = f"{self.from_deg:.0f}–{self.to_deg:.0f}° from the axis"
        if not self.sides:
            return f"the middle, up to {self.to_deg:.0f}° from the axis"
        if len(self.sides) == 8:
            return f"all around, {reach}"
        return f"{listed([SIDES[side] for side in self.sides])}, {reach}"

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "sides": [SIDES[side] for side in self.sides],
            "from_deg": self.from_deg,
            "to_deg": self.to_deg,
            "share": self.share,
            "words": self.words,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Gaps:
    """What photos so far do not show.

    Attributes:
        parts: empty parts of the field, the largest first.
        cells: the field in squares, and which hold corners.
        tilts: what is missing of tilts, a line each; none where there is no target.
        distances: what is missing of distances, likewise.

    """

    parts: tuple[Part, ...]
    cells: FieldCells
    tilts: tuple[str, ...]
    distances: tuple[str, ...]


def find_gaps(
    camera: CubicCamera, pairs: Observations, poses: Poses | None, target: Target | None
) -> Gaps:
    """Look for what is missing.

    Args:
        camera: the camera.
        pairs: the corners that it was fitted to.
        poses: camera_from_world of each of ``pairs.images``, in the target's units; None where
            they are not known.
        target: the calibration target; None for pairs that came without one.

    """
    cells = field_cells(camera, pairs.pixel)
    of_target = None if poses is None or target is None else (pairs, poses, target)
    return Gaps(
        parts=tuple(_empty_parts(camera, cells)),
        cells=cells,
        tilts=tuple(_missing_tilts(*of_target)) if of_target else (),
        distances=tuple(_missing_distances(*of_target)) if of_target else (),
    )


def _empty_parts(camera: CubicCamera, cells: FieldCells) -> list[Part]:
    row, column = np.nonzero(cells.field)
    pixel = (np.stack([column, row], axis=-1) + 0.5) * cells.cell - 0.5
    rays = camera.unproject(pixel)
    seen = np.isfinite(rays[:, 0])
    row, column, rays = row[seen], column[seen], rays[seen]
    if not len(rays):
        return []
    angle = np.degrees(np.arccos(np.clip(rays[:, 2], -1, 1)))
    band = np.floor(angle / _BAND_DEG).astype(int)
    # The middle has no sides.
    side = np.where(band == 0, 8, side_of(rays[:, :2]))
    gone = cells.empty[row, column]
    bands = band.max() + 1
    size = [np.arange(bands + 1), np.arange(10)]
    all_, holes = (np.histogram2d(band[some], side[some], size)[0] for some in (slice(None), gone))
    lost = (all_ > 0) & (holes >= _EMPTY_SHARE * all_)
    for number in range(2, bands):
        # Bands that no square's middle lies in are like those inside them.
        lost[number] |= (all_[number] == 0) & lost[number - 1]
    parts = []
    if lost[0, 8]:
        parts.append(_part(camera, (), 0, 1, holes[0, 8] / len(rays)))
    for runs in _joined([_runs(lost[1:, side]) for side in range(8)]):
        first, stop = min(run[1] for run in runs) + 1, max(run[2] for run in runs) + 1
        sides = tuple(dict.fromkeys(run[0] for run in runs))
        share = sum(holes[one + 1 : end + 1, side].sum() for side, one, end in runs) / len(rays)
        parts.append(_part(camera, sides, first, stop, share))
    parts.sort(key=lambda part: -part.share)
    # Joined parts reach over what lies between them.
    return [
        part
        for number, part in enumerate(parts)
        if not any(_holds(larger, part) for larger in parts[:number])
    ]


def _holds(larger: Part, part: Part) -> bool:
    within = larger.from_deg <= part.from_deg and part.to_deg <= larger.to_deg
    return bool(part.sides) and within and set(part.sides) <= set(larger.sides)


def _runs(lost: BoolArray) -> list[tuple[int, int]]:
    """First and stop of each run of true values."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    return [(int(first), int(stop)) for first, stop in edge.reshape(-1, 2)]


def _joined(by_side: Sequence[Sequence[tuple[int, int]]]) -> list[list[tuple[int, int, int]]]:
    """Runs of neighbouring sides that reach about as far in and out as one part of the picture.

    Args:
        by_side: first and stop of each side's runs of bands.

    Returns:
        For each part its runs: side, first and stop, clockwise.

    """
    groups: list[list[tuple[int, int, int]]] = []
    for side, runs in enumerate(by_side):
        for first, stop in runs:
            run = (side, first, stop)
            own = next((group for group in groups if _touch(group[-1], run)), None)
            if own is None:
                groups.append([run])
            else:
                own.append(run)
    # Around the circle the last side is the first one's neighbour.
    for group in groups[1:]:
        if _touch(group[-1], groups[0][0]) and group[-1][0] == 7:
            groups[0] = group + groups[0]
            groups.remove(group)
            break
    return groups


def _touch(one: tuple[int, int, int], other: tuple[int, int, int]) -> bool:
    return (
        (one[0] + 1) % 8 == other[0]
        and abs(one[1] - other[1]) <= 1
        and abs(one[2] - other[2]) <= 1
        and max(one[1], other[1]) < min(one[2], other[2])
    )


def _part(camera: CubicCamera, sides: tuple[int, ...], first: int, stop: int, share: float) -> Part:
    return Part(
        sides=sides,
        from_deg=first * _BAND_DEG,
        to_deg=min(stop * _BAND_DEG, camera.max_angle_deg),
        share=float(share),
    )


def _faces(pairs: Observations, poses: Poses, target: Target) -> tuple[FloatArray, FloatArray]:
    """Where each board of each photo looks and is (F, 3) each, camera frame."""
    key = pairs.image * len(target.boards) + pairs.board
    keys, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    points = poses.apply(pairs.image, pairs.world)
    middle = np.zeros((len(keys), 3))
    np.add.at(middle, inverse.reshape(-1), points)
    middle /= counts[:, None]
    photo, board = np.divmod(keys, len(target.boards))
    normal = -np.stack([one.axes[2] for one in target.boards])[board]
    front = (poses.rotation[photo] @ normal[..., None])[..., 0]
    printed = np.array([one.points is None for one in target.boards])[board]
    kept = printed & (counts >= _FEW_CORNERS)
    return front[kept], middle[kept]


def _missing_tilts(pairs: Observations, poses: Poses, target: Target) -> list[str]:
    front, middle = _faces(pairs, poses, target)
    if len(front) < _FEW_FACES:
        return []
    angle, towards = slant(front, middle)
    way = np.rint(azimuth(towards) / (np.pi / 2)).astype(int) % 4
    tilted = angle > _TILTED_DEG
    lines = []
    least = max(1.0, _TILT_SHARE * len(front))
    rare = [_WAYS[one] for one in range(4) if (tilted & (way == one)).sum() < least]
    if rare:
        lines.append(f"hardly any board has its face turned {listed(rare)} (by 20° or more)")
    if (angle <= _FACING_DEG).sum() < 1 and len(target.boards) == 1:
        lines.append("no photo shows the board facing the camera")
    return lines


def photo_distances(pairs: Observations, poses: Poses) -> tuple[FloatArray, FloatArray]:
    """How far each photo was from its corners in the median, and from the nearest: (M,) each.

    The middle of the corners would not do: inside a box it is where the camera is.
    """
    away = np.linalg.norm(poses.apply(pairs.image, pairs.world), axis=-1)
    of_photo = np.split(
        away[np.argsort(pairs.image, kind="stable")],
        np.cumsum(np.bincount(pairs.image, minlength=len(poses)))[:-1],
    )
    known = [own for own in of_photo if len(own)]
    return np.array([np.median(own) for own in known]), np.array([own.min() for own in known])


def _missing_distances(pairs: Observations, poses: Poses, target: Target) -> list[str]:
    if len(poses) < 2:
        return []
    distance, _ = photo_distances(pairs, poses)
    near, far = float(distance.min()), float(distance.max())
    if far > _SPREAD * near:
        return []
    units = target.units
    return [
        f"all photos are from {length_words(near, units)} to {length_words(far, units)} away: take "
        f"one from {length_words(0.6 * near, units)} and one from {length_words(1.7 * far, units)}"
    ]


# Clockwise from the right, y down, an eighth of a turn each.
SIDES = (
    "right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right",
)  # fmt: skip
_MIDDLE_DEG = 12.0
# Below this slant a face looks at the camera.
_HEAD_ON_DEG = 12.0


def side_of(offset: FloatArray) -> IntArray:
    """Which eighth of the picture offsets (..., 2) from the axis lie in, an index of SIDES."""
    turn = azimuth(offset)
    eighth: IntArray = np.rint(turn / (np.pi / 4)).astype(np.intp) % 8
    return eighth


def place_words(ray: FloatArray) -> str:
    """Where in the picture a ray (3,) is: ``in the lower right of the picture, 52° ...``."""
    angle = float(np.degrees(angle_from_axis(ray)))
    if angle < _MIDDLE_DEG:
        return "in the middle of the picture"
    side = SIDES[int(side_of(ray[:2]))]
    word = {"bottom": "at", "top": "at", "left": "on", "right": "on"}.get(side, "in")
    return f"{word} the {side} of the picture, {angle:.0f}° from the axis"


def across(middle: FloatArray) -> FloatArray:
    """(..., 2, 3) unit vectors to the right and down in the picture, across rays (..., 3).

    The camera's own x and y, turned along with its axis to the ray the short way.
    """
    ray = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(ray, -1, 0)
    share = 1 / np.maximum(1 + z, 1e-9)
    right = np.stack([1 - x * x * share, -x * y * share, -x], axis=-1)
    down = np.stack([-x * y * share, 1 - y * y * share, -y], axis=-1)
    return np.stack([right, down], axis=-2)


def slant(front: FloatArray, middle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How faces are tilted: degrees (...), and towards where in the picture (..., 2), unit.

    Args:
        front: (..., 3) where the faces look, unit vectors in the camera frame.
        middle: (..., 3) where they are.

    """
    ray = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    cosine = np.clip(-(front * ray).sum(axis=-1), -1, 1)
    towards = (across(middle) @ front[..., None])[..., 0]
    length = np.linalg.norm(towards, axis=-1, keepdims=True)
    return np.degrees(np.arccos(cosine)), towards / np.maximum(length, 1e-12)


def tilt_words(front: FloatArray, middle: FloatArray) -> str:
    """``its face turned 35° to the left`` (its left edge is then the farther one), or facing."""
    angle, towards = slant(front, middle)
    if angle < _HEAD_ON_DEG:
        return "facing the camera"
    side = SIDES[int(side_of(towards))]
    where = {"bottom": "downwards", "top": "upwards"}.get(side, f"to the {side}")
    return f"its face turned {float(angle):.0f}° {where}"


def listed(words: list[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
