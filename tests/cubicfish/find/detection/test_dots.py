"""Grids of dots are named as such, and counted; squares, text and tiles are none."""

import cv2
import numpy as np
import pytest
from synthetic import flat_board

from cubicfish.errors import DetectionError
from cubicfish.find.detection.diagnose import explain_no_grids
from cubicfish.find.detection.dots import count_dots
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.judge.codes import Code
from cubicfish.observe.detection import detect
from tests.cubicfish.find.detection.test_finder import drawn_board, seen, textures, without_a_board

SIZE = (640, 480)
FINE = 4  # drawn pixels in one of the photo


def dots(columns=9, rows=7, step=40, radius=10, *, between=False, light=False, blur=0.8, slant=0.0):
    """A photo of dots; in every other row they lie between those of the row above."""
    width, height = (FINE * side for side in SIZE)
    drawn = np.full((height, width), 200, np.float32)
    for row in range(rows):
        for column in range(columns):
            x = 120 + step * (column + (0.5 if between and row % 2 else 0.0))
            y = 80 + step * row * (0.5 if between else 1.0)
            middle = (round(x * FINE), round(y * FINE))
            cv2.circle(drawn, middle, radius * FINE, 30, -1)
    rim = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    nearer = [[0, 0], [width, height * slant], [width, height * (1 - slant)], [0, height]]
    turn = np.vstack([cv2.getRotationMatrix2D((width / 2, height / 2), 17, 1), [0, 0, 1]])
    view = turn @ cv2.getPerspectiveTransform(rim, np.float32(nearer))
    photo = cv2.warpPerspective(drawn, view, (width, height), borderValue=200)
    photo = cv2.GaussianBlur(photo, (0, 0), blur * FINE)
    photo = cv2.resize(photo, SIZE, interpolation=cv2.INTER_AREA)
    photo = 230 - photo if light else photo
    noise = np.random.default_rng(0).normal(0, 2.0, photo.shape)
    return np.clip(photo + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"light": True},
        {"between": True},
        {"columns": 4, "rows": 11, "step": 60, "between": True},
        {"slant": 0.25},
        {"blur": 4.0},
        {"columns": 5, "rows": 5},
    ],
)
def test_dots_are_counted(how):
    count = how.get("columns", 9) * how.get("rows", 7)
    assert 0.9 * count < count_dots(build_pyramid(dots(**how))) <= count


@pytest.mark.parametrize("how", [{}, {"light": True}, {"between": True}])
def test_dots_are_the_reason_why_there_is_no_checkerboard(how):
    photo = dots(**how)
    found = find_grids(photo)
    assert found.grids == ()
    reason = explain_no_grids(photo, found)
    assert reason.code == Code.DOTS
    assert 56 < reason.figures["dots"] <= 63


@pytest.mark.slow
def test_photos_that_show_about_the_same_say_it_once():
    """The two photos of dots outnumber an even one, though they show different counts."""
    pictures = [dots(), dots(columns=8), np.full((480, 640), 90, np.uint8)]
    with pytest.raises(DetectionError, match=r"^3 photos, no checkerboard: dots: .*count 63"):
        detect(pictures, flat_board())


OTHERS = {**textures(), **without_a_board(), "board": seen(drawn_board()[0])}
OTHERS |= {"board of small squares": seen(drawn_board(side=9)[0])}
OTHERS |= {
    f"board blurred by {blur} px": seen(cv2.GaussianBlur(drawn_board()[0], (0, 0), 5 * blur))
    for blur in (4, 7, 10)
}
OTHERS["dark squares apart"] = seen(drawn_board(gap=10)[0] * 1.1)


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_what_is_no_dot_is_not_counted(name):
    photo = np.clip(OTHERS[name], 0, 255).astype(np.uint8)
    assert (count_dots(build_pyramid(photo)) > 0) == (name == "dots")
