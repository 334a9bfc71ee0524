"""A second pass: with a fitted camera, look for the corners that the first pass missed.

The camera predicts where every corner of the target is in every photo. Where the photo shows a
corner there, by the same tests as in the first pass, it is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit.calibrate import calibrate
from cubicfish_cli.core.fit.calibration import Calibration
from cubicfish_cli.core.fit.statistics import gross_px
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import round_pixels
from cubicfish_cli.corners.detection.pyramid import build_pyramid
from cubicfish_cli.corners.detection.refine import refine_corners
from cubicfish_cli.corners.identification.identified import Detection, PhotoReport

# A corner that is found further from its prediction than this share of a square is another one.
_FARTHEST_SHARE = 0.2
# A board seen flatter than this (cosine of the slant) shows no squares to check.
_FLATTEST = 0.03
# Boards have fewer columns, and fewer rows.
_MOST_COUNT = 1_000_000
# Parts of a square in which the board's local shape is measured.
_STEP = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Where a photo should show the target's corners.

    Attributes:
        corners: names and pixels (N, 2) of the corners.
        step: (N, 2, 2) columns dp/d column and dp/d row.
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
        predicted = self.corners.pixel
        # Known corners take part: a corner is judged by those around it.
        pixel, ok = refine_corners(build_pyramid(grey), predicted, self.step, self.sign, self.bend)
        side = np.hypot(self.step[:, 0], self.step[:, 1]).min(axis=1)
        moved = np.hypot(*(pixel - predicted).T)
        ok &= moved < np.minimum(self.limit_px, _FARTHEST_SHARE * side)
        return replace(self.corners, pixel=round_pixels(pixel)).select(ok & ~self.known)


def predicted_corners(detection: Detection, target: Target) -> dict[str, Prediction]:
    """Where photos should show corners, by a camera fitted to the first pass.

    Photos in which a board was placed by convention only are left as they are.

    Args:
        detection: the first pass.
        target: the calibration target.

    Returns:
        Of each photo by name; none where no camera can be fitted.

    """
    # Corners of tags come with their tags, all that there are.
    if not any(board.has_squares for board in target.boards):
        return {}
    try:
        fit = calibrate(detection.corners, target=target, refine_target="off", hold_out=False)
    except FitError:
        return {}
    exact = {report.name for report in detection.photos if report.exact}
    return {
        name: _predict_photo(name, number, fit, detection, target)
        for number, name in enumerate(fit.pairs.images)
        if name in exact
    }


def _predict_photo(
    name: str, number: int, fit: Calibration, detection: Detection, target: Target
) -> Prediction:
    corners = detection.corners
    rotation, translation = fit.poses.rotation[number], fit.poses.translation[number]
    parts = [
        _predict_board(index, board, fit.camera, rotation, translation)
        for index, board in enumerate(target.boards)
        if board.has_squares
    ]
    board, column, row, pixel, step, bend, sign = (
        np.concatenate([part[field] for part in parts]) for field in range(7)
    )
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
    return Prediction(
        corners=predicted,
        step=step,
        bend=bend,
        sign=-sign if detection.other_colours else sign,
        known=np.isin(_number_places(predicted), _number_places(corners.of(name))),
        limit_px=gross_px(fit.residual),
    )


def _number_places(corners: Observations) -> IntArray:
    """(N,) one number for each place on the target."""
    return np.asarray((corners.board * _MOST_COUNT + corners.row) * _MOST_COUNT + corners.column)


def _predict_board(
    index: int, board: Board, camera: CubicCamera, rotation: FloatArray, translation: FloatArray
) -> tuple[npt.NDArray, ...]:
    """Names, pixels, local shape and colour of the corners that face the camera in its field."""
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
    every = (np.full(len(column), index), column, row, middle, step, bend, sign)
    return tuple(one[use] for one in every)


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
            _add_counts(report, joint, added.get(report.name, 0)) for report in detection.photos
        ),
    )


def _add_counts(report: PhotoReport, corners: Observations, added: int) -> PhotoReport:
    if not added:
        return report
    own = corners.image == corners.images.index(report.name)
    return replace(
        report,
        added=added,
        corners=report.corners + added,
        boards=tuple(corners.boards[board] for board in np.unique(corners.board[own])),
    )
