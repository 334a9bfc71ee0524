"""Paper, objects made for it, and where their prints lie on pages."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import checkerboard

from cubicfish_cli.diagnosis.object_check import check_object
from cubicfish_cli.errors import TargetError
from cubicfish_cli.printing.layout import BAND, OVERLAP, lay_out
from cubicfish_cli.printing.objects import KINDS, Wanted, design
from cubicfish_cli.printing.sheet import (
    STRIP,
    Sheet,
    in_millimetres,
    length_mm,
    millimetres_per,
    paper,
    sheets_of,
)
from cubicfish_cli.target import Target, load_target, target_text
from tests.rendering.test_faces_markers import aprilgrid

MARGIN = 8.0
TYPES = ("checkerboard", "charuco", "aprilgrid")


@pytest.mark.parametrize(
    ("text", "short", "long"),
    [
        ("A4", 210, 297),
        ("a0", 841, 1189),
        ("letter", 215.9, 279.4),
        ("ansi-c", 431.8, 558.8),
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
    [("A44", "did you mean 'A4'"), ("80x90mm", "at least"), ("9mx1m", "at most"), ("", "known:")],
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
    assert millimetres_per("m") == 1000
    assert millimetres_per("in") == 25.4
    with pytest.raises(TargetError, match="'furlong' cannot be printed at true scale"):
        millimetres_per("furlong")


@pytest.mark.parametrize("size", ["A4", "Letter"])
@pytest.mark.parametrize("board_type", TYPES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_object_is_on_one_page_a_board_and_can_be_told_apart(
    kind, board_type, size, tmp_path
):
    on = paper(size)
    target, sheets = design(Wanted(kind=kind, type=board_type), on, margin=MARGIN)
    path = tmp_path / "target.yaml"
    path.write_text(target_text(target))
    facts = check_object(load_target(path))  # refuses shared ids and places
    assert not facts.ambiguous
    assert facts.boards_needed in (1, None)
    assert (facts.turned_away, facts.crossing) == ((), ())
    assert facts.named_by == ("geometry" if board_type == "checkerboard" else "markers")
    for sheet in sheets:
        (page,) = lay_out(sheet, on, margin=MARGIN)
        assert page.tile is None
        assert sorted((page.width, page.height)) == [on.short, on.long]
        assert page.quiet == sheet.quiet
        keeps_its_distances(page)
        # What is cut out of the page is what the world's edges were worked out from.
        assert set(page.cuts) == set(sheet.seams)
        on_page = sheet.outline + page.shift
        for side, place in page.cuts.items():
            end = on_page.min(axis=0) if side in ("left", "top") else on_page.max(axis=0)
            assert place == pytest.approx(end[0 if side in ("left", "right") else 1])
    areas = [np.prod(sheet.size) for sheet in sheets]
    assert max(areas) > 0.3 * on.short * on.long
    assert min(sheet.board.columns * sheet.board.rows for sheet in sheets) >= 30


def keeps_its_distances(page):
    """The print and its white are on the paper, and clear of the strip and of what is cut."""
    printed = page.window.moved(page.shift)
    strip = page.strip.place
    for near, far in (
        (printed.left, 0),
        (printed.top, 0),
        (page.width, printed.right),
        (page.height, printed.bottom),
    ):
        assert near - far >= max(page.quiet, page.margin) - 1e-6
    for side, place in page.cuts.items():
        beyond = place if side in ("left", "top") else (page.width, page.height)[side == "bottom"]
        beyond = beyond if side in ("left", "top") else beyond - place
        assert beyond >= page.margin + BAND - 1e-6
        assert abs(getattr(printed, side) - place) >= page.quiet - 1e-6
    apart = max(strip.top - printed.bottom, printed.top - strip.bottom, strip.left - printed.right)
    assert apart >= page.quiet - 1e-6
    assert strip.left >= page.margin - 1e-6
    assert strip.right <= page.width - page.margin + 1e-6
    assert strip.bottom <= page.height - page.margin + 1e-6


@pytest.mark.parametrize("board_type", TYPES)
@pytest.mark.parametrize("kind", ["corner", "box", "block"])
@pytest.mark.parametrize("tiled", [False, True])
def test_edges_with_the_same_letter_are_one_line_in_the_world(kind, board_type, tiled):
    wanted = Wanted(kind=kind, type=board_type)
    if tiled:
        wanted = Wanted(kind=kind, type=board_type, square=60.0, counts=(8, 5))
    _, sheets = design(wanted, paper("A4"), margin=MARGIN)
    lines = {}
    for sheet in sheets:
        corner = sheet.board.origin + sheet.outline @ sheet.board.axes[:2]
        ends = {"left": (3, 0), "top": (0, 1), "right": (1, 2), "bottom": (2, 3)}
        for side, seam in sheet.seams.items():
            lines.setdefault(seam.letter, []).append((corner[list(ends[side])], sheet, seam, side))
    assert len(lines) == {"corner": 3, "box": 8, "block": 8}[kind]
    for (one, a, seam_a, side_a), (other, b, seam_b, side_b) in lines.values():
        assert (seam_a.board, seam_a.side) == (b.board.name, side_b)
        assert (seam_b.board, seam_b.side) == (a.board.name, side_a)
        along = one[1] - one[0]
        along /= np.linalg.norm(along)
        for end in other:
            np.testing.assert_allclose(np.cross(end - one[0], along), 0, atol=1e-6)
        # They share a stretch of it, and a whole side where the object is closed all around.
        a_ends, b_ends = np.sort((one - one[0]) @ along), np.sort((other - one[0]) @ along)
        assert min(a_ends[1], b_ends[1]) - max(a_ends[0], b_ends[0]) > 100
        if kind != "corner":
            np.testing.assert_allclose(a_ends, b_ends, atol=1e-6)


@pytest.mark.parametrize(("kind", "inside"), [("corner", True), ("box", True), ("block", False)])
def test_faces_look_inside_or_outside(kind, inside):
    target, _ = design(Wanted(kind=kind), paper("A4"), margin=MARGIN)
    middles = [
        board.world_points((board.columns - 1) / 2, (board.rows - 1) / 2) for board in target.boards
    ]
    assert all(board.shape is None for board in target.boards)
    for (a, one), (b, other) in combinations(zip(middles, target.boards, strict=True), 2):
        towards = [(b - a) @ -one.axes[2], (a - b) @ -other.axes[2]]
        assert all((value > 0) == inside for value in towards)
    # Rows run down wherever a board is upright.
    upright = [board for board in target.boards if abs(board.axes[2][2]) < 0.5]
    assert len(upright) in (2, 4)
    assert all(tuple(board.y_axis) == (0, 0, -1) for board in upright)


def test_what_is_asked_for_is_made():
    target, _ = design(
        Wanted(kind="corner", square=25.4, counts=(7, 4)), paper("A3"), margin=MARGIN
    )
    assert (target.boards[0].columns, target.boards[0].rows) == (7, 4)
    assert {board.square for board in target.boards} == {25.4}
    target, _ = design(Wanted(kind="board", counts=(8, 6)), paper("A4"), margin=MARGIN)
    assert (target.boards[0].columns, target.boards[0].rows) == (8, 6)
    target, sheets = design(Wanted(kind="board", square=12.0), paper("A4"), margin=MARGIN)
    assert target.boards[0].square == 12
    assert sheets[0].size[0] > 240
    target, _ = design(
        Wanted(kind="box", type="aprilgrid", dictionary="tag25h9", counts=(3, 2)),
        paper("A4"),
        margin=MARGIN,
    )
    assert [board.columns for board in target.boards] == [6, 6, 6, 4, 4]
    markers = [board.markers for board in target.boards]
    assert [one.first for one in markers] == [0, 6, 12, 18, 22]
    assert {one.dictionary for one in markers} == {"DICT_APRILTAG_25h9"}


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (Wanted(kind="corner", square=90.0), "squares of 90 mm does not fit on A4"),
        (Wanted(kind="box", type="charuco", dictionary="DICT_4X4_50"), "has only 50"),
        (Wanted(kind="board", type="charuco", dictionary="DICT_4X5_50"), "did you mean"),
        (Wanted(kind="board", type="aprilgrid", dictionary="DICT_4X4_50"), "no family"),
        (Wanted(kind="board", dictionary="DICT_4X4_50"), "have no markers"),
        (Wanted(kind="box", counts=(4, 4), square=30.0), "must be told apart"),
    ],
)
def test_what_cannot_be_made(wanted, said):
    with pytest.raises(TargetError, match=said):
        design(wanted, paper("A4"), margin=MARGIN)


def test_paper_that_is_too_small_for_an_object():
    with pytest.raises(TargetError, match="too small for a box"):
        design(Wanted(kind="box"), paper("A5"), margin=MARGIN)
    with pytest.raises(TargetError, match="no room between margins of 90 mm"):
        lay_out(Sheet(board=checkerboard("a", 9, 6, 25.0)), paper("A4"), margin=90.0)
    with pytest.raises(TargetError, match="more than 200"):
        lay_out(Sheet(board=checkerboard("a", 9, 6, 900.0)), paper("A4"), margin=MARGIN)


def test_a_common_board_fits_a4_beside_its_strip():
    (page,) = lay_out(Sheet(board=checkerboard("a", 9, 6, 25.0)), paper("A4"), margin=MARGIN)
    assert page.strip.turned
    assert page.quiet == pytest.approx(10)
    keeps_its_distances(page)


@given(
    st.integers(2, 15),
    st.integers(2, 15),
    st.floats(8, 70),
    st.sampled_from(["A5", "A4", "Letter", "A3", "600x400mm"]),
    st.booleans(),
)
def test_pages_of_any_board(columns, rows, square, size, tags):
    board = checkerboard("a", columns, rows, square)
    if tags:
        board = in_millimetres(aprilgrid((columns, rows), spacing=0.3), "cm")
    sheet = Sheet(board=board)
    on = paper(size)
    pages = lay_out(sheet, on, margin=MARGIN)
    if pages[0].tile is None:
        (page,) = pages
        keeps_its_distances(page)
        assert page.quiet >= 0.4 * sheet.quiet
        return
    tiles = [page.tile for page in pages]
    assert [(t.row, t.column) for t in tiles] == [
        (r, c) for r in range(tiles[0].rows) for c in range(tiles[0].columns)
    ]
    parts = {(t.row, t.column): t.part for t in tiles}
    (left, top), (right, bottom) = sheet.face.lower, sheet.face.upper
    # What parts show around the print, and the paper's own white, are enough; no part is bare.
    first, last = parts[0, 0], tiles[-1].part
    assert 0 <= left - first.left <= sheet.quiet
    assert left + pages[0].shift[0] >= sheet.quiet - 1e-6
    assert top + pages[0].shift[1] >= sheet.quiet - 1e-6
    assert last.right + BAND + MARGIN - right >= sheet.quiet - 1e-6
    assert last.bottom + BAND - bottom >= sheet.quiet - 1e-6
    for page in pages:
        tile, window = page.tile, page.window
        on_page = window.moved(page.shift)
        assert on_page.left >= MARGIN
        assert on_page.top >= MARGIN
        assert on_page.right <= page.width - MARGIN - BAND + 1e-6
        assert on_page.bottom <= page.height - MARGIN - STRIP - BAND + 1e-6
        if tile.column < tile.columns - 1:
            right_one = parts[tile.row, tile.column + 1]
            assert right_one.left == tile.part.right
            assert window.right == pytest.approx(tile.part.right + OVERLAP)
        if tile.row < tile.rows - 1:
            assert parts[tile.row + 1, tile.column].top == tile.part.bottom
            assert window.bottom == pytest.approx(tile.part.bottom + OVERLAP)


def test_parts_end_in_the_middle_of_squares():
    pages = lay_out(Sheet(board=checkerboard("a", 9, 6, 40.0)), paper("A4"), margin=MARGIN)
    inner = {page.tile.part.left for page in pages if page.tile.column} | {
        page.tile.part.top for page in pages if page.tile.row
    }
    assert len(inner) >= 2
    assert all(end % 40 == pytest.approx(20) for end in inner)


def test_boards_of_a_target_by_name_and_in_its_unit():
    inches = Target(
        units="in",
        boards=(checkerboard("a", 5, 4, 1.0, origin=(2, 0, 0)), checkerboard("b", 4, 3, 1.0)),
    )
    one, other = sheets_of(inches)
    assert one.size == pytest.approx((6 * 25.4, 5 * 25.4))
    np.testing.assert_allclose(one.board.origin, (50.8, 0, 0))
    assert [sheet.board.name for sheet in sheets_of(inches, ("b",))] == ["b"]
    with pytest.raises(TargetError, match="no board 'c'"):
        sheets_of(inches, ("c",))
    assert other.quiet == 25.4
