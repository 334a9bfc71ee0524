"""What a caller's arrays must be, and the one line that says what is wrong with them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cubicfish.arrays import Refusal
from cubicfish.errors import CorrespondenceError, TargetError
from cubicfish.models.cubic import CubicCamera
from cubicfish.photos.photos import Photo
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target

WORLD = np.arange(12.0).reshape(4, 3)
PIXEL = np.arange(8.0).reshape(4, 2)
PLACES = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 0, 1]])
DATA: dict[str, Any] = {
    "units": "mm",
    "boards": [
        {
            "name": name,
            "type": "checkerboard",
            "corners": (4, 3),
            "square": np.float64(10),
            "origin": np.array([0, 0, depth]),
            "x_axis": [1, 0, 0],
            "y_axis": (0, 1, 0),
        }
        for name, depth in (("near", 0), ("far", 100))
    ],
}


def pairs(**changed: Any) -> Observations:
    given = {"world": [WORLD, WORLD[:2]], "pixel": [PIXEL, PIXEL[:2]], "image_size": (20, 10)}
    return Observations.from_points(**(given | changed))


def corners(**changed: Any) -> Observations:
    given: dict[str, Any] = {"places": [PLACES, PLACES[:2]], "pixel": [PIXEL, PIXEL[:2]]}
    given |= {"image_size": (20, 10), "boards": ["near", "far"]}
    return Observations.from_corners(**(given | changed))


def test_pairs_are_the_rows_of_all_photos() -> None:
    made = pairs(weight=[np.full(4, 2), [1, 3]], image_size=np.array([20, 10]))
    assert (made.image_size, made.images, made.boards) == ((20, 10), ("photo_0", "photo_1"), ())
    assert made.image.tolist() == [0, 0, 0, 0, 1, 1]
    assert made.column.tolist() == [0, 1, 2, 3, 0, 1]
    assert made.board.tolist() == [-1] * 6
    assert made.weight.tolist() == [2, 2, 2, 2, 1, 3]
    np.testing.assert_array_equal(made.world, np.vstack([WORLD, WORLD[:2]]))
    np.testing.assert_array_equal(made.pixel, np.vstack([PIXEL, PIXEL[:2]]))


def test_pairs_are_copies_and_may_come_as_lists_or_smaller_numbers() -> None:
    own = WORLD.copy()
    made = pairs(world=[own, own[:2]])
    own[:] = 7
    np.testing.assert_array_equal(made.world[:4], WORLD)
    other = pairs(world=iter([WORLD.astype(np.float32), WORLD[:2].tolist()]))
    np.testing.assert_array_equal(made.world, other.world)
    assert other.world.dtype == np.float64


def test_what_is_checked_is_a_copy() -> None:
    checked = Refusal(error=CorrespondenceError).numbers(WORLD, "world", 3)
    assert not np.shares_memory(checked, WORLD)
    np.testing.assert_array_equal(checked, WORLD)


def test_corners_are_named_and_find_their_world_points() -> None:
    target = Target.from_data(DATA)
    made = corners(images=["a.png", "b.png"])
    assert made.images == ("a.png", "b.png")
    assert made.board.tolist() == [0, 0, 1, 1, 0, 0]
    world = made.with_target(target).world
    np.testing.assert_array_equal(world[2:4], [[0, 0, 100], [0, 10, 100]])


@pytest.mark.parametrize("make", [pairs, corners])
def test_points_as_opencv_has_them(make) -> None:
    plain = make()
    same = make(pixel=[PIXEL[:, None], PIXEL[:2, None]])
    np.testing.assert_array_equal(same.pixel, plain.pixel)


@pytest.mark.parametrize("make", [pairs, corners])
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"pixel": [PIXEL]}, "pixel is given for 1 photos and "),
        ({"pixel": [PIXEL, PIXEL]}, "pixel[1] has 4 rows and "),
        ({"pixel": PIXEL}, "pixel must be a list of arrays, one for each photo"),
        ({"pixel": 3}, "pixel must be a list of arrays"),
        ({"pixel": [PIXEL, WORLD[:2]]}, r"pixel[1] has the shape (2, 3), not (N, 2)"),
        ({"pixel": [PIXEL, PIXEL[:2, None, None]]}, "pixel[1] has the shape (2, 1, 1, 2)"),
        ({"pixel": [PIXEL, [[1, 2], [3]]]}, "pixel[1] is no array"),
        ({"pixel": [PIXEL, [["a", "b"]] * 2]}, "pixel[1] must hold real numbers, not <U1"),
        ({"pixel": [PIXEL, PIXEL[:2] * 1j]}, "real numbers, not complex128"),
        ({"pixel": [PIXEL, [[1, np.nan], [1, 2]]]}, "pixel[1], row 0 is not finite"),
        ({"pixel": [PIXEL, [[1, 2], [1, 15]]]}, "x 1, y 15 is outside the 20x10"),
        ({"image_size": (10,)}, "image_size must be two whole numbers above 0, (width, height)"),
        ({"image_size": (10.0, 20.0)}, "image_size must be two whole numbers"),
        ({"image_size": (0, 20)}, "image_size must be two whole numbers"),
        ({"image_size": "20x10"}, "image_size must be two whole numbers"),
        ({"image_size": (10**6, 20)}, "image_size: a side may have 100000 pixels at most"),
        ({"images": ["a"]}, "1 names are given for 2 photos"),
        ({"images": ["a", "a"]}, "images: 'a' is there twice"),
        ({"images": ["a", " b"]}, "images[1] must be printable text"),
        ({"images": ["a", "b\n"]}, "images[1] must be printable text without blanks at its ends"),
        ({"images": ["a", "b\tc"]}, "images[1] must be printable text"),
        ({"images": "ab"}, "images must be a list of names"),
        ({"weight": [np.ones(4)]}, "weight is given for 1 photos and "),
        ({"weight": [np.ones(4), np.ones(3)]}, "weight[1] has 3 rows and "),
        ({"weight": [np.ones(4), [1, 0]]}, "photo_1: weight 0 must be above 0"),
    ],
)
def test_arrays_that_cannot_be_are_refused_in_one_line(
    make: Callable[..., object], changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(CorrespondenceError) as caught:
        make(**changed)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("make", "changed", "said"),
    [
        (pairs, {"world": [], "pixel": []}, "no photo was given"),
        (
            pairs,
            {"world": [WORLD, WORLD[:0]], "pixel": [PIXEL, PIXEL[:0]]},
            "photo 1 has no points",
        ),
        (pairs, {"world": WORLD}, "world must be a list of arrays"),
        (pairs, {"world": [WORLD, WORLD[:2] * 1e12]}, "world[1], row 0 is not within ±1e+09"),
        (pairs, {"world": [WORLD, [[0, 0, np.inf]] * 2]}, "world[1], row 0 is not finite"),
        (corners, {"places": [PLACES, PLACES[:2] + 0.5]}, "board must hold whole numbers"),
        (corners, {"places": [PLACES, PLACES[:2] - 1]}, "board must count from 0"),
        (
            corners,
            {"places": [PLACES, PLACES[[0, 0]]]},
            "photo_1: column 0, row 0 of ",
        ),
        (
            corners,
            {"boards": ["near"]},
            "board must count from 0, and within what it counts: it goes from 0 to 1",
        ),
    ],
)
def test_points_and_places_that_cannot_be_are_refused(
    make: Callable[..., object], changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(CorrespondenceError) as caught:
        make(**changed)
    assert said in str(caught.value)


def test_a_target_of_plain_data_has_the_corners_of_its_boards() -> None:
    target = Target.from_data(DATA)
    board, column, row, world = target.corners()
    assert len(world) == 24
    np.testing.assert_array_equal(world, target.world_points(board, column, row))
    np.testing.assert_array_equal(world[:2], [[0, 0, 0], [10, 0, 0]])
    np.testing.assert_array_equal(world[23], [30, 20, 100])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ([], "target must hold the keys units and boards"),
        ({"units": "mm", "boards": [], 3: 4}, "target: unknown key '3' for a target file"),
        ({"units": "mm", "boards": [{3}]}, "target: must hold plain data: '{3}' is something else"),
        ({**DATA, "boards": DATA["boards"] * 2}, "board 'near', name: another board has it too"),
        ({**DATA, "boards": [{**DATA["boards"][0], "square": np.nan}]}, "'near', square: must be"),
        ({**DATA, "boards": [{**DATA["boards"][0], "twist": np.nan}]}, "'near', twist: must be"),
        ({**DATA, "boards": [{**DATA["boards"][0], "origin": [0, 0, np.inf]}]}, "origin: must be"),
    ],
)
def test_plain_data_that_are_no_target_are_refused(data: Any, said: str) -> None:
    with pytest.raises(TargetError) as caught:
        Target.from_data(data)
    assert said in str(caught.value)


def test_data_that_hold_themselves_are_refused() -> None:
    data: dict[str, Any] = {"units": "mm"}
    data["boards"] = [data]
    with pytest.raises(TargetError, match="must hold plain data: Circular"):
        Target.from_data(data)


def test_a_photo_in_memory_is_as_good_as_its_file() -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    photo = Photo(name="a", path=__file__, picture=picture)  # type: ignore[arg-type]
    assert photo.read_grey().shape == (2, 4)
    assert photo == Photo(name="a", path=__file__)  # type: ignore[arg-type]
    assert photo.absolute().picture is picture


def test_the_jacobian_is_what_differences_give(fitted: Any) -> None:
    camera: CubicCamera = fitted.camera
    points = np.random.default_rng(1).normal(size=(5, 40, 3)) * [100, 100, 60]
    pixel, slope = camera.project_jacobian(points)
    np.testing.assert_array_equal(pixel, camera.project(points))
    step = 1e-4
    for axis in range(3):
        moved = np.zeros(3)
        moved[axis] = step
        difference = (camera.project(points + moved) - camera.project(points - moved)) / (2 * step)
        np.testing.assert_allclose(slope[..., axis], difference, rtol=1e-5, atol=1e-5)
    outside = np.isnan(pixel[..., 0])
    assert 20 < outside.sum() < 180
    assert np.isnan(slope[outside]).all()
    assert camera.project_jacobian([0, 0, 1])[1].shape == (2, 3)
