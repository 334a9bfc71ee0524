"""The scales of a photo: which are searched, where, and what a grid keeps of each."""

import itertools

import cv2
import numpy as np
import pytest

from cubicfish.find.detection import finder, ladder
from cubicfish.find.detection.corners import XCorners
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.ladder import Box, Ladder, join_boxes
from cubicfish.find.detection.links import find_patches
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.observe import photo_detection
from cubicfish.observe.photo_detection import GridCache, detect_in_photo
from cubicfish.photos.photos import Photo, PictureFile
from cubicfish.target.boards.types import Checkerboard
from cubicfish.target.target import Target

COLUMNS, ROWS = 9, 7
BOARD = Checkerboard(
    name="board",
    columns=COLUMNS,
    rows=ROWS,
    square=10.0,
    origin=np.zeros(3),
    x_axis=np.array([1.0, 0, 0]),
    y_axis=np.array([0, 1.0, 0]),
)
TARGET = Target(units="mm", boards=(BOARD,))
BOARDS = [(ROWS, COLUMNS)]  # the order is not known of a grid
_DRAWN = 40


def slanted(near, far, *, size=(320, 240), at=(62.3, 41.7), finer=4, blur=0.0, light=215):
    """A board whose squares are ``near`` px wide in its first row and ``far`` px in its last.

    It is drawn ``finer`` times as large first.

    Returns the photo and the pixels (N, 2) of its corners.
    """
    cells = np.indices((ROWS + 1, COLUMNS + 1)).sum(axis=0) % 2
    drawn = np.kron(np.where(cells, light, 40), np.ones((_DRAWN, _DRAWN)))
    drawn = np.pad(drawn, _DRAWN, constant_values=light).astype(np.uint8)
    corners = np.stack(np.meshgrid(range(1, COLUMNS + 1), range(1, ROWS + 1)), -1).reshape(-1, 2)
    corners = (corners + 1.0) * _DRAWN - 0.5
    height, width = drawn.shape
    wide, narrow, tall = near * (COLUMNS + 3), far * (COLUMNS + 3), 0.75 * (near + far) / 2 * 10
    to = np.array([(0, tall), (wide, tall), ((wide + narrow) / 2, 0), ((wide - narrow) / 2, 0)])
    to = to + np.array(at)
    source = np.array([(0, 0), (width, 0), (width, height), (0, height)]) - 0.5
    move = cv2.getPerspectiveTransform(source.astype(np.float32), to.astype(np.float32))
    larger = np.diag([finer, finer, 1.0]) @ move
    larger[:2] += (finer - 1) / 2 * larger[2]
    big = tuple(int(side) for side in np.array(size) * finer)
    photo = cv2.warpPerspective(drawn, larger, big, flags=cv2.INTER_AREA, borderValue=120)
    photo = cv2.resize(photo, None, fx=1 / finer, fy=1 / finer, interpolation=cv2.INTER_AREA)
    if blur:
        photo = cv2.GaussianBlur(photo, (0, 0), blur)
    noise = np.random.default_rng(0).normal(0, 1.5, photo.shape)
    pixel = cv2.perspectiveTransform(corners[None].astype(np.float64), move)[0]
    return np.clip(np.rint(photo + noise), 0, 255).astype(np.uint8), pixel


def away(pixel, truth):
    """How far each of some corners (N, 2) is from the nearest true one."""
    return np.linalg.norm(pixel[:, None] - truth[None], axis=-1).min(axis=1)


@pytest.fixture
def searched(monkeypatch):
    """The sizes of what is searched."""
    sizes, search = [], finder.search

    def noted(pyramid, *known):
        sizes.append(pyramid.size)
        return search(pyramid, *known)

    monkeypatch.setattr(finder, "search", noted)
    return sizes


def test_a_whole_board_is_searched_for_at_one_scale_and_refined_at_full_size(searched):
    photo, truth = slanted(60, 40, size=(1280, 960), at=(200.0, 150.0), finer=3)
    (grid,) = find_grids(photo, BOARDS).grids
    assert len(grid) == COLUMNS * ROWS
    ((width, height),) = searched
    assert width * height < 2 * ladder.COARSE_PIXELS < photo.size / 4
    assert np.sqrt(np.mean(away(grid.pixel, truth) ** 2)) < 0.04


def test_only_where_squares_are_small_is_more_searched(searched):
    large, first = slanted(60, 40, size=(1280, 960), at=(60.0, 60.0), finer=1)
    small, second = slanted(14, 13, size=(1280, 960), at=(1000.3, 700.6), finer=2)
    photo = np.where((np.arange(1280) > 980) & (np.arange(960) > 690)[:, None], small, large)
    found = find_grids(photo)
    assert [len(grid) for grid in found.grids] == [COLUMNS * ROWS] * 2
    assert away(found.grids[0].pixel, first).max() < 0.2
    assert away(found.grids[1].pixel, second).max() < 0.2
    assert len(searched) > 1
    # At finer scales a part of the photo alone.
    assert max(width for width, _ in searched) < 1280 // 2


@pytest.mark.parametrize("blur", [9.0, 14.0])
def test_a_blurred_board_is_found_and_refined_where_its_blur_lets(blur):
    photo, truth = slanted(120, 90, size=(1920, 1440), at=(200.0, 150.0), finer=1, blur=blur)
    (grid,) = find_grids(photo, BOARDS).grids
    assert len(grid) == COLUMNS * ROWS
    assert np.sqrt(np.mean(away(grid.pixel, truth) ** 2)) < 0.3


def test_the_rest_of_a_board_is_found_at_twice_the_size(monkeypatch):
    picture, truth = slanted(10, 4)
    (whole,) = find_grids(picture, BOARDS).grids
    assert len(whole) == COLUMNS * ROWS
    assert away(whole.pixel, truth).max() < 0.5
    assert np.sqrt(np.mean(away(whole.pixel, truth) ** 2)) < 0.15
    monkeypatch.setattr(Ladder, "is_possible", lambda self, zoom: zoom >= 1)
    (part,) = find_grids(picture, BOARDS).grids
    assert len(part) < COLUMNS * ROWS
    # What the photo shows at its own size stays as that says.
    same = (whole.pixel[:, None] == part.pixel[None]).all(axis=2).any(axis=1)
    assert same.sum() == len(part)


def test_a_board_of_tiny_squares_is_found_where_nothing_else_is():
    picture, truth = slanted(4.6, 4.2)
    (grid,) = find_grids(picture, BOARDS).grids
    assert len(grid) == COLUMNS * ROWS
    assert away(grid.pixel, truth).max() < 0.5


def test_twice_the_size_is_searched_only_where_pieces_of_squares_are(searched):
    picture, _ = slanted(4.6, 4.2, size=(500, 400))
    (grid,) = find_grids(picture, BOARDS).grids
    assert len(grid) == COLUMNS * ROWS
    width, height = searched[-1]
    assert 2 * 9 * 4.2 < width < 500
    assert 2 * 7 * 3.2 < height < 400
    searched.clear()
    noise = np.random.default_rng(0).normal(120, 1.5, picture.shape)
    assert find_grids(noise.astype(np.uint8), BOARDS).grids == ()
    assert max(searched) == (500, 400)


@pytest.mark.parametrize("near", [10, 4.2])
def test_a_completed_grid_is_remembered(tmp_path, monkeypatch, near):
    path = tmp_path / "photo.png"
    cv2.imwrite(str(path), slanted(near, 4)[0])
    shot = Photo(name="photo.png", path=path)
    cache = GridCache(folder=tmp_path / "cache")
    first = detect_in_photo(shot, target=TARGET, cache=cache)
    assert first.refusal is None
    assert first.grids is not None
    assert len(first.grids.grids[0]) == COLUMNS * ROWS
    monkeypatch.setattr(photo_detection, "find_grids", None)
    monkeypatch.setattr(PictureFile, "picture", None)
    again = detect_in_photo(shot, target=TARGET, cache=cache)
    assert again.grids is not None
    np.testing.assert_array_equal(again.grids.grids[0].pixel, first.grids.grids[0].pixel)


def test_the_ladder_goes_from_coarse_to_twice_the_size():
    photo = Ladder(image=np.zeros((960, 1280), np.uint8))
    zooms = photo.finer(photo.coarsest)
    assert photo.coarsest == 3
    assert zooms == [1, 0.5]
    assert photo.at(2).size == (640, 480)
    large = Ladder(image=np.broadcast_to(np.uint8(0), (9000, 12000)))
    zooms = [large.coarsest, *large.finer(large.coarsest)]
    assert zooms[-1] == large.finest == 3
    assert all(a / b <= 3 for a, b in itertools.pairwise(zooms))


def test_levels_are_made_when_they_are_looked_at():
    pyramid = build_pyramid(np.random.default_rng(0).integers(0, 255, (97, 130)).astype(np.uint8))
    assert [level.shape for level in pyramid.levels] == [(97, 130), (49, 65), (25, 33)]
    assert pyramid.levels[1] is pyramid.levels[1]
    assert pyramid.levels[1:][0] is pyramid.levels[1]
    with pytest.raises(IndexError):
        pyramid.levels[3]


def test_boxes_that_meet_are_joined():
    boxes = [
        Box.around(np.array([point], float), 5.0, (100, 200))
        for point in [(10, 10), (150, 50), (18, 10), (199, 99)]
    ]
    first, *others = sorted(join_boxes(boxes), key=lambda box: box.left)
    assert (first.left, first.top, first.right, first.bottom) == (5, 5, 24, 16)
    assert [(box.left, box.right) for box in others] == [(145, 156), (194, 200)]


def test_corners_that_point_at_none_have_no_links():
    """As in pictures with some crossings that are far from each other."""
    pyramid = build_pyramid(np.zeros((60, 60), np.uint8))
    corners = XCorners(
        pixel=np.array([(10.0, 10.0), (50.0, 10.0), (10.0, 50.0), (50.0, 50.0)]),
        angle=np.tile(np.arange(4) * np.pi / 2 + 0.8, (4, 1)),
        radius=np.full(4, 4.0),
        contrast=np.full(4, 100.0),
    )
    assert find_patches(pyramid, corners) == []


def test_pieces_are_squares_at_least():
    rng = np.random.default_rng(3)
    cells = np.kron(rng.random((40, 50)) < 0.5, np.ones((10, 10)))
    photo = cv2.GaussianBlur(np.where(cells, 220.0, 30.0), (0, 0), 0.8).astype(np.uint8)
    result = finder.search(build_pyramid(photo), 1.0)
    assert len(result.pieces) > 10
    assert min(len(piece) for piece in result.pieces) >= 4
    assert find_grids(photo).grids == ()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_small_board_beside_a_large_one_is_found(kind):
    large, _ = slanted(60, 40, size=(1280, 960), at=(60.0, 60.0), finer=1)
    small, truth = slanted(7, 7, size=(1280, 960), at=(1100.3, 800.6), finer=3)
    photo = np.where((np.arange(1280) > 1080) & (np.arange(960) > 790)[:, None], small, large)
    found = find_grids(photo.astype(kind) * kind(1 if kind is np.uint8 else 200), [*BOARDS * 2])
    assert [len(grid) for grid in found.grids] == [COLUMNS * ROWS] * 2
    assert away(found.grids[1].pixel, truth).max() < 0.3


def test_a_strip_longer_than_opencv_allows_at_twice_the_size_is_searched():
    photo = np.kron(np.indices((3, 1250)).sum(0) % 2, np.ones((17, 16))).astype(np.uint8) * 200
    assert find_grids(photo).image_size == (20_000, 51)
