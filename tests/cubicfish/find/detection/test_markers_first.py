"""Markers are looked for first: squares only where markers or dark squares are, and closer last."""

from pathlib import Path

import numpy as np
import pytest
from looking import look_at

from cubicfish.find.detection import markers, markers_lattice
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.markers import find_marked_corners
from cubicfish.find.detection.markers_detect import families, reading_zooms
from cubicfish.find.detection.markers_lattice import BoardLattice
from cubicfish.find.detection.markers_missing import OpenEnds, Part, hidden, hidden_around
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.observe import photo_detection
from cubicfish.photos.photos import Photo
from cubicfish.target.boards.types import AprilGrid
from cubicfish.target.target import Target
from tests.cubicfish.find.detection.test_markers import (
    MIXED,
    SIZE,
    errors,
    mixed_photo,
    photo_of,
    true_grid,
    wall,
)
from tests.cubicfish.find.detection.test_markers_together import soft

ONLY_MARKED = Target(units="mm", boards=MIXED.boards[:3])


def names(found):
    return set(zip(found.board.tolist(), found.column.tolist(), found.row.tolist(), strict=True))


@pytest.fixture
def searched(monkeypatch):
    """The sizes of what is searched for grids."""
    sizes = []

    def search(image, *boards):
        sizes.append(image.size)
        return find_grids(image, *boards)

    for module in (photo_detection, markers):
        monkeypatch.setattr(module, "find_grids", search)
    return sizes


def detected(photo, target):
    one = Photo(name="p", path=Path("p"), picture=photo)
    return photo_detection.detect_in_photo(one, target=target, cache=None)


@pytest.mark.slow
def test_a_photo_is_not_searched_for_squares_whose_boards_markers_name(searched):
    board = Target(units="mm", boards=MIXED.boards[:1])
    photo = photo_of(board)
    found = detected(photo, board)
    assert len(found.marked) == 30
    assert not searched
    assert not found.grids.searched
    # A board without markers may be anywhere.
    both = Target(units="mm", boards=(*MIXED.boards[:1], MIXED.boards[3]))
    assert detected(photo, both).grids.searched
    assert searched == [photo.size]


@pytest.mark.slow
def test_squares_that_no_found_board_explains_are_searched_alone(searched):
    photo = soft(photo_of(ONLY_MARKED, noise=0), 1.8)
    found = find_marked_corners(photo, ONLY_MARKED)
    error, _ = errors(found, ONLY_MARKED)
    assert error.max() < 0.5
    assert (found.board == 0).sum() == 30
    assert len(searched) == 1
    assert searched[0] < 0.7 * photo.size


@pytest.mark.slow
def test_a_photo_without_markers_is_searched_for_squares_as_a_whole(searched):
    plain = Target(units="mm", boards=(wall("front", "checkerboard", (6, 5), 24.0),))
    photo = photo_of(plain)
    found = detected(photo, ONLY_MARKED)
    assert found.refusal is not None
    assert found.refusal.code.value == "no_markers"
    assert [len(grid) for grid in found.grids.grids] == [30]
    assert searched[0] == photo.size


@pytest.mark.slow
def test_no_corner_of_a_dim_photo_is_lost_for_want_of_grids(monkeypatch):
    photo = photo_of(ONLY_MARKED, exposure=0.25)
    with_grids = find_marked_corners(photo, ONLY_MARKED, find_grids(photo))
    alone = find_marked_corners(photo, ONLY_MARKED)
    assert names(alone) >= names(with_grids)
    assert errors(alone, ONLY_MARKED)[0].max() < 0.7
    # Towards the rim predictions miss by pixels: only X-corners near them lead on.
    monkeypatch.setattr(markers_lattice, "_try_corners_near", lambda *_: False)
    assert len(find_marked_corners(photo, ONLY_MARKED)) < len(alone)


@pytest.mark.slow
def test_a_small_board_found_in_part_is_looked_at_closely(monkeypatch):
    # Tags whose frames are one module wide, of 2 px, seen aslant.
    monkeypatch.setattr(AprilGrid, "marker_borders", (1, 2))
    boards = wall("front", "aprilgrid", (8, 7), 10.0), wall("left", "charuco", (5, 5), 26.0)
    tags = Target(units="mm", boards=boards)
    pose = look_at([-20, 15, -20], [60, 10, 60], up=[0.05, -1, 0.1], roll=1.1)
    photo = photo_of(tags, pose, supersample=3)
    close = find_marked_corners(photo, tags)
    error, _ = errors(close, tags, pose)
    assert error.max() < 0.5
    monkeypatch.setattr(markers, "small_boards", lambda *_: [])
    assert len(find_marked_corners(photo, tags)) < len(close)


def test_a_part_of_a_photo():
    size = (60, 40)
    part = Part.around(np.array([[10.0, 8.0], [30.0, 20.0]]), np.array([4.0, 5.0]), size)
    assert (part.columns, part.rows) == (slice(6, 36), slice(4, 26))
    image = np.arange(40 * 60).reshape(40, 60)
    assert part.of(image)[0, 0] == image[4, 6]
    assert part.pixels == part.of(image).size
    np.testing.assert_array_equal(part.back(np.zeros((1, 2))), [[6, 4]])
    edge = Part.around(np.array([[1.0, 39.0]]), np.array([5.0]), size)
    assert (edge.columns, edge.rows) == (slice(0, 7), slice(34, 40))
    both = Part.joined([part, edge])
    assert (both.columns, both.rows) == (slice(0, 36), slice(4, 40))
    assert Part.whole(size).of(image).shape == image.shape


def test_photos_are_read_small_first_and_doubled_last():
    squares, tags = families(Target(units="mm", boards=MIXED.boards[:1])), families(MIXED)
    assert reading_zooms((800, 800), squares) == [1, 0.5]
    assert reading_zooms((4000, 3000), squares) == [4, 2, 1]
    assert reading_zooms((800, 800), tags) == [1, 2, 0.5]
    assert reading_zooms((300, 150), tags) == [1, 0.5]


@pytest.mark.slow
def test_a_board_ends_where_nothing_shows():
    board = MIXED.boards[0]
    _, grid = true_grid(board)
    lattice = BoardLattice(board=board)
    lattice.put(grid.cells, grid.pixel)
    photo = mixed_photo()
    assert len(OpenEnds.of(build_pyramid(photo), lattice)) == 0  # all is known
    last = np.argwhere(lattice.known)
    last = last[last[:, 0] == 5]
    hidden_at = lattice.at(last)
    lattice.drop(last)
    ends = OpenEnds.of(build_pyramid(photo), lattice)
    assert len(ends) == len(last)
    assert np.linalg.norm(ends.pixel - hidden_at, axis=1).max() < 0.3 * ends.side.min()
    part = ends.part(SIZE)
    x, y = hidden_at.T
    assert part.columns.start < x.min() < x.max() < part.columns.stop
    assert part.rows.start < y.min() < y.max() < part.rows.stop
    # In the dark beyond a lens's circle there is nothing to look for.
    dark = photo.copy()
    for px, py in hidden_at.astype(int):
        dark[py - 25 : py + 26, px - 25 : px + 26] = 8
    assert len(OpenEnds.of(build_pyramid(dark), lattice)) == 0


@pytest.mark.slow
def test_known_squares_are_hidden_and_nothing_else():
    board = MIXED.boards[0]
    _, grid = true_grid(board)
    lattice = BoardLattice(board=board)
    lattice.put(grid.cells, grid.pixel)
    photo = build_pyramid(mixed_photo()).levels[0]
    middle = grid.pixel.mean(axis=0).astype(int)
    inner = (slice(middle[1] - 20, middle[1] + 21), slice(middle[0] - 20, middle[0] + 21))
    for hide in (hidden, hidden_around):
        painted = hide(photo, [lattice])
        assert np.ptp(photo[inner]) > 50
        assert np.ptp(painted[inner]) == 0
        assert (painted == photo).mean() > 0.7
    changed = [(hide(photo, [lattice]) != photo).sum() for hide in (hidden, hidden_around)]
    assert changed[1] > 1.3 * changed[0]
    np.testing.assert_array_equal(hidden(photo, [BoardLattice(board=board)]), photo)
