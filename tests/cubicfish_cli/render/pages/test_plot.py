"""Plots as SVG: marks are where their figures say, and nothing that is drawn breaks the drawing."""

import re
from base64 import b64decode
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish_cli.render.pages.plot import (
    WIDTH,
    Plot,
    Space,
    colour_bar,
    colours,
    document,
    nice_step,
    nice_ticks,
    picture_plot,
    wide_plot,
)

SVG = "{http://www.w3.org/2000/svg}"
HEAD = "data:image/svg+xml;base64,"


def parsed(*plots: Plot) -> ElementTree.Element:
    image = document(plots)
    assert image.startswith(HEAD)
    return ElementTree.fromstring(b64decode(image[len(HEAD) :]))


def places(line: str) -> np.ndarray:
    """The places (N, 2) that a path goes through."""
    found = re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", line)
    return np.array([[float(x), float(y)] for x, y in found])


def paths(root: ElementTree.Element, colour: str) -> list[np.ndarray]:
    every = root.iter(f"{SVG}path")
    return [places(one.get("d", "")) for one in every if one.get("stroke") == colour]


def written(root: ElementTree.Element) -> dict[str, np.ndarray]:
    texts = root.iter(f"{SVG}text")
    return {
        one.text or "": np.array([float(one.get("x", "")), float(one.get("y", ""))])
        for one in texts
    }


def test_a_mark_stands_between_the_figures_of_the_axes() -> None:
    plot = wide_plot((0, 10), (-1, 1), 200, ("degrees", "px"))
    plot.dots([[4, 0.5], [8, -0.5]], "#123456", 2)
    root = parsed(plot)
    (at,) = paths(root, "#123456")
    names = written(root)
    assert {"degrees", "px", "0", "10", "−1.0", "1.0"} <= names.keys()
    ends = names["0"][0], names["10"][0]
    np.testing.assert_allclose(at[:, 0], np.interp([4, 8], [0, 10], ends), atol=0.11)
    sides = names["−1.0"][1], names["1.0"][1]
    level = np.interp([0.5, -0.5], [-1, 1], sides)
    np.testing.assert_allclose(at[:, 1] + 3.5, level, atol=0.2)  # letters stand on their line


def test_a_photo_keeps_its_shape_whatever_it_is() -> None:
    for size in ((1280, 800), (600, 3000), (1, 1)):
        plot = picture_plot(size)
        assert plot.width / plot.height == pytest.approx(size[0] / size[1])
        assert plot.left + plot.width <= WIDTH
        top, bottom = plot.place([[0, 0], [0, size[1]]])
        assert top[1] < bottom[1]


@given(
    points=st.lists(
        st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 2), min_size=1, max_size=9
    )
)
def test_no_place_breaks_the_drawing(points: list[tuple[float, float]]) -> None:
    plot = picture_plot((64, 48))
    plot.dots(points, "#123456", 2)
    plot.lines([points], "#654321")
    plot.area(points, "#abcdef")
    for at in (*paths(parsed(plot), "#123456"), *paths(parsed(plot), "#654321")):
        assert np.abs(at).max() <= 1e4


def test_a_picture_lies_the_way_its_axes_go_and_nothing_shows_through_unknown_cells() -> None:
    value = np.array([[0.0, 1.0, np.nan], [0.5, 0.5, 0.5]])
    shades = colours(value)
    assert shades[..., 3].tolist() == [[1, 1, 0], [1, 1, 1]]
    assert shades[0, 0, :3].sum() < shades[1, 0, :3].sum() < shades[0, 1, :3].sum()
    plot = picture_plot((3, 2))
    plot.image(shades, (-0.5, 1.5), (2.5, -0.5))
    (image,) = parsed(plot).iter(f"{SVG}image")
    data = b64decode(image.get("href", "").partition(",")[2])
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., [2, 1, 0, 3]], np.rint(255 * shades))
    box = [float(image.get(name, "")) for name in ("x", "y", "width", "height")]
    np.testing.assert_allclose(box, [plot.left, plot.top, plot.width, plot.height], atol=0.01)


def test_a_colour_bar_stands_below_and_says_where_there_is_more() -> None:
    plot = picture_plot((40, 30))
    bars = [colour_bar(plot, (0, 0.2), "px", beyond=beyond) for beyond in (False, True)]
    assert bars[0].top > plot.top + plot.height
    plain, pointed = (parsed(plot, bar) for bar in bars)
    assert {"0.00", "0.20", "px"} <= written(plain).keys()
    count = [len(list(root.iter(f"{SVG}path"))) for root in (plain, pointed)]
    assert count[1] == count[0] + 1


@given(
    begin=st.floats(-50, 50),
    span=st.floats(1e-6, 1e6),
    most=st.integers(2, 12),
)
def test_ticks_are_round_and_within(begin: float, span: float, most: int) -> None:
    low = begin * span
    ticks = nice_ticks(low, low + span, most)
    step = nice_step(span / most)
    assert len(ticks) <= most + 1
    assert span / most <= step * (1 + 1e-6) < 2.6 * span / most
    for value, name in ticks:
        assert low - 1e-5 * step <= value <= low + span + 1e-5 * step
        assert float(name.replace("−", "-")) == pytest.approx(value, abs=1e-6 * step)
        assert abs(value / step - round(value / step)) < 1e-5


@pytest.mark.parametrize("ends", [(1.0, 1.0), (0.0, float("nan")), (0.0, float("inf"))])
def test_axes_of_nothing_have_no_ticks(ends: tuple[float, float]) -> None:
    assert nice_ticks(*ends, 5) == []


CUBE = np.stack(np.meshgrid([0, 4], [0, 2], [0, 1]), axis=-1).reshape(-1, 3).astype(float)


def test_space_is_seen_from_the_side_that_is_asked_for() -> None:
    above = Space(CUBE, 89.9, -90)
    origin, along, back, up = above.place([[0, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1]])
    np.testing.assert_allclose(along - origin, 2 * (origin - back)[::-1], atol=0.1)
    assert along[0] > origin[0]
    assert back[1] < origin[1]
    np.testing.assert_allclose(up, origin, atol=0.3)
    aside = Space(CUBE, 25, -50)
    origin, up = aside.place([[0, 0, 0], [0, 0, 1]])
    assert up[1] < origin[1]
    assert up[0] == pytest.approx(origin[0])
    assert aside.depth(CUBE[CUBE[:, 1] == 0]) > aside.depth(CUBE[CUBE[:, 1] == 2])


@pytest.mark.parametrize("elevation", [25, 89.9])
@pytest.mark.parametrize("points", [CUBE, CUBE[:1], 1e9 + 1e6 * CUBE, 1e-6 * CUBE])
def test_a_box_in_space_is_within_the_drawing(points: np.ndarray, elevation: float) -> None:
    space = Space(points, elevation, -50)
    root = parsed(space)
    height = float(root.get("height", ""))
    at = np.concatenate([*written(root).values()]).reshape(-1, 2)
    at = np.concatenate([at, space.place(points)])
    assert (at > 0).all()
    assert (at < [WIDTH, height + 1]).all()
