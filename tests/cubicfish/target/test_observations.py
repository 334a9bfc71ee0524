"""What was seen in photos: rows chosen, sorted and joined, and world points of a target."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from observed import SIZE, TARGET, any_corners, assert_same

from cubicfish.errors import CorrespondenceError
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target

BOARDS = TARGET.board_names


def rows_of(seen: Observations) -> list[tuple[object, ...]]:
    """Each row by the names of its photo and board."""
    return [
        (seen.images[image], seen.boards[board], *rest)
        for image, board, *rest in zip(
            seen.image.tolist(),
            seen.board.tolist(),
            seen.column.tolist(),
            seen.row.tolist(),
            seen.pixel.tolist(),
            seen.weight.tolist(),
            np.nan_to_num(seen.world, nan=-1).tolist(),
            seen.certain.tolist(),
            strict=True,
        )
    ]


@given(any_corners())
def test_the_photos_one_by_one_are_all_rows(found: Observations) -> None:
    parts = [found.of(name) for name in found.images]
    for name, part in zip(found.images, parts, strict=True):
        assert part.images == found.images
        assert rows_of(part) == [row for row in rows_of(found) if row[0] == name]
    assert_same(Observations.stacked(parts), found.by_photo())


@given(any_corners(), st.data())
def test_what_is_selected_and_what_is_not_are_all_rows(found: Observations, data: Any) -> None:
    chosen = data.draw(hnp.arrays(bool, len(found.image)))
    order = np.argsort(np.concatenate([np.flatnonzero(chosen), np.flatnonzero(~chosen)]))
    both = Observations.stacked([found.select(chosen), found.select(~chosen)])
    assert_same(both.select(order), found)
    assert_same(found.select(np.flatnonzero(chosen)), found.select(chosen))


@given(any_corners(), st.data())
def test_photos_without_rows_go_and_all_rows_stay(found: Observations, data: Any) -> None:
    part = found.select(data.draw(hnp.arrays(bool, len(found.image))))
    seen, photos = part.only_seen()
    assert rows_of(seen) == rows_of(part)
    assert seen.images == tuple(found.images[photo] for photo in photos)
    assert set(seen.images) == {row[0] for row in rows_of(part)}
    again, same = seen.only_seen()
    assert_same(again, seen)
    assert same.tolist() == list(range(len(seen.images)))


@given(any_corners(), any_corners())
def test_joined_photos_come_one_after_the_other(one: Observations, other: Observations) -> None:
    both = Observations.joined([one, other])
    assert both.images == one.images + other.images
    assert rows_of(both) == rows_of(one) + rows_of(other)
    assert_same(both.select(both.image < len(one.images)).only_seen()[0], one)
    of_other = both.select(both.image >= len(one.images)).only_seen()[0]
    assert rows_of(of_other) == rows_of(other)


@given(any_corners())
def test_rows_in_order_go_by_photo_board_row_and_column(found: Observations) -> None:
    ordered = found.in_order()
    keys = list(zip(ordered.image, ordered.board, ordered.row, ordered.column, strict=True))
    assert keys == sorted(keys)
    assert sorted(rows_of(ordered), key=str) == sorted(rows_of(found), key=str)


@given(any_corners())
def test_corners_of_a_target_are_sorted_by_photo_and_stand_on_their_boards(
    found: Observations,
) -> None:
    paired = found.with_target(TARGET)
    order = sorted(range(len(found.image)), key=lambda n: found.image[n])  # stable
    np.testing.assert_array_equal(paired.image, found.image[order])
    np.testing.assert_array_equal(paired.pixel, found.pixel[order])
    np.testing.assert_array_equal(paired.weight, found.weight[order])
    np.testing.assert_array_equal(paired.certain, found.certain[order])
    expected = np.stack([paired.column * 10, paired.row * 10, paired.board * 50], axis=-1)
    np.testing.assert_allclose(paired.world, expected)
    np.testing.assert_array_equal(
        np.stack([paired.board, paired.column, paired.row]),
        np.stack([found.board, found.column, found.row])[:, order],
    )


@given(any_corners())
def test_a_target_may_be_given_again(found: Observations) -> None:
    paired = found.with_target(TARGET)
    assert paired.target is TARGET
    assert_same(paired.with_target(TARGET), paired)
    elsewhere = paired.with_world(paired.world + 1)
    assert elsewhere.target is None
    assert_same(elsewhere.with_target(TARGET), paired)
    assert_same(paired.checked(None), paired)
    assert_same(found.checked(TARGET), paired)


def test_a_target_refuses_boards_and_corners_that_it_lacks() -> None:
    found = Observations(
        image_size=SIZE,
        images=("a.png",),
        boards=("flor",),
        image=np.zeros(1, np.intp),
        board=np.zeros(1, np.intp),
        column=np.array([5]),
        row=np.array([0]),
        pixel=np.zeros((1, 2)),
    )
    with pytest.raises(CorrespondenceError, match=r"board 'flor' .* did you mean 'floor'"):
        found.with_target(TARGET)
    with pytest.raises(CorrespondenceError, match=r"a\.png: column 5, row 0 .*count squares"):
        replace(found, boards=("floor",)).with_target(TARGET)


def test_boards_are_paired_by_name_not_by_order() -> None:
    found = Observations(
        image_size=SIZE,
        images=("a.png",),
        boards=("wall, left", "floor"),
        image=np.zeros(2, np.intp),
        board=np.array([0, 1]),
        column=np.array([6, 1]),
        row=np.array([2, 0]),
        pixel=np.zeros((2, 2)),
    )
    paired = found.with_target(TARGET)
    np.testing.assert_array_equal(paired.board, [1, 0])
    np.testing.assert_allclose(paired.world, [[60, 20, 50], [10, 0, 0]])


def test_world_points_of_other_rows_do_not_matter_to_a_target() -> None:
    two = Observations.from_corners(
        [[[0, 0, 0], [1, 1, 0]]], [np.ones((2, 2))], SIZE, boards=BOARDS
    )
    paired = two.with_target(TARGET)
    assert_same(paired.with_world(np.zeros((1, 3))).checked(TARGET), paired)


def one_corner(**changed: Any) -> Observations:
    given: dict[str, Any] = {"images": ("a.png",), "boards": BOARDS}
    given |= {name: np.zeros(1, np.intp) for name in ("image", "board", "column", "row")}
    return Observations(**(given | {"image_size": SIZE, "pixel": np.zeros((1, 2))} | changed))


def test_what_is_not_said_is_equal_weight_certain_names_and_no_world_points() -> None:
    seen = one_corner()
    assert seen.weight.tolist() == [1]
    assert seen.certain.tolist() == [True]
    assert np.isnan(seen.world).all()
    assert seen.world.shape == (1, 3)
    none = seen.select(np.zeros(1, bool))
    assert (none.world.shape, none.weight.shape, none.certain.dtype) == ((0, 3), (0,), bool)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "corners need the target that they are of: pass it as well"),
        ({"world": np.full((1, 3), np.inf)}, "world, row 0 is not finite"),
        ({"world": np.array([[0, np.nan, 0]])}, "world, row 0 is not finite"),
        ({"world": np.zeros((2, 3))}, "world has 2 rows and pixel has 1"),
        ({"world": np.zeros((1, 2))}, "world has the shape (1, 2), not (N, 3)"),
        ({"world": [["a", "b", "c"]]}, "world must hold real numbers"),
        ({"world": None}, "world must hold real numbers"),
        ({"pixel": np.full((1, 2), np.nan)}, "pixel, row 0 is not finite"),
        ({"weight": np.zeros(1)}, "a.png: weight 0 must be above 0"),
        ({"certain": np.zeros(1)}, "certain must hold 1 times True or False"),
        ({"certain": np.zeros(2, bool)}, "certain must hold 1 times True or False"),
        ({"image": np.array([1])}, "image must count from 0"),
        ({"board": np.array([2])}, "board must count from 0"),
        ({"board": np.array([-1])}, "board must count from 0"),
        ({"row": np.full(1, 0.5)}, "row must hold whole numbers"),
        ({"column": np.array([-1])}, "column must count from 0"),
        ({"image_size": (0, 1)}, "image_size must be two whole numbers"),
    ],
)
def test_what_cannot_be_fitted_to_is_refused_in_one_line(
    changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(CorrespondenceError) as caught:
        one_corner(**changed).checked(None)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_rows_of_photos_in_disorder_are_sorted_only_with_their_target() -> None:
    seen = Observations.from_points([np.ones((2, 3))] * 2, [np.ones((2, 2))] * 2, SIZE)
    with pytest.raises(CorrespondenceError, match="image must not decrease"):
        seen.select(np.array([2, 3, 0, 1])).checked(None)
    assert_same(seen.select(np.array([2, 3, 0, 1])).by_photo().checked(None), seen)


def test_points_without_names_have_no_target() -> None:
    points = Observations.from_points([np.ones((2, 3))], [np.ones((2, 2))], SIZE)
    assert_same(points.checked(None), points)
    with pytest.raises(CorrespondenceError, match="do not say which corners of the target"):
        points.checked(TARGET)


def test_a_photo_that_is_not_there_is_named() -> None:
    with pytest.raises(CorrespondenceError, match=r"'b\.png' is not among these: .*a\.png"):
        one_corner().of("b.png")


def test_corners_know_their_world_points_once_their_target_is_known() -> None:
    two: Target = replace(TARGET, boards=TARGET.boards[::-1])
    seen = one_corner(board=np.array([1]), column=np.array([6]))
    np.testing.assert_array_equal(seen.with_target(TARGET).world, [[60, 0, 50]])
    np.testing.assert_array_equal(seen.with_target(two).world, [[60, 0, 50]])
