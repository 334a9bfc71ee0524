"""What is said of an object before photos: against geometry by hand, and against the identified."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from anonymous_grids import anonymous_photos
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import IMAGE_SIZE, as_type, box_of_four, checkerboard, corner_of_three, flat_board

from cubicfish.diagnosis.object_check import check_object
from cubicfish.find.identification.identified import Decided
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.geometry import similarity
from cubicfish.solve.poses import rotation_from_vector
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.markers import Markers
from cubicfish.target.placement import placement_of
from cubicfish.target.target import Target


def only(columns: int, rows: int) -> Target:
    return Target(units="mm", boards=(checkerboard("board", columns, rows, 25.0),))


def cube(corners: int, gap: float = 60.0) -> Target:
    """Six equal boards on the outside of a cube."""
    half = 20.0 * (corners - 1)
    boards = []
    for number, (x, y) in enumerate(
        [
            ((1, 0, 0), (0, -1, 0)),
            ((0, 1, 0), (0, 0, -1)),
            ((-1, 0, 0), (0, 0, -1)),
            ((0, -1, 0), (0, 0, -1)),
            ((1, 0, 0), (0, 0, -1)),
            ((1, 0, 0), (0, 1, 0)),
        ]
    ):
        out = np.cross(y, x)
        origin = out * (half + gap) - half * np.add(x, y)
        boards.append(checkerboard(f"face {number}", corners, corners, 40.0, origin, x, y))
    return Target(units="mm", boards=tuple(boards))


def shifted(board: Board, *by: float) -> Board:
    return replace(board, origin=board.origin + np.array(by))


@pytest.mark.parametrize("planes", [1, 2, 3, 4])
def test_planes_are_counted_in_any_unit(planes):
    boards = box_of_four().boards[:planes]
    for scale in (1e-3, 1.0):
        made = [replace(b, origin=b.origin * scale, square=b.square * scale) for b in boards]
        facts = check_object(Target(units="mm", boards=tuple(made)))
        assert facts.planes == planes
        assert facts.flat == (planes == 1)


@pytest.mark.parametrize(
    ("size", "angles"),
    [
        ((9, 6), []),  # half a turn swaps dark and light
        ((6, 4), [180]),
        ((7, 5), [180]),
        ((7, 7), [180]),  # a quarter turn swaps dark and light
        ((8, 8), [90, 90, 180]),
    ],
)
@pytest.mark.parametrize("first_square", ["dark", "light"])
def test_turns_of_a_single_board(size, angles, first_square):
    target = only(*size)
    target = replace(target, boards=(replace(target.boards[0], first_square=first_square),))
    facts = check_object(target)
    assert sorted(round(turn.angle_deg, 6) for turn in facts.symmetries) == angles
    for turn in facts.symmetries:
        assert abs(turn.axis[2]) == pytest.approx(1)
    assert facts.ambiguous == bool(angles)


def test_three_different_boards_at_a_corner():
    facts = check_object(corner_of_three())
    assert facts.corners == 54 + 56 + 35
    assert facts.symmetries == ()
    assert facts.look_alikes == (
        ("right",),
    )  # 7x5: the only board that half a turn leaves as it is
    assert facts.crossing == ()


def test_a_box_without_a_lid_and_a_wall_has_one_half_turn():
    facts = check_object(box_of_four())
    (turn,) = facts.symmetries
    assert dict(zip(turn.boards, turn.onto, strict=True)) == {
        "floor": "back", "back": "floor", "left": "right", "right": "left"
    }  # fmt: skip
    assert turn.angle_deg == pytest.approx(180)
    np.testing.assert_allclose(turn.axis, [0, 0.5**0.5, 0.5**0.5], atol=1e-9)
    assert facts.look_alikes == (box_of_four().board_names,)


@pytest.mark.parametrize("target", [box_of_four(), cube(8), cube(7)])
def test_turns_are_rotations_about_their_axes(target):
    """Turning each board about the axis puts its corners on those of another, shifted alike."""
    by_name = {board.name: Target(units="mm", boards=(board,)) for board in target.boards}
    middle = target.corners()[3].mean(axis=0)
    for turn in check_object(target).symmetries:
        about = rotation_from_vector(np.radians(turn.angle_deg) * turn.axis)
        for one, other in zip(turn.boards, turn.onto, strict=True):
            image = (by_name[one].corners()[3] - middle) @ about.T + middle
            apart = np.linalg.norm(image[:, None] - by_name[other].corners()[3][None], axis=-1)
            assert apart.min(axis=1).max() < 1e-6


@pytest.mark.parametrize(("corners", "turns"), [(8, 23), (7, 3)])
def test_a_cube_has_the_turns_that_its_colours_leave(corners, turns):
    target = cube(corners)
    facts = check_object(target)
    assert len(facts.symmetries) == turns
    assert facts.look_alikes == (target.board_names,)


@settings(max_examples=8)
@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_turns_are_those_of_the_object_wherever_it_is(motion):
    rotation = rotation_from_vector(np.array(motion[:3]))
    moved = [
        replace(
            board,
            origin=rotation @ board.origin + 100 * np.array(motion[3:]),
            x_axis=rotation @ board.x_axis,
            y_axis=rotation @ board.y_axis,
        )
        for board in box_of_four().boards
    ]
    target = Target(units="mm", boards=tuple(moved))
    (turn,) = check_object(target).symmetries
    about = rotation_from_vector(np.radians(turn.angle_deg) * turn.axis)
    world = target.corners()[3]
    image = (world - world.mean(axis=0)) @ about.T + world.mean(axis=0)
    apart = np.linalg.norm(image[::7, None] - world[None], axis=-1).min(axis=1)
    assert apart.max() < 1e-6
    motion = similarity(world, image)
    assert placement_of(target).landing(motion.rotation, motion.shift) is not None


def named(target: Target, boards: list[int]) -> list[Decided]:
    """What identified makes of photos in which only some boards are found."""
    poses = synthetic.poses_around(target, 3, distance=(0.3, 0.6), off_axis_deg=45, seed=185)
    corners = synthetic.synthetic_corners(target, poses, noise=0.1)
    keep = np.isin(corners.board, boards)
    fields = ("image", "board", "column", "row", "pixel", "weight")
    corners = replace(corners, **{name: getattr(corners, name)[keep] for name in fields})
    grids, _ = anonymous_photos(corners, target)
    identified = name_grids(grids, target, IMAGE_SIZE, ["a", "b", "c"])
    return [grid.verdict for photo in identified.grids for grid in photo]


@pytest.mark.slow
def test_naming_leaves_out_boards_that_look_alike_and_what_does_not_tell_them():
    box = box_of_four()
    assert set(named(box, [0, 1, 2, 3])) == {Decided.NAMED}
    assert set(named(box, [0, 1, 2])) == {Decided.TWIN}
    # One wall that is higher tells the boards that stand beside it.
    higher = shifted(box.boards[2], 0, 0, 40 * 1.5)
    moved = replace(box, boards=(*box.boards[:2], higher, box.boards[3]))
    assert check_object(moved).symmetries == ()
    assert set(named(moved, [0, 1, 2])) == {Decided.NAMED}


def test_equal_boards_far_from_each_other_need_not_be_close_to_look_alike():
    target = Target(
        units="mm",
        boards=(
            checkerboard("one", 9, 6, 25.0),
            checkerboard("two", 9, 6, 50.0, (900, 0, 0)),
            checkerboard("three", 8, 5, 25.0, (0, 900, 0)),
        ),
    )
    facts = check_object(target)  # alone, a board of twice the size is only nearer
    assert facts.look_alikes == (("one", "two"),)


def test_markers_leave_nothing_to_mix_up():
    floor, left, right = corner_of_three().boards
    marks = Markers(dictionary="DICT_4X4_50", side=18.0, first=0, count=35)
    marked = as_type(floor, "charuco", markers=marks)
    facts = check_object(Target(units="mm", boards=(marked, left, right)))
    assert facts.named_by == "markers"
    assert facts.plain == ("left", "right")
    assert not facts.ambiguous
    assert check_object(Target(units="mm", boards=(replace(marked, rows=9),))).symmetries == ()


def points(name: str, world: np.ndarray) -> Board:
    board = checkerboard(name, len(world), 1, 0.0)
    return as_type(board, "points", points=world)


def test_lists_of_points_are_no_boards():
    world = np.random.default_rng(0).uniform(0, 50, (40, 3))
    facts = check_object(Target(units="mm", boards=(points("dots", world),)))
    assert (facts.planes, facts.named_by) == (0, "table")
    both = check_object(Target(units="mm", boards=(points("dots", world), *only(6, 4).boards)))
    assert (both.corners, both.named_by, both.plain) == (64, "geometry", ("board",))
    assert len(both.symmetries) == 1


def test_prints_that_reach_into_each_other_are_named():
    floor, left, right = corner_of_three().boards
    sunk = shifted(left, 50, 0, -60)
    assert check_object(Target(units="mm", boards=(floor, sunk, right))).crossing == (
        ("floor", "left"),
    )
    # A slope that comes down to the floor's plane 37 mm behind the floor's end.
    down = np.array([0.8, 0, -0.6])
    ramp = checkerboard("ramp", 5, 11, 25.0, np.array([100, 60, 150]) + 25 * down, (0, 1, 0), down)
    assert check_object(Target(units="mm", boards=(floor, ramp))).crossing == ()
    assert check_object(Target(units="mm", boards=(floor, shifted(ramp, -60, 0, 0)))).crossing
    beside = [floor, shifted(floor, 230, 0, 0), shifted(floor, 600, 0, 0)]
    boards = tuple(replace(b, name=n) for b, n in zip(beside, "abc", strict=True))
    assert check_object(Target(units="mm", boards=boards)).crossing == (("a", "b"),)
    touching = shifted(boards[0], 250, 0, 0)
    touching = replace(touching, name="d")
    assert check_object(Target(units="mm", boards=(boards[0], touching))).crossing == ()
    back = replace(
        flat_board().boards[0], name="back", x_axis=-np.eye(3)[0], origin=np.array([300.0, 0, 0])
    )
    plate = Target(units="mm", boards=(*flat_board().boards, back))
    assert check_object(plate).crossing == ()


def test_many_boards_are_looked_at_in_time():
    boards = [
        checkerboard(f"b{k}", 9, 6, 25.0, (400.0 * (k % 10), 400.0 * (k // 10), 0))
        for k in range(60)
    ]
    facts = check_object(Target(units="mm", boards=tuple(boards)))
    assert facts.look_alikes == (tuple(board.name for board in boards),)
    assert facts.symmetries == ()
