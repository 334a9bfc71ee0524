"""Paper, objects made for it, and where their prints lie on pages."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard

from cubicfish import Target, TargetError
from cubicfish.diagnosis import check_object
from cubicfish.scene.faces import board_face
from cubicfish_cli.extensions.printing.command import PrintOptions
from cubicfish_cli.extensions.printing.layout import (
    STRIP,
    boards_in_millimetres,
    lay_out,
    quiet_zone,
)
from cubicfish_cli.extensions.printing.objects import BAND, design
from cubicfish_cli.extensions.printing.paper import paper
from cubicfish_cli.inputs.target_source import length_mm
from tests.cubicfish.scene.test_faces import aprilgrid

MARGIN = 8.0
TYPES = ("checkerboard", "charuco", "aprilgrid")
KINDS = ("corner", "box", "board")
ENDS = {"left": (3, 0), "top": (0, 1), "right": (1, 2), "bottom": (2, 3)}


@pytest.mark.parametrize(
    ("text", "short", "long"),
    [
        ("A4", 210, 297),
        ("a0", 841, 1189),
        ("letter", 215.9, 279.4),
        ("600x400mm", 400, 600),
        ("24 x 36 in", 609.6, 914.4),
        ("300×150", 150, 300),
    ],
)
def test_sizes_of_paper(text, short, long):
    one = paper(text)
    assert (one.short, one.long) == pytest.approx((short, long))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("A44", "did you mean 'A4'"),
        ("90x200mm", "at least"),
        ("120x130mm", "at least"),
        ("9000x1000mm", "at most"),
        ("", "known:"),
    ],
)
def test_what_is_no_paper(text, said):
    with pytest.raises(TargetError, match=said):
        paper(text)


@pytest.mark.parametrize(
    ("text", "value"), [("30", 30), ("30mm", 30), ("3 cm", 30), ("1.25in", 31.75), ("0.03m", 30)]
)
def test_lengths(text, value):
    assert length_mm(text) == value


@pytest.mark.parametrize("text", ["", "mm", "-3mm", "0", "3 furlongs", "1e9", "nan"])
def test_no_lengths(text):
    with pytest.raises(TargetError, match="write it like 30mm"):
        length_mm(text)


def test_units_of_a_target():
    with pytest.raises(TargetError, match="'furlong' cannot be printed at true scale"):
        boards_in_millimetres(Target(units="furlong", boards=(checkerboard("a", 5, 4, 1.0),)))


@pytest.mark.parametrize("size", ["A4", "Letter"])
@pytest.mark.parametrize("board_type", TYPES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_object_is_on_one_page_a_board_and_can_be_told_apart(
    kind, board_type, size, tmp_path
):
    on = paper(size)
    target, pages = design(PrintOptions(kind=kind, board_type=board_type), on, margin=MARGIN)
    path = tmp_path / "target.yaml"
    path.write_text(target.text())
    facts = check_object(Target.load(path))  # refuses shared ids and places
    assert not facts.ambiguous
    assert facts.crossing == ()
    assert facts.named_by == ("geometry" if board_type == "checkerboard" else "markers")
    assert [page.board for page in pages] == list(target.boards)
    areas = []
    for page in pages:
        assert sorted((page.width, page.height)) == [on.short, on.long]
        keeps_its_distances(page, quiet_zone(page.board))
        left, top, right, bottom = printed(page)
        areas.append((right - left) * (bottom - top))
    assert max(areas) > 0.3 * on.short * on.long
    assert min(page.board.columns * page.board.rows for page in pages) >= 30


def printed(page):
    """Left, top, right and bottom of the print on the page."""
    face = board_face(page.board, margin=0.0)
    return tuple(np.concatenate([np.add(face.lower, page.shift), np.add(face.upper, page.shift)]))


def keeps_its_distances(page, quiet):
    """The print and its white are on the paper, and clear of the strip and of what is cut."""
    left, top, right, bottom = printed(page)
    for near, far in ((left, 0), (top, 0), (page.width, right), (page.height, bottom)):
        assert near - far >= max(quiet, MARGIN) - 1e-6
    edges = {"left": left, "top": top, "right": right, "bottom": bottom}
    for side, cut in page.cuts.items():
        end = {"left": 0, "top": 0, "right": page.width, "bottom": page.height}[side]
        assert abs(end - cut.place) >= MARGIN + BAND - 1e-6
        assert abs(edges[side] - cut.place) >= quiet - 1e-6
    x, y = page.strip
    width, height = (STRIP, page.length) if page.turned else (page.length, STRIP)
    assert max(y - bottom, top - y - height, x - right) >= quiet - 1e-6
    assert x >= MARGIN - 1e-6
    assert x + width <= page.width - MARGIN + 1e-6
    assert y >= MARGIN - 1e-6
    assert y + height <= page.height - MARGIN + 1e-6


@pytest.mark.parametrize("board_type", TYPES)
@pytest.mark.parametrize("kind", ["corner", "box"])
def test_edges_that_meet_are_one_line_in_the_world(kind, board_type):
    _, pages = design(PrintOptions(kind=kind, board_type=board_type), paper("A4"), margin=MARGIN)
    lines = {}
    for page in pages:
        outline = sheet_outline(page)
        for side, cut in page.cuts.items():
            lines[page.board.name, side] = (outline[list(ENDS[side])], (cut.board, cut.side))
    assert len(lines) == {"corner": 6, "box": 16}[kind]
    for name, (one, met) in lines.items():
        other, back = lines[met]
        assert back == name
        along = one[1] - one[0]
        along /= np.linalg.norm(along)
        for end in other:
            np.testing.assert_allclose(np.cross(end - one[0], along), 0, atol=1e-6)
        # They share a stretch of it, and a whole side where the object is closed all around.
        a_ends, b_ends = np.sort((one - one[0]) @ along), np.sort((other - one[0]) @ along)
        assert min(a_ends[1], b_ends[1]) - max(a_ends[0], b_ends[0]) > 100
        if kind != "corner":
            np.testing.assert_allclose(a_ends, b_ends, atol=1e-6)


def sheet_outline(page):
    """World points (4, 3) of the sheet as it is cut out, in order from the top left."""
    ends = {"left": 0.0, "top": 0.0, "right": page.width, "bottom": page.height}
    ends |= {side: cut.place for side, cut in page.cuts.items()}
    corners = np.array([(ends[x], ends[y]) for y, x in
                        (("top", "left"), ("top", "right"), ("bottom", "right"),
                         ("bottom", "left"))])  # fmt: skip
    return page.board.origin + (corners - page.shift) @ page.board.axes[:2]


@pytest.mark.parametrize("kind", ["corner", "box"])
def test_faces_look_inside(kind):
    target, _ = design(PrintOptions(kind=kind), paper("A4"), margin=MARGIN)
    middles = [
        board.world_points((board.columns - 1) / 2, (board.rows - 1) / 2) for board in target.boards
    ]
    assert all(board.shape is None for board in target.boards)
    for (a, one), (b, other) in combinations(zip(middles, target.boards, strict=True), 2):
        assert (b - a) @ -one.axes[2] > 0
        assert (a - b) @ -other.axes[2] > 0
    # Rows run down wherever a board is upright.
    upright = [board for board in target.boards if abs(board.axes[2][2]) < 0.5]
    assert len(upright) in (2, 4)
    assert all(tuple(board.y_axis) == (0, 0, -1) for board in upright)


def test_what_is_asked_for_is_made():
    target, _ = design(PrintOptions(kind="corner", square="1in"), paper("A3"), margin=MARGIN)
    assert {board.square for board in target.boards} == {25.4}
    target, _ = design(PrintOptions(kind="board", counts=(8, 6)), paper("A4"), margin=MARGIN)
    assert (target.boards[0].columns, target.boards[0].rows) == (8, 6)
    target, (page,) = design(PrintOptions(kind="board", square="12mm"), paper("A4"), margin=MARGIN)
    assert target.boards[0].square == 12
    assert printed(page)[2] - printed(page)[0] > 240
    target, (page,) = design(
        PrintOptions(kind="board", square="25mm", counts=(9, 6)), paper("A4"), margin=MARGIN
    )
    assert page.turned
    target, _ = design(
        PrintOptions(kind="corner", board_type="aprilgrid", square="30mm", dictionary="tag36h10"),
        paper("A4"),
        margin=MARGIN,
    )
    markers = [board.markers for board in target.boards]
    assert [one.first for one in markers] == np.cumsum([0, *(one.count for one in markers)])[
        :3
    ].tolist()
    assert {one.dictionary for one in markers} == {"DICT_APRILTAG_36h10"}


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"kind": "corner", "square": "90mm"}, "squares of 90 mm does not fit on A4"),
        ({"kind": "board", "counts": (70, 60)}, "70x60 corners does not fit on A4"),
        ({"square": "40mm", "counts": (7, 6)}, "320 x 280 mm, does not fit on one"),
        ({"kind": "box", "board_type": "charuco", "dictionary": "DICT_4X4_50"}, "50"),
        ({"board_type": "charuco", "dictionary": "DICT_4X5_50"}, "did you mean"),
        ({"board_type": "aprilgrid", "dictionary": "DICT_4X4_50"}, "family"),
    ],
)
def test_what_cannot_be_made(wanted, said):
    with pytest.raises(TargetError, match=said):
        design(PrintOptions(**{"kind": "board", **wanted}), paper("A4"), margin=MARGIN)


def test_paper_that_is_too_small_for_an_object():
    with pytest.raises(TargetError, match="too small for a box"):
        design(PrintOptions(kind="box"), paper("A5"), margin=MARGIN)
    with pytest.raises(TargetError, match="with margins of 90 mm: take larger paper"):
        lay_out(checkerboard("a", 9, 6, 25.0), paper("A4"), margin=90.0)


def test_a_page_lies_as_its_board_does():
    for columns, rows in ((9, 6), (6, 9)):
        page = lay_out(checkerboard("a", columns, rows, 12.0), paper("A4"), margin=MARGIN)
        assert (page.width > page.height) == (columns > rows)


def test_a_common_board_fits_common_paper_beside_its_strip():
    board = checkerboard("a", 9, 6, 25.0)
    page = lay_out(board, paper("A4"), margin=MARGIN)
    assert page.turned
    keeps_its_distances(page, 10.0)
    keeps_its_distances(lay_out(board, paper("Letter"), margin=MARGIN), 10.0)


@given(
    st.integers(2, 15),
    st.integers(2, 15),
    st.floats(8, 70),
    st.sampled_from(["A5", "A4", "Letter", "A3", "600x400mm"]),
    st.booleans(),
)
def test_pages_of_any_board(columns, rows, square, size, tags):
    board, on = checkerboard("a", columns, rows, square), paper(size)
    if tags:
        target = Target(units="cm", boards=(aprilgrid((columns, rows), spacing=0.3),))
        (board,) = boards_in_millimetres(target)
    quiet = 0.4 * quiet_zone(board)
    try:
        page = lay_out(board, on, margin=MARGIN)
    except TargetError:
        face = board_face(board, margin=0.0)
        width, height = np.subtract(face.upper, face.lower)
        short, long = sorted((width, height))
        rim = max(quiet, MARGIN)
        beside = MARGIN + STRIP + quiet
        fits = any(
            short + one <= on.short and long + other <= on.long
            for one, other in ((2 * rim, rim + beside), (rim + beside, 2 * rim))
        )
        assert not fits
        return
    keeps_its_distances(page, quiet)


def test_boards_of_a_target_in_millimetres():
    inches = Target(
        units="in",
        boards=(checkerboard("a", 5, 4, 1.0, origin=(2, 0, 0)), checkerboard("b", 4, 3, 1.0)),
    )
    one, other = boards_in_millimetres(inches)
    assert one.square == pytest.approx(25.4)
    np.testing.assert_allclose(one.origin, (50.8, 0, 0))
    assert quiet_zone(other) == 25.4
