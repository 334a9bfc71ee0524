"""The end of a board's pattern, in pictures that are drawn square by square."""

import cv2
import numpy as np
import pytest

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.diagnosis.fewer_corners import _Sight, pattern_end
from cubicfish_cli.identification.ends import Ends
from cubicfish_cli.identification.identified import Place
from cubicfish_cli.lenses.radial import RadialCamera

SIDE, FIRST = 20, 60  # pixels per square, and the first corner's place
# So narrow a field that a plane before it is its own picture.
CAMERA = RadialCamera(image_size=(320, 240), fx=1e5, fy=1e5, cx=0.0, cy=0.0, k=(0, 0, 0, 0))
FORM = np.array([[SIDE, 0, FIRST], [0, SIDE, FIRST], [0, 0, 1e5]])
COLUMNS, ROWS = 6, 4


def board(paper: int = 220, width: float = 1.0) -> np.ndarray:
    """A board of 6x4 corners on paper; its last column of squares so wide."""
    picture = np.full((240, 320), paper, np.uint8)
    squares = np.add(*np.indices((ROWS + 1, COLUMNS + 1))) % 2 * 190 + 30
    drawn = np.kron(squares, np.ones((SIDE, SIDE), np.uint8))
    drawn = drawn[:, : round((COLUMNS + width) * SIDE)]
    first = FIRST - SIDE
    picture[first : first + drawn.shape[0], first : first + drawn.shape[1]] = drawn
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


def grid(columns: int = COLUMNS, rows: int = ROWS) -> Grid:
    cells = np.stack([part.ravel() for part in np.indices((columns, rows))], axis=-1)
    return Grid(
        cells=cells,
        pixel=FIRST + SIDE * cells.astype(float),
        parity=1,
        step=float(SIDE),
        contrast=np.full(len(cells), 190.0),
    )


def ends(picture, one=None, axis=0, after=True, in_view=False):
    one = one or grid()
    return pattern_end(picture, CAMERA, FORM, one, axis, after=after, in_view=in_view)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("after", [False, True])
def test_whole_squares_end_a_square_beyond_the_last_corners(axis, after):
    # Corners lie between pixels: half a pixel of 20.
    assert ends(board(), axis=axis, after=after) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("width", [0.4, 0.7])
def test_cut_squares_end_where_they_are_cut(width):
    assert ends(board(width=width)) == pytest.approx(width, abs=0.05)


def test_squares_that_go_on_are_no_end():
    assert ends(board(), grid(columns=COLUMNS - 1)) == np.inf
    assert ends(board(), grid(rows=ROWS - 1), axis=1) == np.inf


def test_darkness_beyond_may_be_the_lens_s_rim():
    assert ends(board(paper=5)) is None
    assert ends(board(paper=5), in_view=True) == pytest.approx(1, abs=0.05)


def test_nothing_is_told_where_the_last_squares_are_covered():
    covered = board()
    covered[:, FIRST + SIDE * (COLUMNS - 1) + 1 :] = 128
    assert ends(covered, in_view=True) is None


def test_nothing_is_told_where_the_picture_ends():
    assert ends(board()[:, : FIRST + SIDE * COLUMNS + 2], in_view=True) is None


def test_nothing_is_told_of_tiny_squares():
    small = cv2.resize(board(), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    form = FORM * [[0.25, 0.25, 0.25], [0.25, 0.25, 0.25], [1, 1, 1]]
    assert pattern_end(small, CAMERA, form, grid(), 0, after=True, in_view=True) is None


@pytest.mark.parametrize(("missing", "ended"), [(3, True), (2, False)])
def test_an_end_is_in_view_where_most_of_the_next_line_is_missing(missing, ended):
    table = np.zeros((3, 3, 3, 3), np.intp)
    table[0, 1, 0, 0] = missing  # with room for one more line after the last i: of 4 corners
    sight = _Sight(
        photo=0,
        grid=grid(),
        form=FORM,
        place=Place(board=0, turn=1, column=ROWS - 1, row=0),
        ends=Ends(table=table, last=np.array([COLUMNS - 1, ROWS - 1])),
    )
    assert sight.ended(0, after=True) == ended
    others = ((0, False), (1, True), (1, False))
    assert not any(sight.ended(axis, after=after) for axis, after in others)


def test_a_grid_that_lies_turned_spans_its_board_the_other_way():
    sight = _Sight(
        photo=0,
        grid=grid(),
        form=FORM,
        place=Place(board=0, turn=1, column=ROWS - 1, row=0),
        ends=Ends(table=np.zeros((3, 3, 3, 3), np.intp), last=np.array([COLUMNS - 1, ROWS - 1])),
    )
    np.testing.assert_array_equal(sight.span, [[0, ROWS - 1], [0, COLUMNS - 1]])
    assert sight.size == (ROWS, COLUMNS)
