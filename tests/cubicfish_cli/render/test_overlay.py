"""Drawings of what was found: which colour is where, and that every photo can be drawn."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cubicfish import Finding, Observations
from cubicfish.find import PhotoReport
from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.find.identification.identified import Decided, GridReport, Place
from cubicfish.judge import Code
from cubicfish_cli.render.overlay import BOARD_COLOURS, LEFT_OUT, _Canvas, draw_found
from cubicfish_cli.words.remarks import problem_of

STEP = 50.0
WIDTH, HEIGHT = 1000, 400
BLANK = np.full((HEIGHT, WIDTH), 90, np.uint8)
# Board "floor" shows all of its corners, "wänd" those from (2, 3) on; a third grid fits nowhere.
LEFT, TOP = (80.0, 400.0, 720.0), 120.0
CELLS = np.stack(np.mgrid[:5, :5], axis=-1).reshape(-1, 2)
EXTRA = [400.0 + 5 * STEP, TOP]  # a corner of "wänd" from the second pass


def pixels(left: float) -> np.ndarray:
    return CELLS * STEP + [left, TOP]


def fate(verdict: Decided, place: Place | None) -> GridReport:
    return GridReport(verdict=verdict, place=place, corners=25, size=(5, 5), rms_px=0.1)


@pytest.fixture
def report() -> PhotoReport:
    grids = [
        Grid(cells=CELLS, pixel=pixels(left), parity=1, step=STEP, contrast=np.ones(25))
        for left in LEFT
    ]
    return PhotoReport(
        name="a.png",
        corners=51,
        added=1,
        found=FoundGrids(grids=tuple(grids), refused=np.empty((0, 2)), image_size=(WIDTH, HEIGHT)),
        grids=(
            fate(Decided.NAMED, Place(board=0, turn=0, column=0, row=0)),
            fate(Decided.CONVENTION, Place(board=1, turn=0, column=2, row=3)),
            fate(Decided.NO_FIT, None),
        ),
    )


@pytest.fixture
def corners() -> Observations:
    named = np.concatenate([CELLS, CELLS + np.array([2, 3]), [[7, 3]]])
    return Observations(
        image_size=(WIDTH, HEIGHT),
        images=("a.png",),
        boards=("floor", "wänd"),
        image=np.zeros(51, np.intp),
        board=np.repeat([0, 1], [25, 26]),
        column=named[:, 0],
        row=named[:, 1],
        pixel=np.concatenate([pixels(LEFT[0]), pixels(LEFT[1]), [EXTRA]]),
        weight=np.ones(51),
    )


def near(drawn: np.ndarray, x: float, y: float, colour: tuple[int, int, int], by: int = 1) -> bool:
    """Whether a pixel has the colour, to a pixel or so and some blending."""
    part = drawn[round(y) - by : round(y) + by + 1, round(x) - by : round(x) + by + 1].astype(int)
    return bool((np.abs(part - colour).max(axis=-1) < 30).any())


def test_everything_has_its_colour_and_shape(report: PhotoReport, corners: Observations) -> None:
    drawn = draw_found(BLANK, report, corners)
    assert drawn.shape == (HEIGHT, WIDTH, 3)
    assert drawn.dtype == np.uint8
    for left, colour in zip(LEFT, (*BOARD_COLOURS[:2], LEFT_OUT), strict=True):
        # Along the last row, half-way between corners 3 and 4, and nowhere else in the square.
        assert near(drawn, left + 3.5 * STEP, TOP + 4 * STEP, colour)
        assert np.ptp(drawn[round(TOP + 3.5 * STEP), round(left + 3.3 * STEP)]) == 0
    # A named corner stays in view in the middle of its ring, a corner left out is crossed out.
    x, y = LEFT[0] + 3 * STEP, TOP + 4 * STEP
    assert not near(drawn, x, y, BOARD_COLOURS[0], by=0)
    assert near(drawn, x + 4, y, BOARD_COLOURS[0])
    assert near(drawn, LEFT[2] + 4 * STEP, y, LEFT_OUT, by=0)
    # What the second pass added has corners where a ring has none.
    radius = round(1.4 * 4)
    assert near(drawn, EXTRA[0] + radius, EXTRA[1] + radius, BOARD_COLOURS[1])
    ring = LEFT[1] + 4 * STEP + radius
    assert not near(drawn, ring, TOP + 4 * STEP + radius, BOARD_COLOURS[1], by=0)


def test_the_first_corner_and_the_axes_are_marked(
    report: PhotoReport, corners: Observations
) -> None:
    drawn = draw_found(BLANK, report, corners)
    # A filled disc at (0, 0), which the second board does not show.
    assert near(drawn, LEFT[0], TOP, BOARD_COLOURS[0], by=0)
    disc, other = (drawn[round(TOP) - 9 : round(TOP) + 10, round(x)] for x in LEFT[:2])
    assert (disc == 255).all(axis=-1).any()
    assert not (other == 255).all(axis=-1).any()
    # Thick stems to the next corners of the first row and the first column, thin lines elsewhere.
    for left, colour in zip(LEFT[:2], BOARD_COLOURS, strict=False):
        for across in ((0, 1), (1, 0)):
            along = np.array(across[::-1])
            stem = np.array([left, TOP]) + 0.5 * STEP * along + across
            assert near(drawn, *stem, colour, by=0)
            line = np.array([left, TOP]) + 3.5 * STEP * along + 4 * STEP * np.array(across)
            assert near(drawn, *line, colour, by=0)
            assert not near(drawn, *(line + 2 * np.array(across)), colour, by=0)


def written(monkeypatch: pytest.MonkeyPatch, *args: object) -> dict[str, list[np.ndarray]]:
    """The texts of a drawing and where they were to stand."""
    texts: dict[str, list[np.ndarray]] = {}
    write = _Canvas.write

    def spy(self: _Canvas, text: str, pixel: np.ndarray, colour: tuple[int, int, int]) -> None:
        texts.setdefault(text, []).append(pixel)
        write(self, text, pixel, colour)

    monkeypatch.setattr(_Canvas, "write", spy)
    draw_found(*args)  # type: ignore[arg-type]
    return texts


def test_texts_say_what_is_what(
    report: PhotoReport, corners: Observations, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = written(monkeypatch, BLANK, report, corners)
    caption = ("a.png", "51 corners", "floor 25", "wänd 26 (place by convention)")
    more = ("1 by a second look (squares)", "1 grid left out")
    assert {*caption, *more} <= set(texts)
    assert len(texts["x"]) == len(texts["y"]) == 2
    # The last corners say which they are, names and reasons stand within their grids.
    np.testing.assert_allclose(texts["x4 y4"], [[LEFT[0] + 4 * STEP, TOP + 4 * STEP]])
    plates = ("floor", "wänd", "left out: fits nowhere")
    for left, text in zip(LEFT, plates, strict=True):
        assert (np.abs(texts[text][0] - [left + 2 * STEP, TOP + 2 * STEP]) < STEP).all()


def test_a_photo_with_nothing_says_why(
    corners: Observations, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = PhotoReport(
        name="b.png",
        refusal=Finding(code=Code.TOO_DARK, images=("b.png",)),
        found=FoundGrids(grids=(), refused=np.empty((0, 2)), image_size=(WIDTH, HEIGHT)),
    )
    texts = written(monkeypatch, BLANK, report, corners)
    assert [*texts] == ["b.png", "0 corners", problem_of(report)]
    assert (draw_found(BLANK, report, corners)[80:] == 135).all()
    assert (draw_found(0 * BLANK, report, corners)[80:] == 0).all()


def test_dark_and_deep_photos_are_spread(report: PhotoReport, corners: Observations) -> None:
    squares = np.kron(np.indices((40, 100)).sum(axis=0) % 2, np.ones((10, 10)))
    nothing = replace(report, name="b.png", found=None, grids=())
    dark = draw_found((8 + 30 * squares).astype(np.uint8), nothing, corners)
    deep = draw_found((2000 + 9000 * squares).astype(np.uint16), nothing, corners)
    np.testing.assert_array_equal(dark[100:], deep[100:])
    assert set(np.unique(deep[100:])) == {0, 135}
    # Noise in the dark is not spread to look like a photo.
    faint = draw_found((2 + 2 * squares).astype(np.uint8), nothing, corners)
    assert faint[100:].max() < 50


@pytest.mark.parametrize("side", [1, 7, 40, 3000])
def test_small_and_large_photos_are_drawn(
    side: int, report: PhotoReport, corners: Observations
) -> None:
    scale = side / WIDTH
    assert report.found is not None
    grids = tuple(replace(grid, pixel=grid.pixel * scale) for grid in report.found.grids)
    scaled = replace(report, found=replace(report.found, grids=grids))
    named = replace(corners, pixel=corners.pixel * scale)
    drawn = draw_found(np.full((side, side), 30_000, np.uint16), scaled, named)
    assert drawn.shape == (side, side, 3)
    if side == 3000:
        # Three times as large, three times as thick.
        x, y = round(scale * (LEFT[0] + 3.5 * STEP)), round(scale * (TOP + 4 * STEP))
        line = (drawn[y - 10 : y + 10, x] == BOARD_COLOURS[0]).all(axis=-1)
        assert 3 <= line.sum() <= 6


def test_board_colours_stay_apart_for_all_eyes_and_from_the_photo() -> None:
    colours = np.array([(*BOARD_COLOURS, LEFT_OUT)], np.uint8)
    # Without the difference of red and green, as most colour-blind people see.
    lab = cv2.cvtColor(colours.astype(np.float32) / 255, cv2.COLOR_BGR2LAB)[0, :, ::2]
    for number, one in enumerate(lab):
        assert one[0] > 50  # lighter than all but the brightest squares
        assert all(np.linalg.norm(one - other) > 10 for other in lab[:number])
