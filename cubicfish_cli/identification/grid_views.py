"""The lens and every grid's pose before any grid has a name.

A grid of squares is a plane with known geometry whatever its name, so the grids of all photos,
each with a pose of its own, calibrate a radial lens. Under this lens every grid has a place in
front of the camera, in squares, and names follow from how these places fit together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.fitting.adjustment import adjust
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.lenses import FixedLens
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.robust import huber_px
from cubicfish_cli.identification.search import GridView, grid_moments
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.placement import Reach
from cubicfish_cli.types import FloatArray, IntArray

# RMS, as a share of the distance of neighbouring corners, from which a grid is no plane of
# squares, and from which it does not fit a place: targets are never quite as drawn, while one
# step along the board, or another board, misses by several times as much.
_PLANE_STEPS, _PLACE_STEPS = 0.1, 0.25
_SMALLEST_GATE_PX = 1.0
# Corners in all, beyond which grids are thinned, and how many each keeps at least.
_ENOUGH_CORNERS, _LEAST_CORNERS = 15_000, 100
# A mirrored pose counts as possible too while its error is at most this many times the other's.
_MIRROR_RATIO = 1.5
_MIRROR_SLACK_PX = 0.05
_DIFFERENT_DEG = 3.0


def _gate_px(grid: Grid, steps: float) -> float:
    return max(_SMALLEST_GATE_PX, steps * grid.step)


def anonymous_pairs(grids: Sequence[Grid], image_size: tuple[int, int]) -> Observations:
    """Each grid as a photo of its own plane, in squares: corner (i, j) is at (i, j, 0).

    Of very many corners only some of each grid are taken, spread over it.
    """
    most = max(_LEAST_CORNERS, _ENOUGH_CORNERS // max(len(grids), 1))
    picks = [_spread(len(grid), most) for grid in grids]
    return pairs_of_parts(
        [on_plane(grid)[pick] for grid, pick in zip(grids, picks, strict=True)],
        [grid.pixel[pick] for grid, pick in zip(grids, picks, strict=True)],
        image_size,
    )


def on_plane(grid: Grid) -> FloatArray:
    """(N, 3) where its corners are on its own plane, in squares."""
    return np.column_stack([grid.cells, np.zeros(len(grid))]).astype(float)


def pairs_of_parts(
    world: Sequence[FloatArray], pixel: Sequence[FloatArray], image_size: tuple[int, int]
) -> Observations:
    """Pairs without names, one part per photo: (N, 3) points and (N, 2) pixels each."""
    counts = [len(one) for one in pixel]
    return Observations.without_names(
        image_size=image_size,
        images=tuple(str(index) for index in range(len(counts))),
        image=np.repeat(np.arange(len(counts)), counts),
        world=np.concatenate(world),
        pixel=np.concatenate(pixel),
        column=np.arange(sum(counts)),
    )


def _spread(count: int, most: int) -> IntArray:
    """At most ``most`` of ``count`` indices, without a pattern, the same every time."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).permutation(count)[:most])


@dataclass(frozen=True, kw_only=True, eq=False)
class GridPose:
    """Where one grid is under a known lens.

    Attributes:
        rotation, translation: (C, 3, 3), (C, 3) camera_from_grid in squares, best first.
        rms_px: how well it fits a plane of squares.

    """

    rotation: FloatArray
    translation: FloatArray
    rms_px: float


def grid_poses(
    camera: RadialCamera, grids: Sequence[Grid], image_size: tuple[int, int]
) -> list[GridPose | None]:
    """The pose of every grid; None where its corners are no plane of squares."""
    pairs = anonymous_pairs(grids, image_size)
    fit, own, placed = fit_poses(camera, pairs)
    found: list[GridPose | None] = [None] * len(grids)
    if fit is None:
        return found
    rms = _rms(fit.residual, own)
    middle = np.stack([own.world[own.image == k].mean(axis=0) for k in range(len(placed))])
    mirror = adjust(
        FixedLens(camera=camera),
        _mirrored(fit.poses, middle),
        own,
        huber_px=huber_px(fit.residual),
        max_iterations=20,
    )
    mirror_rms = _rms(mirror.residual, own)
    for k, index in enumerate(placed):
        rivals = sorted([(rms[k], 0), (mirror_rms[k], 1)])
        if rivals[0][0] > _gate_px(grids[index], _PLANE_STEPS):
            continue
        both = Poses(
            rotation=np.stack([fit.poses.rotation[k], mirror.poses.rotation[k]]),
            translation=np.stack([fit.poses.translation[k], mirror.poses.translation[k]]),
        )
        order = [rivals[0][1]]
        trace = np.trace(both.rotation[0] @ both.rotation[1].T)
        apart = trace < 1 + 2 * np.cos(np.deg2rad(_DIFFERENT_DEG))
        if apart and rivals[1][0] < _MIRROR_RATIO * rivals[0][0] + _MIRROR_SLACK_PX:
            order.append(rivals[1][1])
        found[index] = GridPose(
            rotation=both.rotation[order],
            translation=both.translation[order],
            rms_px=float(rivals[0][0]),
        )
    return found


def view_of(camera: RadialCamera, grid: Grid, pose: GridPose, reach: Reach) -> GridView:
    """What the search for names needs of a grid."""
    middle = np.array([*grid.cells.mean(axis=0), 1.0])
    camera_from_grid = np.column_stack([pose.rotation[0][:, :2], pose.translation[0]])
    return GridView(
        reach=reach,
        middle=middle,
        rotation=pose.rotation,
        camera_middle=pose.rotation[:, :, :2] @ middle[:2] + pose.translation,
        moments=grid_moments(camera, grid.cells, grid.pixel, camera_from_grid),
        corners=len(grid),
        gate_px=_gate_px(grid, _PLACE_STEPS),
    )


def _rms(residual: FloatArray, pairs: Observations) -> FloatArray:
    squares = np.bincount(pairs.image, weights=np.square(residual).sum(axis=1))
    return np.sqrt(squares / np.bincount(pairs.image))


def _mirrored(poses: Poses, middle: FloatArray) -> Poses:
    """The planes that look alike from afar: depth about the middle reversed (Necker's cube)."""
    centre = (poses.rotation @ middle[:, :, None])[:, :, 0] + poses.translation
    sight = centre / np.linalg.norm(centre, axis=1, keepdims=True)
    columns = poses.rotation[:, :, :2]
    depth = sight[:, None, :] @ columns
    columns = columns - 2 * sight[:, :, None] * depth
    normal = np.cross(columns[..., 0], columns[..., 1])
    rotation = np.concatenate([columns, normal[..., None]], axis=-1)
    return Poses(rotation=rotation, translation=centre - (rotation @ middle[:, :, None])[:, :, 0])
