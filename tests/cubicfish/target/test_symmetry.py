"""Turns after which targets look the same, and the names that their corners have then."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic

from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.observations import Observations
from cubicfish.target.placement import best_named, renamed, symmetries
from cubicfish.target.target import Target


def board(columns: int, rows: int, kind: str = "checkerboard", **others) -> dict:
    return {"name": f"{kind}{columns}", "type": kind, "corners": [columns, rows], "square": 10.0,
            **others}  # fmt: skip


def target(*boards: dict) -> Target:
    return Target.from_data({"units": "mm", "boards": list(boards)})


def corners(of: Target, images: int = 1) -> Observations:
    names, columns, rows, world = of.corners()
    count = len(names)
    return Observations(
        image_size=(100, 100),
        images=tuple(f"{image}.png" for image in range(images)),
        boards=of.board_names,
        image=np.repeat(np.arange(images), count),
        board=np.tile(names, images),
        column=np.tile(columns, images),
        row=np.tile(rows, images),
        pixel=np.tile(world[:, :2], (images, 1)),
        world=np.tile(world, (images, 1)),
    )


def edge(turn: float) -> dict:
    """A board beside the axis z, and the one half a turn about z away."""
    way = np.array([np.cos(turn), np.sin(turn), 0.0])
    out = np.array([-way[1], way[0], 0.0])
    return {**board(4, 3), "name": f"at {turn:.1f}", "origin": (20 * way + 15 * out).tolist(),
            "x_axis": way.tolist(), "y_axis": [0, 0, -1]}  # fmt: skip


@pytest.mark.parametrize(
    ("boards", "count"),
    [
        ([board(6, 4)], 1),
        ([board(5, 5)], 1),
        ([board(4, 4)], 3),
        ([board(9, 6)], 0),
        ([board(6, 4, "charuco", marker=7.0, dictionary="DICT_4X4_50")], 0),
        ([edge(0.0), edge(np.pi)], 1),
        ([edge(0.0), edge(np.pi / 2)], 0),
    ],
)  # fmt: skip
def test_symmetries_are_those_of_squares_and_colours(boards: list[dict], count: int) -> None:
    of = target(*boards)
    found = symmetries(of)
    assert len(found) == count
    seen = corners(of)
    for motion in found:
        named = motion.named(seen, of)
        places = set(zip(named.board, named.column, named.row, strict=True))
        assert len(places) == len(seen.image)
        np.testing.assert_allclose(
            named.world, seen.world @ motion.rotation.T + motion.shift, atol=1e-9
        )
        assert not np.allclose(named.world, seen.world)


def test_boards_are_judged_as_drawn_wherever_they_stand() -> None:
    of = target({**board(6, 4), "origin": [1e5, -3, 7], "x_axis": [0, 0, 1], "y_axis": [0, 1, 0]})
    (motion,) = symmetries(of)
    named = motion.named(corners(of), of)
    np.testing.assert_allclose(
        named.world, of.corners()[3] @ motion.rotation.T + motion.shift, atol=1e-6
    )
    bent = BoardShape(bend=np.ones(2), twist=0.5, stretch=np.zeros(2), offsets=np.ones((4, 6, 3)))
    shaped = of.with_boards({0: replace(of.boards[0], shape=bent)})
    (same,) = symmetries(shaped)
    np.testing.assert_array_equal(same.rotation, motion.rotation)
    # World points are those of the corners as they are.
    named = same.named(corners(shaped), shaped)
    np.testing.assert_array_equal(named.world[::-1], corners(shaped).world)


def test_corners_of_some_photos_get_other_names_and_others_stay() -> None:
    of = target(board(6, 4))
    (motion,) = symmetries(of)
    seen = corners(of, images=3)
    found = renamed(seen, of, {"1.png": motion, "not there.png": motion})
    own = seen.image == 1
    np.testing.assert_array_equal(found.column[~own], seen.column[~own])
    np.testing.assert_array_equal(found.column[own], 5 - seen.column[own])
    np.testing.assert_array_equal(found.row[own], 3 - seen.row[own])
    np.testing.assert_array_equal(found.pixel, seen.pixel)
    assert renamed(seen, of, {}) is seen


def test_the_best_names_are_those_with_the_least_error_photo_by_photo() -> None:
    of = target(board(4, 4))
    motions = symmetries(of)
    truth = corners(of, images=4)
    seen = renamed(truth, of, {f"{k}.png": motion for k, motion in enumerate(motions)})
    assert (seen.world != truth.world).any()

    def squared(pairs: Observations) -> np.ndarray:
        return np.sum(np.square(pairs.world - truth.world), axis=1)

    found = best_named(seen, of, squared)
    np.testing.assert_array_equal(found.column, truth.column)
    np.testing.assert_array_equal(found.row, truth.row)
    # What cannot be told stays.
    same = best_named(seen, of, lambda pairs: np.full(len(pairs.image), np.nan))
    np.testing.assert_array_equal(same.column, seen.column)


def test_unlike_boards_and_many_boards_have_none() -> None:
    assert symmetries(synthetic.corner_of_three()) == ()
    place = {"x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    many = [
        {**board(6, 4), **place, "name": str(number), "origin": [100.0 * number, 0, 0]}
        for number in range(20)
    ]
    assert symmetries(target(*many)) == ()
    assert len(symmetries(target(*many[:2]))) == 1
