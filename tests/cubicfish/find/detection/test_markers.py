from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from looking import look_at
from synthetic import plain_background

from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.find.detection.markers import find_marked_corners
from cubicfish.find.detection.markers_detect import Sight, families
from cubicfish.find.detection.markers_lattice import BoardLattice
from cubicfish.find.detection.markers_read import read_grid
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.find.identification.quick_detect import quick_detect
from cubicfish.observe.photo_detection import detect_in_photo as search
from cubicfish.photos.photos import Photo
from cubicfish.scene.photos import render
from cubicfish.scene.truth import camera_points, project_corners
from cubicfish.target.boards.markers import Markers
from cubicfish.target.boards.types import BOARD_TYPES
from cubicfish.target.target import Target

SIZE = (520, 520)
LENS = AsymmetricLens(
    image_size=SIZE,
    fx=152.0,
    fy=152.3,
    cx=262.1,
    cy=257.4,
    k=(-0.021, -0.0042, 0.0011, -0.00012),
    p=(0.00045, -0.0006),
    max_angle_deg=97.0,
)
AXES = {
    "front": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "left": ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "right": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "top": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
}
HALF = 100.0  # of the box around the camera


def wall(
    place, kind, counts, side, *, dictionary="DICT_4X4_50", first=0, shift=(0, 0), marker=0.74
):
    """A board in the middle of a wall of the box; counts of corners, or of tags."""
    inward, x, y = (np.array(axis, float) for axis in AXES[place])
    columns, rows = counts
    markers, spacing = None, 0.0
    if kind == "charuco":
        count = (columns + 1) * (rows + 1) // 2
        markers = Markers(dictionary=dictionary, side=marker * side, first=first, count=count)
    if kind == "aprilgrid":
        markers = Markers(
            dictionary="DICT_APRILTAG_36h11", side=side, first=first, count=columns * rows
        )
        columns, rows, spacing = 2 * columns, 2 * rows, 0.3
    board = BOARD_TYPES[kind](
        name=f"{place}{first}",
        columns=columns,
        rows=rows,
        square=side,
        origin=np.zeros(3),
        x_axis=x,
        y_axis=y,
        markers=markers,
        spacing=spacing,
    )
    middle = board.world_points(columns - 1, rows - 1) / 2
    origin = inward * HALF - middle + shift[0] * x + shift[1] * y
    return replace(board, origin=origin)


MIXED = Target(
    units="mm",
    boards=(
        wall("front", "charuco", (6, 5), 24.0),
        wall("left", "charuco", (5, 5), 26.0, dictionary="DICT_5X5_50"),
        wall("right", "aprilgrid", (4, 3), 34.0),
        wall("top", "checkerboard", (6, 5), 22.0),
    ),
)
POSE = look_at([5, 10, -40], [30, -15, 100], up=[0.05, -1, 0.1], roll=0.3)


def photo_of(target, pose=POSE, **options):
    options = {"supersample": 2, "noise": 1.5, "background": plain_background} | options
    return render(target, LENS.unproject, pose, SIZE, **options)


@cache
def mixed_photo():
    return photo_of(MIXED, supersample=3)


def find(photo, target):
    return find_marked_corners(photo, target, find_grids(photo))


def errors(found, target, pose=POSE):
    """Distances (N,) of found corners from the truth, and the share of visible ones found."""
    seen = project_corners(target, LENS, pose, SIZE)
    index = {
        key: i
        for i, key in enumerate(
            zip(seen.board.tolist(), seen.column.tolist(), seen.row.tolist(), strict=True)
        )
    }
    named = [
        index[key]
        for key in zip(found.board.tolist(), found.column.tolist(), found.row.tolist(), strict=True)
    ]
    assert len(set(named)) == len(named)
    error = np.hypot(*(found.pixel - seen.pixel[named]).T)
    marked = np.array([board.markers is not None for board in target.boards])
    wanted = seen.visible & marked[seen.board]
    hit = np.zeros(len(wanted), bool)
    hit[named] = error < 0.5
    return error, (hit & wanted).sum() / wanted.sum()


@pytest.mark.slow
def test_boards_of_all_kinds_are_named_to_the_rim():
    found = find(mixed_photo(), MIXED)
    error, recall = errors(found, MIXED)
    assert error.max() < 0.5
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert recall > 0.97
    assert set(found.board.tolist()) == {0, 1, 2}
    assert found.contradictory == ()


@pytest.mark.slow
@pytest.mark.parametrize("turns", [1, 2])
def test_a_turned_camera_gives_the_same_names(turns):
    def by_name(found):
        keys = zip(found.board.tolist(), found.column.tolist(), found.row.tolist(), strict=True)
        return dict(zip(keys, found.pixel, strict=True))

    upright = by_name(find(mixed_photo(), MIXED))
    turned = by_name(find(np.rot90(mixed_photo(), turns).copy(), MIXED))
    back = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), turns)
    apart = [
        np.hypot(*((turned[key] - 259.5) @ back + 259.5 - upright[key]))
        for key in turned.keys() & upright.keys()
    ]
    assert len(apart) > 0.95 * len(upright)
    assert max(apart) < 0.1


@pytest.mark.slow
def test_deep_photos_and_dim_ones():
    bright = find(mixed_photo(), MIXED)
    deep = find(mixed_photo().astype(np.uint16) * 200, MIXED)
    assert len(deep) > 0.97 * len(bright)
    assert errors(deep, MIXED)[0].max() < 0.5
    dim = find((mixed_photo() * 0.25).astype(np.uint8), MIXED)
    assert errors(dim, MIXED)[0].max() < 0.7
    assert errors(dim, MIXED)[1] > 0.8


@pytest.mark.slow
def test_a_mirrored_photo_has_no_names():
    for axis in (0, 1):
        found = find(np.flip(mixed_photo(), axis).copy(), MIXED)
        assert len(found) == 0
        assert (found.grid_board == -1).all()


def test_nothing_comes_of_nothing():
    noise = np.random.default_rng(0).normal(128, 50, (300, 400)).clip(0, 255).astype(np.uint8)
    for photo in (
        np.zeros((200, 300), np.uint8),
        np.full((200, 300), 255, np.uint8),
        noise,
        np.zeros((4, 4), np.uint8),
        np.full((50, 60), np.nan),
    ):
        found = find(photo, MIXED)
        assert len(found) == 0
        assert found.pixel.shape == (0, 2)
        assert found.contradictory == ()


@pytest.mark.slow
def test_a_target_without_markers_names_nothing():
    plain = Target(units="mm", boards=MIXED.boards[3:])
    found = find(mixed_photo(), plain)
    assert len(found) == 0
    assert len(found.grid_board) == len(find_grids(mixed_photo()).grids)


@pytest.mark.slow
def test_foreign_markers_give_no_names():
    foreign = Target(
        units="mm",
        boards=(
            wall("front", "charuco", (6, 5), 24.0, first=21),
            wall("left", "charuco", (5, 5), 26.0, dictionary="DICT_5X5_50", first=30),
            wall("right", "aprilgrid", (4, 3), 34.0, first=100),
        ),
    )
    assert len(find(mixed_photo(), foreign)) == 0


@pytest.mark.slow
def test_a_board_of_another_layout_with_the_same_ids_is_left_out():
    # The photo's board has one column more: ids run on differently in every row but the first.
    narrow = Target(units="mm", boards=(wall("front", "charuco", (5, 5), 24.0),))
    found = find(photo_of(Target(units="mm", boards=MIXED.boards[:1])), narrow)
    assert len(found) == 0
    assert found.contradictory == (0,)
    tags = Target(units="mm", boards=(wall("right", "aprilgrid", (3, 4), 34.0),))
    found = find(photo_of(Target(units="mm", boards=MIXED.boards[2:3])), tags)
    assert len(found) == 0
    assert found.contradictory == (0,)


@pytest.mark.slow
def test_one_of_its_markers_inside_a_foreign_board_names_nothing():
    foreign = Target(units="mm", boards=(wall("front", "charuco", (6, 5), 24.0, first=21),))
    photo = photo_of(foreign)
    # Marker 11 of the target, seen in the square with the corners (2, 1) to (3, 2).
    board = MIXED.boards[0]
    corner = board.world_points([2, 3, 3, 2], [1, 1, 2, 2])
    middle = corner.mean(axis=0)
    seen = LENS.project(camera_points(POSE, middle + 0.74 * (corner - middle)))
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker = cv2.aruco.generateImageMarker(dictionary, 11, 60)
    place = cv2.getPerspectiveTransform(
        np.array([(0, 0), (59, 0), (59, 59), (0, 59)], np.float32), seen.astype(np.float32)
    )
    pasted = cv2.warpPerspective(marker, place, SIZE, flags=cv2.INTER_AREA)
    there = cv2.warpPerspective(np.full_like(marker, 255), place, SIZE) > 128
    photo[there] = 20 + 0.5 * pasted[there]
    target = Target(units="mm", boards=(board,))
    assert len(find(photo_of(target), target)) == 30
    assert len(find(photo, target)) == 0


def true_grid(board, turn=0):
    """A target of one board of the mixed photo, and the grid that a finder would give of it."""
    target = Target(units="mm", boards=(board,))
    seen = project_corners(target, LENS, POSE, SIZE)
    cells = np.stack([seen.column, seen.row], axis=-1)
    turned = cells @ np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), turn)
    turned -= turned.min(axis=0)
    grid = Grid(
        cells=turned,
        pixel=seen.pixel,
        # The square right and below of the board's first corner is dark.
        parity=-1 if (turned[0].sum() + turn) % 2 == 0 else 1,
        step=20.0,
        contrast=np.full(len(cells), 100.0),
    )
    return target, grid


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(4))
def test_markers_are_read_through_a_grid(turn):
    board = MIXED.boards[0]
    target, grid = true_grid(board, turn)
    pyramid = build_pyramid(mixed_photo())
    seen = read_grid(Sight(pyramid=pyramid, target=target, families=families(target)), grid)
    inner = (board.marker_cells()[:, 1:] > 0) & (board.marker_cells()[:, 1:] < (6, 5))
    wanted = board.marker_cells()[inner.all(axis=1), 1:]
    np.testing.assert_array_equal(np.unique(seen.cell, axis=0), np.unique(wanted, axis=0))
    # Outlines start at the top left of the upright board.
    first = (seen.cell - 1) * 24.0 + 24.0 * 0.13
    corner = board.origin + first[:, :1] * board.x_axis + first[:, 1:] * board.y_axis
    expected = LENS.project(camera_points(POSE, corner))
    assert np.hypot(*(seen.pixel[:, 0] - expected).T).max() < 1.0


@pytest.mark.slow
def test_corners_that_the_rim_cuts_are_refused():
    board = MIXED.boards[0]
    _, grid = true_grid(board)
    lattice = BoardLattice(board=board)
    lattice.put(grid.cells, grid.pixel)
    fit = lattice.fit(grid.cells)
    y, x = np.indices(SIZE[::-1])
    whole = build_pyramid(mixed_photo())
    assert lattice.refined(whole, grid.cells, grid.pixel, fit)[1].all()
    for direction in np.radians(np.arange(0, 360, 30)):
        photo = mixed_photo().copy()
        # Beyond 1.5 px from each corner in this direction all is as dark as outside the circle.
        for px, py in grid.pixel:
            near = np.hypot(x - px, y - py) < 9
            cut = (x - px) * np.cos(direction) + (y - py) * np.sin(direction) > 1.5
            photo[near & cut] = 6
        assert not lattice.refined(build_pyramid(photo), grid.cells, grid.pixel, fit)[1].any()


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(4))
def test_a_grid_takes_its_names_from_the_markers(turn):
    target, whole = true_grid(MIXED.boards[0], turn)

    def named(**changes):
        grid = replace(whole, **changes)
        grids = FoundGrids(grids=(grid,), refused=np.zeros((0, 2)), image_size=SIZE)
        return find_marked_corners(mixed_photo(), target, grids)

    found = named()
    assert found.grid_board.tolist() == [0]
    assert errors(found, target)[0].max() < 0.5
    assert named(parity=-whole.parity).grid_board.tolist() == [-1]
    # Two corners are too few to vote, and a grid that does not fit the board is not its.
    few = named(cells=whole.cells[:2], pixel=whole.pixel[:2], contrast=whole.contrast[:2])
    assert few.grid_board.tolist() == [-1]
    assert named(cells=whole.cells * (1, 2)).grid_board.tolist() == [-1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "counts", "side"), [("charuco", (5, 4), 22.0), ("aprilgrid", (3, 3), 30.0)]
)
def test_two_copies_of_a_board_are_reported_and_left_out(kind, counts, side):
    one = wall("front", kind, counts, side)
    copies = Target(units="mm", boards=(one, wall("left", kind, counts, side)))
    other = wall("right", "charuco", (5, 5), 26.0, dictionary="DICT_5X5_50")
    photo = photo_of(Target(units="mm", boards=(*copies.boards, other)))
    found = find(photo, Target(units="mm", boards=(one, other)))
    assert found.contradictory == (0,)
    assert set(found.board.tolist()) == {1}


@pytest.mark.slow
def test_a_stray_marker_does_not_harm_the_board():
    photo = mixed_photo().copy()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    stray = cv2.aruco.generateImageMarker(dictionary, 3, 48)
    photo[10:74, 10:74] = 230
    photo[18:66, 18:66] = stray
    found = find(photo, MIXED)
    error, recall = errors(found, MIXED)
    assert found.contradictory == ()
    assert error.max() < 0.5
    assert recall > 0.97


@pytest.mark.slow
def test_a_board_behind_a_bar_is_still_one_board():
    photo = mixed_photo().copy()
    middle = project_corners(MIXED, LENS, POSE, SIZE)
    own = (middle.board == 0) & (middle.column == 3)
    x = int(middle.pixel[own, 0].mean())
    photo[:, x - 14 : x + 14] = 90
    found = find(photo, MIXED)
    error, _ = errors(found, MIXED)
    assert found.contradictory == ()
    assert error.max() < 0.5
    columns = found.column[found.board == 0]
    assert columns.min() == 0
    assert columns.max() == 5


@pytest.mark.slow
def test_quick_detection_of_markers_names_most_corners_where_they_are():
    found = quick_detect(mixed_photo(), MIXED)
    error, recall = errors(found, MIXED)
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 1
    assert recall > 0.6
    assert set(found.board.tolist()) == {0, 1, 2}


def test_quick_detection_of_markers_is_empty_where_none_agree():
    rng = np.random.default_rng(4)
    for photo in (np.full((200, 300), 99, np.uint8), rng.integers(0, 255, (200, 300), np.uint8)):
        assert len(quick_detect(photo, MIXED)) == 0
    board = Target(units="mm", boards=(wall("front", "charuco", (4, 4), 40.0),))
    photo = photo_of(board)
    found = quick_detect(photo, board)
    assert len(found) == 16
    # Of one marker all four corners are left, and nothing else.
    own = found.pixel[(found.column < 2) & (found.row > 0) & (found.row < 3)]
    assert [1, 2] in board.boards[0].marker_cells()[:, 1:].tolist()
    (left, top), (right, bottom) = own.min(axis=0).astype(int) - 8, own.max(axis=0).astype(int) + 8
    hidden = np.full_like(photo, 128)
    hidden[top:bottom, left:right] = photo[top:bottom, left:right]
    assert len(quick_detect(hidden, board)) == 0


def searched(photo, target):
    """What is found of a picture in memory, where need be at twice its size."""
    return search(Photo(name="p", path=Path("p"), picture=photo), target=target, cache=None)


# Markers of 7 px, whose modules have 1.2 px, and tags of 14 px, whose modules have 1.4 px: these so
# blurred that hardly one is read well, and all together are.
SMALL = {
    "charuco": (wall("front", "charuco", (6, 4), 9.0), 0.5),
    "aprilgrid": (wall("front", "aprilgrid", (5, 4), 13.0), 0.4),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SMALL)
def test_small_markers_are_read_at_twice_the_size(kind):
    board, blur = SMALL[kind]
    target = Target(units="mm", boards=(board,))
    photo = photo_of(target, supersample=3, blur=blur)
    error, recall = errors(searched(photo, target).marked, target)
    assert recall > 0.95
    assert np.sqrt(np.mean(error**2)) < 0.08


@pytest.mark.slow
def test_small_squares_are_found_at_twice_the_size():
    target = Target(units="mm", boards=(wall("front", "checkerboard", (8, 6), 3.2),))
    photo = photo_of(target, supersample=3, blur=0.3)
    (grid,) = searched(photo, target).grids.grids
    truth = project_corners(target, LENS, POSE, SIZE).pixel
    away = np.linalg.norm(grid.pixel[:, None] - truth, axis=2).min(axis=1)
    assert len(grid) == 48
    assert np.sqrt(np.mean(away**2)) < 0.08


@pytest.mark.slow
def test_the_photo_says_where_corners_are_at_whatever_size_they_were_found():
    target = Target(units="mm", boards=(wall("front", "charuco", (5, 4), 24.0),))
    photo = photo_of(target)
    plain, close = (
        find_marked_corners(photo, target, find_grids(photo), closely=closely).pixel
        for closely in (False, True)
    )
    assert len(plain) == len(close) == 20
    # Refined at twice the size they would be 0.05 px elsewhere.
    assert np.linalg.norm(plain[:, None] - close, axis=2).min(axis=1).max() < 0.025
