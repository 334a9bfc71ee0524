"""Sampled poses: what they show, that they fill the field, and that a seed gives them again."""

from dataclasses import replace

import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from synthetic import (
    IMAGE_SIZE,
    TRUE_LENS,
    as_type,
    box_of_four,
    checkerboard,
    corner_of_three,
    flat_board,
)

from cubicfish import Target, TargetError
from cubicfish.scene.photos import chosen_poses
from cubicfish.scene.truth import camera_points, rotation_matrix
from cubicfish.scene.views import choose_views, sample_views, view_from
from cubicfish.target.boards.shape import BoardShape


def eye_of(view):
    return -rotation_matrix(view.pose[0]).T @ view.pose[1]


@pytest.mark.slow
@pytest.mark.parametrize("target", [corner_of_three(), box_of_four(), flat_board()])
def test_every_view_shows_whole_boards_from_their_printed_side(target):
    views = sample_views(target, TRUE_LENS, IMAGE_SIZE, 40)
    assert len(views) == 40
    for view in views:
        counts = np.bincount(view.seen.board[view.seen.visible], minlength=len(target.boards))
        whole = [counts[i] == b.columns * b.rows for i, b in enumerate(target.boards)]
        assert sum(whole) >= view.whole >= 1
        # These objects are hollow: a camera behind one of their boards is in a wall.
        assert all((eye_of(view) - b.origin) @ b.axes[2] < 0 for b in target.boards)
    assert max(view.whole for view in views) >= min(3, len(target.boards))


def test_squares_are_never_too_small_to_be_found():
    small = replace(flat_board().boards[0], square=5.0)
    views = sample_views(Target(units="mm", boards=(small,)), TRUE_LENS, IMAGE_SIZE, 30)
    for view in views:
        grid = view.seen.pixel.reshape(small.rows, small.columns, 2)
        along = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
        assert np.percentile(along[np.isfinite(along)], 10) > 9


def test_the_outside_of_a_box_is_seen_from_any_side():
    front = checkerboard("front", 5, 4, 30, (-60, -45, -80))
    back = checkerboard("back", 5, 4, 30, (60, -45, 80), (-1, 0, 0))
    target = Target(units="mm", boards=(front, back))
    views = sample_views(target, TRUE_LENS, IMAGE_SIZE, 30)
    sides = {int(view.seen.board[view.seen.visible][0]) for view in views}
    assert sides == {0, 1}
    assert all(np.ptp(view.seen.board[view.seen.visible]) == 0 for view in views)


def test_chosen_views_fill_the_field_and_differ():
    target = flat_board()
    views = sample_views(target, TRUE_LENS, IMAGE_SIZE, 120)
    chosen = choose_views(views, TRUE_LENS, IMAGE_SIZE, 12)
    assert len({id(view) for view in chosen}) == 12
    cells = {tuple(cell) for view in chosen for cell in (view.pixel // 90).astype(int)}
    x, y = np.meshgrid(np.arange(45, 960, 90), np.arange(45, 720, 90))
    field = np.isfinite(TRUE_LENS.unproject(np.stack([x, y], axis=-1))[..., 0]).sum()
    assert len(cells) > 0.93 * field
    # The same number of views as they come fill less.
    first = {tuple(cell) for view in views[:12] for cell in (view.pixel // 90).astype(int)}
    assert len(cells) > len(first)
    distances = [np.linalg.norm(view.middle) for view in chosen]
    assert max(distances) > 1.8 * min(distances)
    slants = [
        np.degrees(np.arccos(-view.front @ view.middle / np.linalg.norm(view.middle)))
        for view in chosen
    ]
    assert min(slants) < 25 < 45 < max(slants)


@pytest.mark.slow
def test_a_seed_gives_the_same_poses_and_another_gives_others():
    first, again, other = (
        np.concatenate(chosen_poses(flat_board(), TRUE_LENS, IMAGE_SIZE, 3, seed=seed))
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


def test_a_narrow_lens_stands_far_enough_away():
    lens = AsymmetricLens(
        image_size=(640, 480), fx=900, fy=900, cx=319.5, cy=239.5, max_angle_deg=25
    )
    assert len(sample_views(flat_board(), lens, lens.image_size, 30)) == 30


def test_the_front_is_where_the_boards_look():
    pose = (np.zeros(3), np.array([-150.0, -105.0, 200.0]))
    view = view_from(flat_board(), TRUE_LENS, pose, IMAGE_SIZE)
    np.testing.assert_allclose(view.front, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(view.middle, [0, 0, 200], atol=1e-9)
    np.testing.assert_allclose(view.pixel, TRUE_LENS.project(camera_points(pose, view.seen.world)))
    behind = (np.zeros(3), np.array([-150.0, -105.0, -200.0]))
    assert view_from(flat_board(), TRUE_LENS, behind, IMAGE_SIZE) is None


def test_shapes_that_were_fitted_do_not_hide_corners():
    board = flat_board().boards[0]
    shape = BoardShape(
        bend=np.array([3.0, 0]), twist=0, stretch=np.zeros(2), offsets=np.zeros((8, 11, 3))
    )
    bent = Target(units="mm", boards=(replace(board, shape=shape),))
    views = sample_views(bent, TRUE_LENS, IMAGE_SIZE, 10)
    plain = sample_views(flat_board(), TRUE_LENS, IMAGE_SIZE, 10)
    for one, other in zip(views, plain, strict=True):
        np.testing.assert_array_equal(one.pixel, other.pixel)


def test_what_cannot_be_seen_is_said():
    tiny = Target(units="mm", boards=(replace(flat_board().boards[0], columns=200, rows=200),))
    with pytest.raises(TargetError, match=r"only 0 poses.*fewer and larger squares"):
        chosen_poses(tiny, TRUE_LENS, IMAGE_SIZE, 3)
    points = as_type(flat_board().boards[0], "points", points=np.eye(3))
    with pytest.raises(TargetError, match="'board' is a list of points"):
        chosen_poses(Target(units="mm", boards=(points,)), TRUE_LENS, IMAGE_SIZE, 3)
