from dataclasses import replace

import cv2
import numpy as np
import pytest

from cubicfish.scene.faces import board_face
from cubicfish.target.boards.markers import Markers
from cubicfish.target.boards.types import AprilGrid, Charuco


def charuco(columns=5, rows=4, *, first="dark", dictionary="DICT_5X5_250", marker=0.75, start=0):
    """A board of unit squares."""
    light = (columns + 1) * (rows + 1) // 2
    if first == "light" and (columns + 1) * (rows + 1) % 2:
        light += 1
    return Charuco(
        name="wall",
        columns=columns,
        rows=rows,
        square=1.0,
        origin=np.zeros(3),
        x_axis=np.array([1.0, 0, 0]),
        y_axis=np.array([0, 1.0, 0]),
        first_square=first,
        markers=Markers(dictionary=dictionary, side=marker, first=start, count=light),
    )


def aprilgrid(tags=(3, 2), *, spacing=0.25, start=0, family="DICT_APRILTAG_36h11"):
    """A grid of unit tags."""
    return AprilGrid(
        name="grid",
        columns=2 * tags[0],
        rows=2 * tags[1],
        square=1.0,
        origin=np.zeros(3),
        x_axis=np.array([1.0, 0, 0]),
        y_axis=np.array([0, 1.0, 0]),
        markers=Markers(dictionary=family, side=1.0, first=start, count=tags[0] * tags[1]),
        spacing=spacing,
    )


def picture(board, pixels_per_unit, margin=0.0):
    """The face as an image, one sample in the middle of each pixel."""
    one = board_face(board, margin=margin)
    x, y = (
        lower + (np.arange(round((upper - lower) * pixels_per_unit)) + 0.5) / pixels_per_unit
        for lower, upper in zip(one.lower, one.upper, strict=True)
    )
    plane = np.stack(np.meshgrid(x, y), axis=-1)
    return np.where(one.is_dark(plane), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("columns", "rows"), [(5, 4), (4, 4), (4, 5), (2, 7)])
def test_a_charuco_face_is_what_opencv_draws(columns, rows):
    board = charuco(columns, rows, start=3)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    ids = np.arange(3, 3 + board.markers.count)
    peer = cv2.aruco.CharucoBoard((columns + 1, rows + 1), 1.0, 0.75, dictionary, ids)
    drawn = peer.generateImage(((columns + 1) * 56, (rows + 1) * 56), marginSize=0)
    ours = picture(board, 56)
    # Squares of 56 pixels have margins and modules of whole pixels.
    np.testing.assert_array_equal(ours, drawn)


def test_a_light_first_square_carries_the_first_marker():
    even = charuco(4, 3, first="light")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    peer = cv2.aruco.CharucoBoard((5, 4), 1.0, 0.75, dictionary)
    peer.setLegacyPattern(True)
    drawn = peer.generateImage((5 * 56, 4 * 56), marginSize=0)
    np.testing.assert_array_equal(picture(even, 56), drawn)


def test_the_margin_is_white_paper():
    for board, inner in ((charuco(), (6, 5)), (aprilgrid(), (4, 2.75))):
        image = picture(board, 40, margin=0.5)
        assert image.shape == (round((inner[1] + 1) * 40), round((inner[0] + 1) * 40))
        image[20:-20, 20:-20] = 255
        assert (image == 255).all()


def modules(image, corner, side=40):
    """The ten by ten modules of a tag of 40 pixels whose top left pixel is ``corner``."""
    x, y = corner
    return image[y : y + side, x : x + side][2::4, 2::4] == 0


def test_kalibrs_tags_are_upright_framed_and_numbered_from_the_bottom_left():
    image = picture(aprilgrid(), 40)
    # Tag36h11 number 0 as AprilTag publishes it: rows from the top, a one is white.
    code = np.array([int(bit) for bit in f"{0xD5D628584:036b}"]).reshape(6, 6) == 0
    first = modules(image, (10, 10 + 50))
    np.testing.assert_array_equal(first[2:8, 2:8], code)
    frame = np.ones((10, 10), bool)
    frame[2:8, 2:8] = False
    assert first[frame].all()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    order = []
    for y in (60, 10):
        for x in (10, 60, 110):
            bits = (~modules(image, (x, y))[2:8, 2:8]).astype(np.uint8)
            found, number, turn = dictionary.identify(bits, 0.0)
            assert (found, turn) == (True, 2)
            order.append(number)
    assert order == [0, 1, 2, 3, 4, 5]


def test_small_squares_make_tag_corners_x_corners():
    board = aprilgrid(spacing=0.3)
    row, column = np.indices((board.rows, board.columns))
    corner = board.plane_points(column, row).reshape(-1, 1, 2)
    around = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.04
    dark = board_face(board, margin=0.2).is_dark(corner + around)
    # The tag lies down-right of corners with even column and row.
    even = ((row + column) % 2 == 0).ravel()
    np.testing.assert_array_equal(dark[:, [0, 2]], np.repeat(even[:, None], 2, axis=1))
    np.testing.assert_array_equal(dark[:, [1, 3]], np.repeat(~even[:, None], 2, axis=1))
    # Gaps between tags are white, also where nothing is drawn beside the outer tags.
    assert not board_face(board, margin=0.2).is_dark(np.array([[1.15, 0.5], [0.5, -0.15]])).any()


def test_other_families_and_first_ids():
    board = replace(aprilgrid(start=7, family="DICT_APRILTAG_16h5"))
    image = picture(board, 40)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_16h5)
    bits = image[60:100, 10:50][2::5, 2::5][2:6, 2:6] > 0
    assert dictionary.identify(bits.astype(np.uint8), 0.0) == (True, 7, 2)
