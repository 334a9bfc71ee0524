"""Pictures of a film: what those next to one show spares looking, and is never relied upon."""

from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from synthetic import checkerboard

from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.identification import quick_detect as module
from cubicfish.find.identification.quick_detect import quick_detect, quick_detect_near
from cubicfish.target.boards.markers import MARKER_DICTIONARIES, Markers, modules_along
from cubicfish.target.boards.types import BOARD_TYPES
from cubicfish.target.target import Target

SIZE = (1280, 960)
PLAIN = Target(units="mm", boards=(checkerboard("board", 7, 5, 40.0),))
SQUARE = 40  # texels


def marked() -> Target:
    """One ChArUco board of 7x5 corners."""
    board = BOARD_TYPES["charuco"](
        name="board",
        columns=7,
        rows=5,
        square=40.0,
        origin=np.zeros(3),
        x_axis=np.array([1.0, 0.0, 0.0]),
        y_axis=np.array([0.0, 1.0, 0.0]),
        markers=Markers(dictionary="DICT_4X4_50", side=30.0, first=0, count=24),
    )
    return Target(units="mm", boards=(board,))


MARKED = marked()


def face(target: Target) -> np.ndarray:
    """The print of the target's board, with a white margin of a square."""
    if target.has_markers:
        words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        board = cv2.aruco.CharucoBoard((8, 6), 40.0, 30.0, words)
        return board.generateImage((10 * SQUARE, 8 * SQUARE), marginSize=SQUARE)
    squares = np.indices((6, 8)).sum(axis=0) % 2 * 255
    return np.pad(np.kron(squares, np.ones((SQUARE, SQUARE))), SQUARE, constant_values=255)


def picture(
    target: Target, *places: tuple[float, float, float], blur_px: int = 0
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Boards before a wall: at x, y, with squares of so many pixels; and each one's corners."""
    random = np.random.default_rng(5)
    grey = 90 + 8 * cv2.GaussianBlur(random.normal(0, 9, SIZE[::-1]), (0, 0), 9)
    truth = []
    for x, y, side in places:
        zoom = side / SQUARE
        turned = zoom * np.array([[0.97, -0.2], [0.22, 0.9]])
        way = np.vstack([np.column_stack([turned, [x, y]]), [6e-5, 3e-5, 1]])
        board = face(target).astype(np.float32)
        if zoom < 1:
            board = cv2.GaussianBlur(board, (0, 0), 0.45 / zoom)
        shown = cv2.warpPerspective(np.dstack([board, np.ones_like(board)]), way, SIZE)
        grey = grey * (1 - shown[..., 1]) + (40 + 0.65 * shown[..., 0]) * shown[..., 1]
        column, row = (part.ravel() for part in np.meshgrid(np.arange(7), np.arange(5)))
        corners = SQUARE * (np.column_stack([column, row]) + 2.0) - 0.5
        truth.append(cv2.perspectiveTransform(corners[None], way)[0])
    if blur_px:
        streak = np.full((1, blur_px), 1 / blur_px)
        grey = cv2.filter2D(grey, -1, streak, borderType=cv2.BORDER_REFLECT)
    grey = cv2.GaussianBlur(grey, (0, 0), 0.6) + random.normal(0, 1.5, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8), truth


def pixels(found) -> np.ndarray:
    if isinstance(found, FoundGrids):
        return np.concatenate([np.zeros((0, 2)), *(grid.pixel for grid in found.grids)])
    return found.pixel


def assert_found(found, truth: Sequence[np.ndarray], share: float = 0.9) -> None:
    """Nearly all corners, each once and where it is."""
    seen, true = pixels(found), np.concatenate(truth)
    apart = np.linalg.norm(seen[:, None] - true, axis=-1)
    assert share * len(true) <= len(seen) == len(set(apart.argmin(axis=1).tolist()))
    assert np.median(apart.min(axis=1)) < 0.3
    assert np.quantile(apart.min(axis=1), 0.9) < 1


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pixels of every picture that is searched, as reduced."""
    done: list[float] = []
    search = module._detect

    def counted(image, target, zoom):
        done.append(image.size / zoom**2)
        return search(image, target, zoom)

    monkeypatch.setattr(module, "_detect", counted)
    return done


@pytest.mark.slow
@pytest.mark.parametrize("target", [PLAIN, MARKED], ids=["plain", "marked"])
def test_a_board_is_found_with_less_work_wherever_it_is(target, work) -> None:
    near = []
    for x, y, side in ((200, 120, 40), (240, 140, 42), (300, 150, 44), (760, 420, 40)):
        photo, truth = picture(target, (x, y, side))
        whole = quick_detect(photo, target)
        assert_found(whole, truth)
        work.clear()
        found = quick_detect_near(photo, target, near[-2:])
        assert sum(work) < 0.6 * photo.size / module._choose_zoom(photo, target) ** 2
        assert_found(found, truth)
        errors = [
            np.linalg.norm(pixels(one)[:, None] - truth[0], axis=-1).min(axis=1)
            for one in (whole, found)
        ]
        assert np.median(errors[1]) < 1.3 * np.median(errors[0])
        near.append(found)


@pytest.mark.slow
@pytest.mark.parametrize("target", [PLAIN, MARKED], ids=["plain", "marked"])
def test_small_squares_are_found_where_the_next_picture_shows_some(target, work) -> None:
    side = {False: 17, True: 19}[target.has_markers]
    photo, truth = picture(target, (300, 300, side))
    assert_found(quick_detect(photo, target), truth, 0.7)
    assert len(pixels(quick_detect_near(photo, target))) < 5
    before, after = (
        quick_detect(picture(target, at)[0], target)
        for at in ((270, 280, side + 2), (335, 325, side + 2))
    )
    for near in ([before], [before, after]):
        work.clear()
        assert_found(quick_detect_near(photo, target, near), truth, 0.7)
        assert sum(work) < 0.8 * photo.size / module._choose_zoom(photo, target) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("target", [PLAIN, MARKED], ids=["plain", "marked"])
def test_nothing_depends_on_the_pictures_before(target) -> None:
    shown = quick_detect(picture(target, (200, 120, 40))[0], target)
    empty = quick_detect(picture(target)[0], target)
    assert len(pixels(empty)) == 0
    photo, truth = picture(target, (700, 430, 36))
    for near in ([], [empty], [shown], [empty, shown], [shown, shown]):
        assert_found(quick_detect_near(photo, target, near), truth)
        assert len(pixels(quick_detect_near(picture(target)[0], target, near))) == 0
    streaked, _ = picture(target, (700, 430, 36), blur_px=61)
    assert len(pixels(quick_detect_near(streaked, target, [shown]))) == 0


def test_a_second_board_that_comes_in_is_found() -> None:
    first, second = (80, 60, 36), (720, 500, 40)
    before = quick_detect(picture(PLAIN, first)[0], PLAIN)
    photo, truth = picture(PLAIN, first, second)
    assert_found(quick_detect_near(photo, PLAIN, [before, before]), truth)
    assert_found(quick_detect_near(photo, None, [before, before]), truth)


def test_a_board_within_the_place_of_another_is_found_once() -> None:
    photo, truth = picture(PLAIN, (150, 110, 40))
    near = [quick_detect(picture(PLAIN, (x, 330, 40))[0], PLAIN) for x in (430, 660)]
    assert_found(quick_detect_near(photo, PLAIN, near), truth)


@pytest.mark.slow
@pytest.mark.parametrize("target", [PLAIN, MARKED], ids=["plain", "marked"])
def test_boards_are_expected_between_and_beyond_their_places(target) -> None:
    side = {False: 17, True: 19}[target.has_markers]
    for places in ((100, 500, 300), (100, 300, 500)):
        photos = [picture(target, (x, 400, side)) for x in places]
        near = [quick_detect(photo, target) for photo, _ in photos[:2]]
        photo, truth = photos[2]
        assert len(pixels(quick_detect_near(photo, target, near[:1]))) == 0
        assert_found(quick_detect_near(photo, target, near), truth, 0.7)


def test_modules_are_as_many_as_dictionaries_have() -> None:
    for name in MARKER_DICTIONARIES:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        assert modules_along(name) == dictionary.markerSize, name
