"""A second pass: with a fitted camera, look for the corners that the first pass missed.

Photos in which all corners of all boards are known are not looked at, and where there are no others
no camera is fitted. In the rest the camera predicts where each missing corner is. Where the photo
shows a corner there, by the same tests as in the first pass, it is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.errors import FitError
from cubicfish.find.detection.grids import round_pixels
from cubicfish.find.detection.medians import medians
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import Pyramid, build_pyramid, measure_noise
from cubicfish.find.detection.refine import refine_corners
from cubicfish.find.identification.identified import Detection
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.calibration import Calibration
from cubicfish.fit.rough_fit import RoughFit, fit_roughly
from cubicfish.models.cubic import CubicCamera
from cubicfish.solve.statistics import gross_px, neighbours
from cubicfish.target.boards.board import Board
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import BoolArray, FloatArray, IntArray

# A corner that is found further from its prediction than this share of a square is another one.
_FARTHEST_SHARE = 0.2
# A board seen flatter than this (cosine of the slant) shows no squares to check.
_FLATTEST = 0.03
# Boards have fewer columns, and fewer rows.
_MOST_COUNT = 1_000_000
# Parts of a square in which the board's local shape is measured.
_STEP = 0.5
# A corner is searched from within a tenth of a square: a camera that leaves half of that to nearly
# all corners that it was fitted to serves.
_NEAR_SHARE = 0.05
# Corners around a missing one that it is judged by: the nearest twelve, and of both colours seven.
_AROUND = 16
# A square's and its neighbours' corners: their median follows none that is off by itself.
_BESIDE = 8
# Windows of corners reach less far.
_MARGIN_PX = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Where a photo should show the corners of boards of which some are missing.

    Attributes:
        corners: names and pixels (N, 2) of the corners.
        step: (N, 2, 2) columns dp/d column and dp/d row there, by the camera.
        bend: (N, 2, 3) second derivatives by column², column·row, row².
        sign: (N,) +1 where the square towards +column and +row is bright, else -1.
        known: (N,) whether the first pass has it.
        limit_px: how far from its prediction a corner may be.

    """

    corners: Observations
    step: FloatArray
    bend: FloatArray
    sign: IntArray
    known: BoolArray
    limit_px: float

    def seen_in(self, grey: npt.NDArray[np.generic]) -> Observations:
        """The unknown corners that the photo (H, W) shows."""
        every = self.corners.pixel
        # A corner is judged by those around it, known ones among them.
        _, around = nearest(every[~self.known], every, _AROUND)
        rows = np.unique(around)
        predicted, step = every[rows], self.step[rows]
        pyramid, first = _cut_out(grey, every)
        pixel, ok = refine_corners(
            pyramid, predicted - first, step, self.sign[rows], self.bend[rows]
        )
        pixel += first
        side = np.hypot(step[:, 0], step[:, 1]).min(axis=1)
        moved = np.hypot(*(pixel - predicted).T)
        ok &= moved < np.minimum(self.limit_px, _FARTHEST_SHARE * side)
        found = replace(self.corners.select(rows), pixel=round_pixels(pixel))
        return found.select(ok & ~self.known[rows])


def _cut_out(grey: npt.NDArray[np.generic], pixel: FloatArray) -> tuple[Pyramid, IntArray]:
    """The part of a photo (H, W) that shows whole boards, and its first pixel (2,): x, y.

    How bright white gets is seen on the boards themselves, but noise only on all of the photo: it
    is estimated where nothing else is.
    """
    height, width = grey.shape
    first = np.maximum(np.floor(pixel.min(axis=0)).astype(int) - _MARGIN_PX, 0)
    x, y = np.minimum(np.ceil(pixel.max(axis=0)).astype(int) + _MARGIN_PX + 1, (width, height))
    part = build_pyramid(grey[first[1] : y, first[0] : x])
    noise, gain = measure_noise(grey)
    return replace(part, noise=noise * part.gain / gain), first


def predicted_corners(detection: Detection, target: Target) -> dict[str, Prediction]:
    """Where photos should show corners that are missing, by a camera fitted to the first pass.

    Photos in which a board was placed by convention only are left as they are.

    Args:
        detection: the first pass.
        target: the calibration target.

    Returns:
        Of each photo that should show more, by name; none where no camera can be fitted.

    """
    lacking = _find_lacking(detection, target)
    if not lacking:
        return {}
    try:
        fit = _fit_camera(detection.corners, target)
    except FitError:
        return {}
    predicted = {
        name: _predict_photo(name, number, fit, detection, target)
        for number, name in enumerate(fit.pairs.images)
        if name in lacking
    }
    return {name: one for name, one in predicted.items() if one is not None}


def _find_lacking(detection: Detection, target: Target) -> set[str]:
    """The photos, of those whose names are certain, in which some board lacks corners."""
    corners = detection.corners
    # Corners of tags come with their tags, all that there are.
    size = np.array([board.has_squares * board.columns * board.rows for board in target.boards])
    known = np.bincount(corners.image[size[corners.board] > 0], minlength=len(corners.images))
    lacking = {corners.images[photo] for photo in np.flatnonzero(known < size.sum())}
    return lacking & {report.name for report in detection.photos if report.exact}


def _fit_camera(corners: Observations, target: Target) -> RoughFit | Calibration:
    """The camera that is good enough to say where corners are, and costs least.

    Raises:
        FitError: no camera can be fitted.

    """
    rough = fit_roughly(corners)
    beside, _ = neighbours(rough.pairs)
    rows = np.flatnonzero(beside >= 0)
    side = np.hypot(*(rough.pairs.pixel[beside[rows]] - rough.pairs.pixel[rows]).T)
    off = np.hypot(*rough.residual[rows].T) / side
    if len(rows) and np.percentile(off, 95) < _NEAR_SHARE:
        return rough
    return calibrate(corners, target=target, refine_target="off", hold_out=False)


def _predict_photo(
    name: str, number: int, fit: RoughFit | Calibration, detection: Detection, target: Target
) -> Prediction | None:
    """Where a photo shows the boards that lack corners; None where none does."""
    corners = detection.corners
    rotation, translation = fit.poses.rotation[number], fit.poses.translation[number]
    parts = [
        _predict_board(index, board, fit.camera, rotation, translation)
        for index, board in enumerate(target.boards)
        if board.has_squares
    ]
    board, column, row, pixel, step, bend, sign = map(np.concatenate, zip(*parts, strict=True))
    pixel = pixel - _find_shared_miss(board, pixel, fit, number)
    predicted = Observations(
        image_size=corners.image_size,
        images=(name,),
        boards=corners.boards,
        image=np.zeros(len(board), np.intp),
        board=board,
        column=column,
        row=row,
        pixel=pixel,
    ).with_target(target)
    known = np.isin(_number_places(predicted), _number_places(corners.of(name)))
    lacking = np.isin(board, board[~known])
    if not lacking.any():
        return None
    return Prediction(
        corners=predicted.select(lacking),
        step=step[lacking],
        bend=bend[lacking],
        sign=-sign[lacking] if detection.other_colours else sign[lacking],
        known=known[lacking],
        limit_px=gross_px(fit.residual),
    )


def _find_shared_miss(
    board: IntArray, pixel: FloatArray, fit: RoughFit | Calibration, photo: int
) -> FloatArray:
    """How far off (N, 2) predictions are, pixels, by the corners next to them on their board.

    Neighbours share what a lens, a pose or a sheet leaves. 0 on a board without known corners.
    """
    miss = np.zeros_like(pixel)
    for index in np.unique(board):
        known = (fit.pairs.image == photo) & (fit.pairs.board == index)
        if known.any():
            rows = board == index
            _, beside = nearest(pixel[rows], fit.pairs.pixel[known], _BESIDE)
            miss[rows] = medians(fit.residual[known][beside], axis=1)
    return miss


def _number_places(corners: Observations) -> IntArray:
    """(N,) one number for each place on the target."""
    return np.asarray((corners.board * _MOST_COUNT + corners.row) * _MOST_COUNT + corners.column)


def _predict_board(
    index: int, board: Board, camera: CubicCamera, rotation: FloatArray, translation: FloatArray
) -> tuple[npt.NDArray[Any], ...]:
    """The corners that face the camera in its field.

    The board's index, columns, rows and pixels; steps, bends and signs as of :class:`Prediction`.
    """
    row, column = (part.ravel() for part in np.mgrid[: board.rows, : board.columns])

    def seen(columns: FloatArray, rows: FloatArray) -> FloatArray:
        points = board.world_points(columns, rows) @ rotation.T + translation
        return camera.project(points, near=True)

    points = board.world_points(column, row) @ rotation.T + translation
    slant = points @ (rotation @ board.axes[2]) / np.linalg.norm(points, axis=-1)
    shifts = {
        (a, b): seen(column + _STEP * a, row + _STEP * b) for a in (-1, 0, 1) for b in (-1, 0, 1)
    }
    middle = shifts[0, 0]
    step = np.stack([shifts[1, 0] - shifts[-1, 0], shifts[0, 1] - shifts[0, -1]], axis=-1) / (
        2 * _STEP
    )
    bend = (
        np.stack(
            [
                shifts[1, 0] - 2 * middle + shifts[-1, 0],
                (shifts[1, 1] - shifts[1, -1] - shifts[-1, 1] + shifts[-1, -1]) / 4,
                shifts[0, 1] - 2 * middle + shifts[0, -1],
            ],
            axis=-1,
        )
        / _STEP**2
    )
    width, height = camera.image_size
    use = (slant > _FLATTEST) & np.isfinite(step).all(axis=(1, 2)) & np.isfinite(bend).all((1, 2))
    use &= (middle > 0).all(axis=1) & (middle < (width - 1, height - 1)).all(axis=1)
    # The square down-right of corner (0, 0) has the colour of the one up-left of it.
    sign = np.where((board.first_square == "light") ^ ((column + row) % 2 == 1), 1, -1)
    found = (np.full(len(column), index), column, row, middle, step, bend, sign)
    return tuple(one[use] for one in found)


def with_added(detection: Detection, found: Sequence[Observations]) -> Detection:
    """A first pass with the corners that its photos show beside it."""
    corners = detection.corners
    added = {new.images[0]: len(new.image) for new in found}
    numbers = (corners.images.index(name) for name in added)
    parts = [replace(new, image=new.image + n) for new, n in zip(found, numbers, strict=True)]
    # Only photos whose names are certain are searched again.
    joint = Observations.stacked([corners, *parts]).in_order()
    return replace(
        detection,
        corners=joint,
        photos=tuple(
            report.with_corners(joint, joint.images.index(report.name), added[report.name])
            if added.get(report.name)
            else report
            for report in detection.photos
        ),
    )
