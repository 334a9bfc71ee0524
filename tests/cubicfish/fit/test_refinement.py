"""The object as it is: its departures are found, told from noise, and written as a target file."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import synthetic_lens

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.evaluate import evaluate
from cubicfish.solve.deformable_target import NominalTarget
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.target import Target

NOMINAL = synthetic.box_of_four()
NOISE = 0.05


def real_object(*, offsets: float = 0.0) -> Target:
    """The box as built: boards bend, twist, stretch and sit a little off, corners too."""
    rng = np.random.default_rng(8)
    boards = []
    for index, board in enumerate(NOMINAL.boards):
        turn = Rotation.from_rotvec(rng.normal(0, 0.003, 3) * (index > 0)).as_matrix()
        boards.append(
            replace(
                board,
                origin=board.origin + rng.normal(0, 1.0, 3) * (index > 0),
                x_axis=turn @ board.x_axis,
                y_axis=turn @ board.y_axis,
                shape=BoardShape(
                    bend=rng.normal(0, 1.0, 2),
                    twist=float(rng.normal(0, 0.7)),
                    stretch=rng.normal(0, 0.002, 2),
                    offsets=rng.normal(0, max(offsets, 1e-12), (board.rows, board.columns, 3)),
                ),
            )
        )
    return replace(NOMINAL, boards=tuple(boards))


def photos_of(real: Target, count: int = 10, seed: int = 21):
    """Pairs as a user has them: pixels of the real object, world points of the drawn one."""
    poses = synthetic.poses_around(NOMINAL, count, seed=seed)
    corners = synthetic.synthetic_corners(real, poses, noise=NOISE, seed=seed)
    return corners.with_target(NOMINAL)


def test_derivatives_of_the_object():
    pairs = photos_of(NOMINAL, 2)
    world = NominalTarget(pairs=pairs, target=NOMINAL).free(noise=0.1, offset_spread=0.1)
    assert len(world.parameters) == 4 * 5 + 3 * 6
    np.testing.assert_array_equal(world.points, pairs.world)
    d_world = np.random.default_rng(0).standard_normal((len(pairs.world), 2, 3))
    chained = world.chain(d_world, slice(0, len(d_world)))
    none = np.zeros_like(world.offsets)
    for index in range(len(world.parameters)):
        step = np.zeros(len(world.parameters))
        step[index] = 1e-6
        slope = (world.moved(step, none).points - world.moved(-step, none).points) / 2e-6
        expected = (d_world @ slope[:, :, None])[:, :, 0]
        np.testing.assert_allclose(chained[:, :, index], expected, atol=1e-5)


def test_refined_target_is_the_moved_world():
    """World points from the refined target file are those that the fit used."""
    pairs = photos_of(NOMINAL, 3)
    rng = np.random.default_rng(1)
    nominal = NominalTarget(pairs=pairs, target=NOMINAL)
    world = nominal.free(noise=0.1, offset_spread=0.1)
    world = world.moved(rng.normal(0, 0.003, 38), rng.normal(0, 0.2, world.offsets.shape))
    target = nominal.refined(world)
    points = target.world_points(pairs.board, pairs.column, pairs.row)
    np.testing.assert_allclose(points, world.points, atol=1e-9)
    # Refining a refined object adds to what it had.
    nominal = NominalTarget(pairs=replace(pairs, world=points), target=target)
    again = nominal.free(noise=0.1)
    both = nominal.refined(again)
    np.testing.assert_allclose(
        both.world_points(pairs.board, pairs.column, pairs.row), points, atol=1e-9
    )


def test_bends_are_held_as_loosely_as_they_show_but_stretches_as_firmly_as_prints():
    """A stretch and pixels that are not square do the same to a board that is never turned."""
    pairs = photos_of(NOMINAL, 2)
    world = NominalTarget(pairs=pairs, target=NOMINAL).free(noise=0.1)
    nominal = world.spread[:5]
    assert nominal[3:].max() < nominal[:3].min()
    found = world.moved(np.full(len(world.parameters), 0.05), world.offsets)
    spread = found.with_spreads(np.zeros_like(found.parameters)).spread
    assert (spread[:3] > 3 * nominal[:3]).all()
    np.testing.assert_array_equal(spread[3:5], nominal[3:])


@pytest.mark.slow
def test_shape_is_found_and_helps_on_new_photos():
    real = real_object()
    result = calibrate(photos_of(real), target=NOMINAL, refine_target="auto")
    assert result.refined == "shape"
    assert result.errors.rms_px == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    by_level = result.fit.held_out_by_level
    assert by_level["shape"] < 0.6 * by_level["off"]
    assert result.held_out is not None
    assert result.held_out.rms_px == by_level["shape"]
    found, true = result.target.boards[0].shape, real.boards[0].shape
    np.testing.assert_allclose(found.bend, true.bend, atol=0.15)
    assert found.twist == pytest.approx(true.twist, abs=0.15)
    # The overall scale cannot be seen; stretches are known up to it.
    np.testing.assert_allclose(np.diff(found.stretch), np.diff(true.stretch), atol=3e-4)
    fresh = synthetic.synthetic_corners(
        real, synthetic.poses_around(NOMINAL, 5, seed=77), noise=NOISE, seed=5
    )
    refined = evaluate(result.camera, fresh.with_target(result.target)).errors.rms_px
    nominal = evaluate(result.camera, fresh.with_target(NOMINAL)).errors.rms_px
    assert refined < 0.09 < nominal


@pytest.mark.slow
def test_points_are_found_where_there_are_any():
    real = real_object(offsets=0.25)
    result = calibrate(photos_of(real, 16), target=NOMINAL, refine_target="auto")
    assert result.refined == "points"
    levels = result.fit.held_out_by_level
    assert levels["points"] < 0.9 * levels["shape"] < 0.9 * levels["off"]
    pairs = result.pairs
    errors, truths = [], []
    for index in range(len(real.boards)):
        key, photos = np.unique(
            np.stack([pairs.column, pairs.row])[:, pairs.board == index], axis=1, return_counts=True
        )
        column, row = key[:, photos >= 5]
        found = result.target.boards[index].shape.offsets[row, column, :2]
        true = real.boards[index].shape.offsets[row, column, :2]
        # The board's place and stretch may take a part of it that is linear in column and row.
        linear = np.column_stack([column, row, np.ones(len(row))])
        miss = found - true
        errors.append(miss - linear @ np.linalg.lstsq(linear, miss, rcond=None)[0])
        truths.append(true)
    assert np.std(np.vstack(errors)) < 0.5 * np.std(np.vstack(truths))


@pytest.mark.slow
def test_an_exact_object_stays_as_drawn():
    result = calibrate(photos_of(NOMINAL), target=NOMINAL, refine_target="auto")
    assert result.refined == "off"
    assert result.target is NOMINAL
    assert set(result.fit.held_out_by_level) == {"off", "shape", "points"}


@pytest.mark.slow
@pytest.mark.parametrize("level", ["shape", "points"])
def test_noise_alone_bends_nothing(level):
    result = calibrate(photos_of(NOMINAL), target=NOMINAL, refine_target=level, hold_out=False)
    assert result.refined == level
    for board in result.target.boards:
        assert np.abs(board.shape.bend).max() < 0.2
        assert np.abs(board.shape.stretch).max() < 3e-4
        assert np.sqrt(np.mean(board.shape.offsets**2)) < 0.04


@pytest.mark.slow
def test_units_do_not_matter_to_a_refined_object():
    pairs = photos_of(real_object(), 6)
    metres = Target(
        units="m",
        boards=tuple(
            replace(board, square=board.square / 1000, origin=board.origin / 1000)
            for board in NOMINAL.boards
        ),
    )
    one = calibrate(pairs, target=NOMINAL, refine_target="shape", hold_out=False)
    other = calibrate(
        replace(pairs, world=pairs.world / 1000),
        target=metres,
        refine_target="shape",
        hold_out=False,
    )
    np.testing.assert_allclose(other.residual, one.residual, atol=1e-5)
    np.testing.assert_allclose(
        other.target.boards[2].shape.bend * 1000, one.target.boards[2].shape.bend, atol=1e-4
    )


@pytest.mark.slow
def test_pairs_without_a_target_are_left_alone():
    pairs = photos_of(NOMINAL, 5)
    result = calibrate(pairs, refine_target="auto")
    assert (result.refined, result.target) == ("off", None)


def board(**change) -> Board:
    return replace(synthetic.flat_board().boards[0], **change)


@pytest.mark.parametrize(
    "target",
    [NOMINAL, real_object(offsets=0.1), synthetic.flat_board()],
    ids=["drawn", "real", "flat"],
)
def test_target_file_round_trip(tmp_path, target):
    path = tmp_path / "target.refined.yaml"
    path.write_text(target.text(), encoding="utf-8")
    again = Target.load(path)
    for one, other in zip(target.boards, again.boards, strict=True):
        column, row = np.meshgrid(np.arange(one.columns), np.arange(one.rows))
        np.testing.assert_allclose(
            other.world_points(column, row), one.world_points(column, row), rtol=1e-12, atol=1e-9
        )
        assert (one.shape is None) == (other.shape is None)
    assert again.text() == Target.load(path).text()


def test_other_kinds_of_boards_round_trip(tmp_path):
    text = """
units: mm
boards:
  - {name: c, type: charuco, corners: [5, 4], square: 20, marker: 15, dictionary: DICT_5X5_250,
     first_marker: 3, first_square: light, origin: [0, 0, 0], x_axis: [1, 0, 0],
     y_axis: [0, 1, 0], bend: [0.5, -0.25], offsets: [[1, 2, 0.1, 0.2, -0.3]]}
  - {name: a, type: aprilgrid, tags: [3, 2], tag: 30, spacing: 0.3, family: tag36h11,
     first_marker: 20, origin: [300, 0, 0], x_axis: [0, 1, 0], y_axis: [0, 0, 1], twist: 0.5}
  - {name: p, type: points, points: [[0, 0, 9], [1, 0, 9], [0, 5, 9]], offsets: [[2, 0, 1, 2, 3]]}
"""
    path = tmp_path / "target.yaml"
    path.write_text(text)
    target = Target.load(path)
    np.testing.assert_allclose(target.boards[2].world_points(2, 0), [1, 7, 12])
    charuco = target.boards[0]
    np.testing.assert_allclose(
        charuco.world_points(1, 2) - replace(charuco, shape=None).world_points(1, 2),
        [0.1, 0.2, -0.3 + 0.5 * 0.25 - 0.25 * (1 / 9)],
    )
    again = tmp_path / "again.yaml"
    again.write_text(target.text())
    assert Target.load(again).text() == again.read_text()


@pytest.mark.slow
def test_corners_off_their_places_are_found_where_shapes_gain_nothing() -> None:
    """A sheet that is flat and true in its outlines, printed or cut a little unevenly."""
    nominal = Target(units="mm", boards=(synthetic.checkerboard("board", 9, 6, 30.0),))
    offsets = np.random.default_rng(2).normal(0, 0.3, (6, 9, 3)) * [1, 1, 0.5]
    shape = BoardShape(bend=np.zeros(2), twist=0.0, stretch=np.zeros(2), offsets=offsets)
    real = nominal.with_boards({0: replace(nominal.boards[0], shape=shape)})
    errors = CornerErrors(noise=0.1, shared=0, spread=0)
    corners, _ = simulated_corners(synthetic_lens("equisolid"), real, 12, seed=2, errors=errors)
    fit = calibrate(corners.with_target(nominal), target=nominal)
    found = fit.fit.held_out_by_level
    assert found["shape"] > 0.99 * found["off"]
    assert fit.refined == "points"
    assert found["points"] < 0.3 * found["off"]
    # A file like any other: corners fit the target that was made of them.
    assert fit.target is not None
    again = calibrate(corners.with_target(fit.target), target=fit.target, refine_target="off")
    assert not again.unfit
    assert again.errors.rms_px < 1.2 * fit.errors.rms_px
