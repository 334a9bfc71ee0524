"""target.yaml: what the four kinds of boards mean in space, and every refusal."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cubicfish.diagnosis.object_check import count_planes
from cubicfish.errors import TargetError
from cubicfish.target.boards.markers import MARKER_DICTIONARIES
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.target import Target

FLOOR: dict[str, Any] = {
    "name": "floor",
    "type": "checkerboard",
    "corners": [5, 4],
    "square": 40.0,
    "origin": [10, 20, 30],
    "x_axis": [1, 0, 0],
    "y_axis": [0, -1, 0],
}
WALL: dict[str, Any] = {
    "name": "wall",
    "type": "charuco",
    "corners": [4, 4],
    "square": 40.0,
    "dictionary": "DICT_5X5_250",
    "marker": 30.0,
    "origin": [0, 0, 100],
    "x_axis": [0, 0, 1],
    "y_axis": [0, -1, 0],
}
TAGS: dict[str, Any] = {
    "name": "tags",
    "type": "aprilgrid",
    "tags": [3, 2],
    "tag": 10.0,
    "spacing": 0.25,
}
POINTS: dict[str, Any] = {"name": "cloud", "type": "points", "points": [[0, 0, 0], [1, 2, 3]]}


class PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True


def load(folder: Path, *boards: object, units: object = "mm", **more: object) -> Target:
    path = folder / "target.yaml"
    data = {"units": units, "boards": list(boards), **more}
    path.write_text(yaml.dump(data, Dumper=PlainDumper))
    return Target.load(path)


def test_corners_of_a_grid_are_where_the_axes_say(tmp_path: Path) -> None:
    target = load(tmp_path, FLOOR)
    board = target.boards[0]
    assert (board.columns, board.rows, board.square, board.kind) == (5, 4, 40.0, "checkerboard")
    assert board.first_square == "dark"
    np.testing.assert_allclose(board.world_points(0, 0), [10, 20, 30])
    np.testing.assert_allclose(board.world_points([2, 0], [0, 3]), [[90, 20, 30], [10, -100, 30]])
    np.testing.assert_allclose(board.plane_points(2, 3), [80, 120])


def test_boards_are_exchanged_and_made_flat(tmp_path: Path) -> None:
    drawn = load(tmp_path, FLOOR, WALL)
    still = {"stretch": np.zeros(2), "offsets": np.zeros((4, 4, 3))}
    shape = BoardShape(bend=np.array([2.0, 0]), twist=0, **still)
    bent = drawn.with_boards({1: replace(drawn.boards[1], shape=shape)})
    assert bent.boards[0] is drawn.boards[0]
    assert bent.boards[1].shape is shape
    assert drawn.boards[1].shape is None
    flat = bent.with_flat_boards()
    assert [board.shape for board in flat.boards] == [None, None]
    np.testing.assert_array_equal(flat.corners()[3], drawn.corners()[3])
    assert np.abs(bent.corners()[3] - drawn.corners()[3]).max() > 1


def test_a_board_that_is_alone_is_the_world(tmp_path: Path) -> None:
    alone = {key: FLOOR[key] for key in ("name", "type", "corners", "square")}
    board = load(tmp_path, alone).boards[0]
    np.testing.assert_array_equal(board.world_points([1, 0], [0, 1]), [[40, 0, 0], [0, 40, 0]])
    moved = load(tmp_path, {**alone, "origin": [1, 2, 3]}).boards[0]
    np.testing.assert_array_equal(moved.world_points(1, 1), [41, 42, 3])


def test_world_points_of_a_target_take_the_board_of_each_corner(tmp_path: Path) -> None:
    target = load(tmp_path, FLOOR, WALL, POINTS)
    assert target.board_names == ("floor", "wall", "cloud")
    np.testing.assert_allclose(
        target.world_points([1, 0, 2, 1], [1, 2, 1, 0], [0, 1, 0, 2]),
        [[0, 0, 140], [90, -20, 30], [1, 2, 3], [0, -80, 100]],
    )


def test_an_aprilgrid_counts_tag_corners_as_kalibr_spaces_them(tmp_path: Path) -> None:
    board = load(tmp_path, TAGS).boards[0]
    assert (board.columns, board.rows, board.square) == (6, 4, 10.0)
    x = board.plane_points(np.arange(6), 0)[:, 0]
    np.testing.assert_allclose(x, [0, 10, 12.5, 22.5, 25, 35])
    assert board.markers is not None
    assert (board.markers.dictionary, board.markers.count) == ("DICT_APRILTAG_36h11", 6)
    # Kalibr numbers tags from the bottom row up.
    np.testing.assert_array_equal(
        board.marker_cells(),
        [[0, 0, 1], [1, 1, 1], [2, 2, 1], [3, 0, 0], [4, 1, 0], [5, 2, 0]],
    )


@pytest.mark.parametrize("corners", [[4, 4], [5, 4], [4, 5], [2, 7]])
def test_charuco_markers_are_where_opencv_draws_them(tmp_path: Path, corners: list[int]) -> None:
    board = load(tmp_path, {**WALL, "corners": corners}).boards[0]
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    peer = cv2.aruco.CharucoBoard((corners[0] + 1, corners[1] + 1), 40.0, 30.0, dictionary)
    assert board.markers is not None
    assert board.markers.count == len(peer.getIds())
    ids, column, row = board.marker_cells().T
    np.testing.assert_array_equal(ids, peer.getIds().ravel())
    middles = np.array(peer.getObjPoints()).mean(axis=1)
    np.testing.assert_allclose(middles[:, 0], (column + 0.5) * 40)
    np.testing.assert_allclose(middles[:, 1], (row + 0.5) * 40)


def test_a_bent_board_s_edges_lie_behind_its_middle(tmp_path: Path) -> None:
    drawn = load(tmp_path, WALL).boards[0].world_points([0, 3, 1], [1, 2, 1])
    bent = load(tmp_path, {**WALL, "bend": [0.9, 0], "twist": 0}).boards[0]
    # Who sees the printed face has x to the right and y down: behind is x cross y.
    behind = np.cross(WALL["x_axis"], WALL["y_axis"])
    moved = bent.world_points([0, 3, 1], [1, 2, 1]) - drawn
    np.testing.assert_allclose(moved, np.outer([0.9, 0.9, 0.1], behind), atol=1e-12)


def test_markers_count_from_the_first_and_follow_the_first_square(tmp_path: Path) -> None:
    board = load(tmp_path, {**WALL, "first_marker": 7, "first_square": "light"}).boards[0]
    np.testing.assert_array_equal(board.marker_cells()[:2], [[7, 0, 0], [8, 2, 0]])
    assert len(board.marker_cells()) == 13
    assert load(tmp_path, FLOOR).boards[0].marker_cells().shape == (0, 3)


@pytest.mark.parametrize("name", MARKER_DICTIONARIES)
def test_dictionaries_hold_as_many_markers_as_opencv_has(name: str) -> None:
    if not hasattr(cv2.aruco, name):
        pytest.skip(f"this OpenCV has no {name}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    assert dictionary.bytesList.shape[0] == MARKER_DICTIONARIES[name]


@given(
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.tuples(*[st.floats(-2.5e-4, 2.5e-4)] * 6),
)
def test_nearly_orthonormal_axes_become_orthonormal(
    tmp_path_factory: Any, turn: tuple[float, ...], noise: tuple[float, ...]
) -> None:
    rotation = cv2.Rodrigues(np.array(turn))[0]
    axes = rotation[:2] + np.reshape(noise, (2, 3))
    board = {**FLOOR, "x_axis": axes[0].tolist(), "y_axis": axes[1].tolist()}
    read = load(tmp_path_factory.mktemp("t"), board).boards[0]
    both = np.stack([read.x_axis, read.y_axis])
    np.testing.assert_allclose(both @ both.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(both, axes, atol=2e-3)


def test_planes_are_counted_once(tmp_path: Path) -> None:
    beside = {**FLOOR, "name": "beside", "origin": [1000, 20, 30]}
    back = {**FLOOR, "name": "back", "x_axis": [-1, 0, 0]}
    above = {**FLOOR, "name": "above", "origin": [10, 20, 130]}
    assert count_planes(load(tmp_path, FLOOR).boards) == 1
    assert count_planes(load(tmp_path, FLOOR, beside, back).boards) == 1
    assert count_planes(load(tmp_path, FLOOR, above).boards) == 2
    crossing = {**FLOOR, "name": "crossing", "x_axis": [0, 0, 1]}
    assert count_planes(load(tmp_path, FLOOR, crossing).boards) == 2
    assert count_planes(load(tmp_path, FLOOR, beside, WALL).boards) == 2
    flat = {**POINTS, "points": [[0, 0, 5], [1, 0, 5], [0, 1, 5], [2, 2, 5]]}
    solid = {**POINTS, "points": [[0, 0, 5], [1, 0, 5], [0, 1, 5], [2, 2, 6]]}
    assert count_planes(load(tmp_path, flat).boards) == 1
    assert count_planes(load(tmp_path, solid).boards) == 0


def test_units_are_lengths_or_squares(tmp_path: Path) -> None:
    for units in ("mm", "Inches", "square side"):
        assert load(tmp_path, FLOOR, units=units).units == units
    with pytest.raises(TargetError, match="units: 'furlong' is not known: write mm, cm, m, in"):
        load(tmp_path, FLOOR, units="furlong")


def test_faces_back_to_back_are_two_places(tmp_path: Path) -> None:
    back = {**FLOOR, "name": "back", "origin": [170, 20, 30], "x_axis": [-1, 0, 0]}
    assert len(load(tmp_path, FLOOR, back).boards) == 2


def without(board: dict[str, Any], key: str) -> dict[str, Any]:
    return {k: v for k, v in board.items() if k != key}


NAN = float("nan")
REFUSED: list[tuple[list[object], str]] = [
    ([without(FLOOR, "name")], "board 1: name is missing"),
    ([{**FLOOR, "name": 3}], "board 1, name: must be text: write it in quotes, name: '3'"),
    ([{**FLOOR, "name": " a"}], "board 1, name: .*blank"),
    ([{**FLOOR, "name": "a\nb"}], "board 1, name: must be text of"),
    ([FLOOR, {**WALL, "name": "floor"}], "board 'floor', name: another board has it"),
    (["floor"], "board 1: must be a mapping"),
    ([without(FLOOR, "type")], "board 'floor': type is missing: one of checkerboard, charuco"),
    ([{**FLOOR, "type": "chekerboard"}], "'floor', type: .*did you mean 'checkerboard'"),
    ([{**FLOOR, "type": ["points"]}], "'floor', type: must be text"),
    ([{**FLOOR, "sqare": 3}], "board 'floor': unknown key 'sqare' .*did you mean 'square'"),
    ([{**FLOOR, "squares": 3}], r"unknown key 'squares' .*: say corners: \[columns, rows\]"),
    ([{**FLOOR, "marker": 3}], "unknown key 'marker' for a board of type checkerboard"),
    ([{**POINTS, "origin": [0, 0, 0]}], "unknown key 'origin' for a board of type points"),
    ([without(FLOOR, "corners")], r"'floor': corners is missing: \[columns, rows\], inner corners"),
    ([{**FLOOR, "corners": [5]}], "'floor', corners: must be two whole numbers"),
    ([{**FLOOR, "corners": [5, 4.0]}], "'floor', corners: must be two whole numbers"),
    ([{**FLOOR, "corners": [5, True]}], "'floor', corners: must be two whole numbers"),
    ([{**FLOOR, "corners": [5, 1]}], r"'floor', corners: \[5, 1\] must both lie within 2"),
    ([{**FLOOR, "corners": [5, 10**6]}], "'floor', corners: .*within 2 to 1000"),
    ([without(FLOOR, "square")], "'floor': square is missing"),
    ([{**FLOOR, "square": 0}], "'floor', square: must be a positive, finite number, not '0'"),
    ([{**FLOOR, "square": -1}], "'floor', square: must be a positive"),
    ([{**FLOOR, "square": NAN}], "'floor', square: must be a positive, finite"),
    ([{**FLOOR, "square": float("inf")}], "'floor', square: must be a positive, finite"),
    ([{**FLOOR, "square": True}], "'floor', square: must be a positive, finite"),
    ([{**FLOOR, "square": "40 mn"}], "'floor', square: .* not '40 mn'"),
    ([{**FLOOR, "square": 10**299}], "'floor', square: must be a positive, finite"),
    ([{**FLOOR, "square": 10**400}], "a number with too many digits"),
    ([{**FLOOR, "first_square": "black"}], "'floor', first_square: 'black' is not known"),
    ([{**FLOOR, "origin": [0, 0]}], "'floor', origin: must be three finite numbers"),
    ([{**FLOOR, "origin": [0, 0, NAN]}], "'floor', origin: must be three finite numbers"),
    ([{**FLOOR, "origin": [0, 0, 1e300]}], "'floor', origin: must be three finite numbers"),
    ([{**FLOOR, "x_axis": [1, 0.1, 0]}], "'floor', x_axis: must have length 1 .* not 1.00499"),
    ([{**FLOOR, "y_axis": [0, 0, 0]}], "'floor', y_axis: must have length 1"),
    (
        [{**FLOOR, "y_axis": [0.01, -0.99995, 0]}],
        "'floor', y_axis: must be at a right angle to x_axis, not at 89.43 degrees",
    ),
    ([without(FLOOR, "y_axis")], "'floor': y_axis is missing: x_axis and y_axis go together"),
    ([without(FLOOR, "origin"), WALL], "'floor': origin is missing: a target of several boards"),
    ([{**FLOOR, "name": "twin"}, FLOOR], "board 'floor', origin: .*same place as board 'twin'"),
    (
        [FLOOR, {**FLOOR, "name": "lap", "origin": [120, -40, 30]}],
        "board 'lap', origin: .*same place as board 'floor'",
    ),
    ([POINTS, {**POINTS, "name": "b"}], "board 'b', points: .*same place as board 'cloud'"),
    ([{**WALL, "dictionary": "DICT_5x5_250"}], "dictionary: .*did you mean 'DICT_5X5_250'"),
    ([without(WALL, "marker")], "'wall': marker is missing"),
    ([{**WALL, "marker": 40}], "'wall', marker: 40 must be smaller than the square, 40"),
    ([{**WALL, "first_marker": -1}], "'wall', first_marker: must be a marker's id"),
    ([{**WALL, "first_marker": 1.5}], "'wall', first_marker: must be a marker's id"),
    ([{**WALL, "first_marker": 245}], "12 markers, ids 245 to 256, but DICT_5X5_250 has only 250"),
    (
        [WALL, {**WALL, "name": "b", "origin": [0, 0, 900], "first_marker": 11}],
        "board 'b', first_marker: ids 11 to 11 are on board 'wall' too",
    ),
    ([without(TAGS, "tags")], r"'tags': tags is missing: \[columns, rows\], tags along x"),
    ([without(TAGS, "spacing")], "'tags': spacing is missing: gap between tags divided by"),
    ([{**TAGS, "family": "tag36h12"}], "'tags', family: .*did you mean 'tag36h1"),
    ([{**TAGS, "tags": [1, 6]}], "'tags', tags: .*within 2"),
    ([{**POINTS, "points": [[0, 0, 0]]}], "'cloud', points: must be a list of at least two"),
    ([{**POINTS, "points": [[0, 0, 0], [1, "a", 0]]}], "'cloud', points: point 1 must be three"),
    (
        [{**POINTS, "points": [[0, 0, 0], [5, 0, 0], [0, 0, 0]]}],
        "'cloud', points: points 0 and 2 are in the same place",
    ),
    ([], "boards: must be a list of at least one board"),
    ([{}] * 300, "boards: 300 boards are more than the 256"),
]


@pytest.mark.parametrize(("boards", "message"), REFUSED, ids=[m for _, m in REFUSED])
def test_refusals_name_file_board_and_key(
    tmp_path: Path, boards: list[object], message: str
) -> None:
    with pytest.raises(TargetError, match=message) as caught:
        load(tmp_path, *boards)
    assert str(caught.value).startswith(str(tmp_path / "target.yaml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("boards: []", "units is missing: the unit of every length"),
        ("units: 3\nboards: []", "units: must be text"),
        ("units: ''\nboards: []", "units: must be text"),
        ("units: mm", "boards is missing"),
        ("units: mm\nboards: 3", "boards: must be a list"),
        ("units: mm\nboard: []", "unknown key 'board' for a target file: did you mean 'boards'"),
        ("- 1", "must hold the keys units and boards"),
        ("units: &a mm\nboards: []", "anchors and aliases"),
    ],
)
def test_a_malformed_file_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "target.yaml"
    path.write_text(text)
    with pytest.raises(TargetError, match=message) as caught:
        Target.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "is empty"),
        ("# to do\n", "is empty"),
        ("cubicfish: 2\nlift: ray\n", "is a camera file, not a calibration target"),
        ("image,board,column,row,x,y\n", "must hold the keys units and boards"),
    ],
)
def test_what_is_no_target_says_what_to_name(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(TargetError) as refused:
        Target.load(path)
    assert str(refused.value) == (
        f"{path} {what}: name the target.yaml that says where the boards are, or make one with "
        "'cubicfish target print'"
    )


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=5,
)


@pytest.mark.slow
@given(
    st.sampled_from([FLOOR, WALL, TAGS, POINTS]),
    st.sampled_from(sorted({*FLOOR, *WALL, *TAGS, *POINTS})),
    anything,
)
def test_any_value_for_any_key_is_read_or_refused_in_one_line(
    tmp_path_factory: Any, board: dict[str, Any], key: str, value: object
) -> None:
    said = ""
    try:
        target = load(tmp_path_factory.mktemp("t"), {**board, key: value})
    except TargetError as error:
        said = str(error)
    else:
        assert np.isfinite(target.boards[0].world_points([0, 1], [0, 0])).all()
    assert "\n" not in said
