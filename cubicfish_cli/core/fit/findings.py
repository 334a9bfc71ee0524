"""What a person should know about a fit beyond its figures, with the likely cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.core.angles import angle_from_axis, azimuth
from cubicfish_cli.core.codes import Code
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.robust import noise_by_photo
from cubicfish_cli.core.geometry import inside_polygon
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.point import PointCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import BoolArray, FloatArray

# Cells along the photo's shorter side in which coverage is counted.
_CELLS = 8
# A camera beyond 90° sees itself where corners leave a middle so large and round: the farthest of
# eight sides begins at this many times the angle of the nearest.
_BLIND_DEG, _ROUND = 30.0, 1.5
_FEW_PHOTOS = 3
# A photo this many times noisier than the median photo does more harm than good.
_NOISY = 4.0
_NOISY_PX = 0.5
_GROUP_SHARE = 0.5
_GROUP_SIZE = 4


def blind_angle(points: FloatArray) -> float:
    """How far from its axis a camera sees itself, radians; 0 where it seems to see other things.

    A camera that looks into a mirror is in the middle of its own picture: all around the axis no
    corner is nearer than by about one angle.

    Args:
        points: (N, 3) all corners, camera frame; those that are NaN count for nothing.

    """
    points = points[np.isfinite(points[:, 0])]
    angle = angle_from_axis(points)
    eighth = np.floor(azimuth(points[:, :2]) / (np.pi / 4)).astype(int) % 8
    nearest = np.full(8, np.inf)
    np.minimum.at(nearest, eighth, angle)
    low, high = nearest.min(), nearest.max()
    round_ = np.radians(_BLIND_DEG) <= low and high <= _ROUND * low
    return float(low) if round_ and angle.max(initial=0.0) > np.pi / 2 else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldCells:
    """What coverage counts: the field where a camera may be trusted, in squares.

    Attributes:
        cell: side of a square, pixels.
        field: (rows, columns) whether a square's middle lies in the field, and where the camera
            does not see itself.
        hit: (rows, columns) whether a square holds a corner.
        blind: how far from its axis the camera sees itself, radians.

    """

    cell: float
    field: BoolArray
    hit: BoolArray
    blind: float

    @property
    def coverage(self) -> float:
        """Share of the field's squares that hold a corner, 0 to 1."""
        return float((self.hit & self.field).sum() / max(self.field.sum(), 1))

    @property
    def empty(self) -> BoolArray:
        """(rows, columns) squares of the field without a corner."""
        return self.field & ~self.hit


def field_cells(camera: CubicCamera | PointCamera, pixel: FloatArray) -> FieldCells:
    """The field of a camera in squares, and which of them hold corners (N, 2), pixels."""
    width, height = camera.image_size
    cell = min(camera.image_size) / _CELLS
    x = np.arange(cell / 2, width, cell)
    y = np.arange(cell / 2, height, cell)
    middle = np.stack(np.meshgrid(x, y), axis=-1)
    field = inside_polygon(middle.reshape(-1, 2), camera.outline()).reshape(middle.shape[:2])
    blind = 0.0
    if isinstance(camera, CubicCamera):
        blind = blind_angle(camera.unproject(pixel))
        if blind:
            field &= ~(angle_from_axis(camera.unproject(middle)) < blind)
    column, row = np.floor(pixel / cell).astype(int).T
    kept = (column >= 0) & (row >= 0) & (column < len(x)) & (row < len(y))
    hit = np.zeros_like(field)
    hit[row[kept], column[kept]] = True
    return FieldCells(cell=cell, field=field, hit=hit, blind=blind)


def dropped_groups(
    before: Observations, dropped: Sequence[tuple[str, str | None, float]]
) -> list[Finding]:
    """Boards of which a photo lost most corners: no single slips but one cause.

    Args:
        before: the pairs before any was dropped.
        dropped: photo, board and error in pixels of each dropped corner.

    """
    groups: dict[tuple[str, str], list[float]] = {}
    for image, board, error in dropped:
        if board is not None:
            groups.setdefault((image, board), []).append(error)
    lost: dict[str, list[tuple[str, list[float], int]]] = {}
    for (image, board), errors in groups.items():
        own = (before.image == before.images.index(image)) & (
            before.board == before.boards.index(board)
        )
        if len(errors) >= max(_GROUP_SIZE, _GROUP_SHARE * own.sum()):
            lost.setdefault(board, []).append((image, errors, int(own.sum())))
    return [_group(board, own) for board, own in lost.items()]


def _group(board: str, lost: Sequence[tuple[str, list[float], int]]) -> Finding:
    """What is said of photos that lost most corners of a board: names, errors, all corners."""
    typical = [float(np.median(errors)) for _, errors, _ in lost]
    return Finding(
        code=Code.BOARD_DROPPED,
        images=tuple(image for image, _, _ in lost),
        boards=(board,),
        figures={
            "dropped": sum(len(errors) for _, errors, _ in lost),
            "corners": sum(all_ for *_, all_ in lost),
            "low_px": min(typical),
            "high_px": max(typical),
        },
    )


def noisy_photos(pairs: Observations, residual: FloatArray) -> dict[int, Finding]:
    """Photos whose corners are much noisier than the others': blurred, moving, badly lit.

    Returns:
        Index of each and what to say of it; none where they would be a third or more.

    """
    photos = len(pairs.images)
    if photos < _FEW_PHOTOS + 1:
        return {}
    noise = noise_by_photo(pairs.image, residual, photos)
    typical = float(np.median(noise))
    noisy = np.flatnonzero(noise > max(_NOISY * typical, _NOISY_PX))
    if 3 * len(noisy) >= photos:
        return {}
    return {
        int(photo): Finding(
            code=Code.NOISY,
            images=(pairs.images[photo],),
            figures={"times": float(noise[photo] / typical)},
        )
        for photo in noisy
    }
