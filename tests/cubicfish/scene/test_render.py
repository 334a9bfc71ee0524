from dataclasses import replace

import cv2
import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from looking import look_at
from synthetic import (
    as_type,
    checkerboard,
    corner_of_three,
    flat_board,
    lens_of_size,
    plain_background,
    poses_around,
)

from cubicfish import Target, TargetError
from cubicfish.scene import photos as rendering
from cubicfish.scene.photos import render
from cubicfish.scene.truth import (
    camera_points,
    project_corners,
    rotation_matrix,
)

LENS = lens_of_size(0.5)
SIZE = LENS.image_size
CLEAN = {"supersample": 2, "noise": 0, "blur": 0, "vignetting": 0, "background": plain_background}


def one_board(**changes):
    return Target(units="mm", boards=(replace(flat_board().boards[0], **changes),))


def in_front(distance=200.0):
    """A camera before the flat board's middle, upright: x is right and y is down on both."""
    return np.zeros(3), np.array([-150.0, -105.0, distance])


def at(photo, pixel):
    x, y = np.rint(pixel).astype(int)
    return int(photo[y, x])


@pytest.mark.slow
def test_edges_are_where_the_lens_projects_the_corners():
    target, pose = corner_of_three(), poses_around(corner_of_three(), 1, seed=3)[0]
    photo = render(target, LENS.unproject, pose, SIZE, **CLEAN | {"blur": 0.7, "supersample": 4})
    seen = project_corners(target, LENS, pose, SIZE)
    true = seen.pixel[seen.visible]
    start = true.astype(np.float32)[:, None]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    found = cv2.cornerSubPix(photo, start.copy(), (3, 3), (-1, -1), stop)[:, 0]
    error = found - true
    assert len(true) > 100
    # A half-pixel slip anywhere would show as a mean of 0.25 to 0.5 px.
    assert np.abs(error.mean(axis=0)).max() < 0.02
    assert np.median(np.hypot(*error.T)) < 0.05


@pytest.mark.parametrize("first", ["dark", "light"])
def test_first_square_is_up_left_of_the_first_corner(first):
    target = one_board(first_square=first)
    photo = render(target, LENS.unproject, in_front(), SIZE, **CLEAN)
    centres = np.array([[-15.0, -15, 0], [15, -15, 0], [15, 15, 0]])
    up_left, up, down_right = (
        at(photo, pixel) for pixel in LENS.project(camera_points(in_front(), centres))
    )
    dark, light = (up_left, up) if first == "dark" else (up, up_left)
    assert dark < 40 < 100 < light
    assert abs(down_right - up_left) <= 1
    # White paper around the print, then the background.
    margin, beyond = LENS.project(camera_points(in_front(), [[15, -34, 0], [15, -50, 0]]))
    assert at(photo, margin) == light
    assert dark < at(photo, beyond) < light


def test_outside_the_field_it_is_black():
    photo = render(one_board(), LENS.unproject, in_front(), SIZE, **CLEAN)
    assert photo.shape == SIZE[::-1]
    assert photo.dtype == np.uint8
    assert photo[:20, :20].max() < 10


def test_a_board_from_behind_is_plain_and_its_corners_are_not_visible():
    pose = look_at([100, 105, 200], [100, 105, 0], up=[0, 1, 0])
    photo = render(one_board(), LENS.unproject, pose, SIZE, **CLEAN)
    board = project_corners(one_board(), LENS, pose, SIZE)
    inside = photo[tuple(np.rint(board.pixel[:, ::-1]).astype(int).T)]
    assert np.ptp(inside) == 0
    assert not board.visible.any()
    assert project_corners(one_board(), LENS, in_front(), SIZE).visible.all()


def two_boards():
    """A small board in front of a part of the large one, both facing the camera."""
    small = checkerboard("small", 3, 3, 10.0, (100, 60, -80))
    return Target(units="mm", boards=(flat_board().boards[0], small))


@pytest.mark.slow
def test_the_nearer_board_hides_the_farther():
    seen = project_corners(two_boards(), LENS, in_front(), SIZE)
    photo = render(two_boards(), LENS.unproject, in_front(), SIZE, **CLEAN)
    alone = render(one_board(), LENS.unproject, in_front(), SIZE, **CLEAN)
    hidden = (seen.board == 0) & ~seen.visible
    assert seen.visible[seen.board == 1].all()
    assert 2 <= hidden.sum() <= 20
    # Around a visible corner the photo is as if the small board were not there ...
    x, y = np.rint(seen.pixel[(seen.board == 0) & seen.visible]).astype(int).T
    np.testing.assert_array_equal(photo[y, x], alone[y, x])
    # ... and in the small board's middle it is not.
    middle = LENS.project(camera_points(in_front(), [105, 65, -80]))
    assert at(photo, middle) != at(alone, middle)
    # The order of the boards does not matter.
    swapped = Target(units="mm", boards=two_boards().boards[::-1])
    np.testing.assert_array_equal(photo, render(swapped, LENS.unproject, in_front(), SIZE, **CLEAN))


def test_what_is_behind_the_camera_is_not_seen():
    pose = look_at([150, 105, -200], [150, 105, -400], up=[0, 1, 0])
    photo = render(one_board(), LENS.unproject, pose, SIZE, **CLEAN)
    middle = photo[SIZE[1] // 2 - 50 : SIZE[1] // 2 + 50, SIZE[0] // 2 - 50 : SIZE[0] // 2 + 50]
    assert np.ptp(middle) == 0
    assert not project_corners(one_board(), LENS, pose, SIZE).visible.any()


def test_a_corner_cut_by_the_picture_or_the_field_is_not_visible():
    near = look_at([150, 50, -60], [150, 250, -30], up=[0, 0, -1], roll=0.1)
    seen = project_corners(one_board(), LENS, near, SIZE)
    strict = project_corners(one_board(), LENS, near, SIZE, neighbourhood=1.0)
    limit = np.array(SIZE) - 0.5
    inside = ((seen.pixel > -0.5) & (seen.pixel < limit)).all(axis=1)
    assert seen.visible.any()
    assert (inside & ~seen.visible).any()
    assert not (seen.visible & ~inside).any()
    assert not (strict.visible & ~seen.visible).any()
    # A sensor so small that the board sticks out on all four sides.
    small, size = replace(LENS, cx=59.5, cy=49.5), (120, 100)
    seen = project_corners(one_board(), small, in_front(), size)
    inside = ((seen.pixel > -0.5) & (seen.pixel < np.array(size) - 0.5)).all(axis=1)
    assert not (seen.visible & ~inside).any()
    for side in (seen.column == 0, seen.column == 10, seen.row == 0, seen.row == 7):
        assert not seen.visible[side].any()
    assert seen.visible.sum() >= 9
    narrow = replace(LENS, max_angle_deg=60.0)
    cut = project_corners(one_board(), narrow, near, SIZE)
    assert np.isnan(cut.pixel).any()
    assert not cut.visible[np.isnan(cut.pixel).any(axis=1)].any()


@pytest.mark.slow
def test_the_same_arguments_give_the_same_photo():
    def take(**changes):
        options = {"supersample": 2, "seed": 5} | changes
        return render(corner_of_three(), LENS.unproject, pose, SIZE, **options)

    pose = poses_around(corner_of_three(), 1)[0]
    np.testing.assert_array_equal(take(), take())
    difference = take(noise=3.0).astype(float) - take(noise=0)
    inside = take(noise=0) > 30
    assert abs(difference[inside].std() - 3.0) < 0.1
    assert not np.array_equal(take(), take(seed=6))


@pytest.mark.slow
def test_blocks_of_rows_leave_no_seam(monkeypatch):
    def take():
        return render(one_board(), LENS.unproject, in_front(), SIZE, supersample=2)

    whole = take()
    monkeypatch.setattr(rendering, "_RAYS_PER_BLOCK", 7_000)
    np.testing.assert_array_equal(take(), whole)


def test_vignetting_darkens_the_rim_only():
    flat = one_board()
    lens = AsymmetricLens(image_size=SIZE, fx=120, fy=120, cx=239.5, cy=179.5, max_angle_deg=95)
    options = CLEAN | {"supersample": 1}
    plain = render(flat, lens.unproject, in_front(-9), SIZE, **options)
    dark = render(flat, lens.unproject, in_front(-9), SIZE, **options | {"vignetting": 0.5})
    assert plain[180, 240] == dark[180, 240]
    ninety = round(239.5 + 120 * np.pi / 2)
    assert (dark[180, ninety] - 6.0) / (plain[180, ninety] - 6.0) == pytest.approx(0.5, abs=0.03)


def test_a_board_without_a_face_is_refused_by_name():
    points = as_type(flat_board().boards[0], "points", points=np.eye(3))
    with pytest.raises(TargetError, match=r"'board'.*points board cannot be drawn"):
        render(Target(units="mm", boards=(points,)), LENS.unproject, in_front(), SIZE)


def test_look_at_puts_the_aim_on_the_axis_and_up_is_up():
    eye, aim = np.array([3.0, 4.0, 5.0]), np.array([1.0, -2.0, 0.5])
    pose = look_at(eye, aim)
    np.testing.assert_allclose(camera_points(pose, eye), 0, atol=1e-12)
    np.testing.assert_allclose(
        camera_points(pose, aim), [0, 0, np.linalg.norm(aim - eye)], atol=1e-12
    )
    assert np.linalg.det(rotation_matrix(pose[0])) == pytest.approx(1)
    above = camera_points(pose, aim + np.array([0, 0, 1]))
    assert above[1] < 0
    assert above[0] == pytest.approx(0, abs=1e-12)
    # Rolled clockwise by a quarter turn, up in the world is to the left in the picture.
    rolled = camera_points(look_at(eye, aim, roll=np.pi / 2), aim + np.array([0, 0, 1]))
    assert rolled[0] < 0
    assert rolled[1] == pytest.approx(0, abs=1e-12)
