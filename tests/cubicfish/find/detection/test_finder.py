"""Grids in rendered photos of known truth, and none in what is not a checkerboard."""

from functools import cache

import cv2
import numpy as np
import pytest
from looking import look_at
from synthetic import box_of_four, lens_of_size

from cubicfish.find.detection import ladder, search
from cubicfish.find.detection.accept import is_large_enough
from cubicfish.find.detection.diagnose import explain_no_grids
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.growth import measure_contrast
from cubicfish.find.detection.lattice import Lattice
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.judge.codes import Code
from cubicfish.scene.photos import render
from cubicfish.scene.truth import project_corners
from cubicfish.target.target import Target

POSE = look_at((330, 420, 300), (250, 150, 120), roll=0.5)


def photo(scale, *, noise=2.0, blur=0.5, supersample=3):
    target, lens = box_of_four(), lens_of_size(scale)
    arguments = (target, lens.unproject, POSE, lens.image_size)
    image = render(*arguments, noise=noise, blur=blur, supersample=supersample)
    return image, project_corners(target, lens, POSE, lens.image_size)


@pytest.fixture(scope="module")
def box():
    return photo(0.6)


def matched(found, truth):
    """For each grid: its truth's rows; every corner must be one of the truth."""
    seen = np.isfinite(truth.pixel).all(1)
    rows = np.nonzero(seen)[0]
    result = []
    for grid in found.grids:
        distance = np.hypot(*(grid.pixel[:, None] - truth.pixel[rows][None]).transpose(2, 0, 1))
        # As the benchmarks count: at the dim rim, noise moves one in a thousand by nearly as much.
        assert distance.min(1).max() < 1.0
        result.append(rows[distance.argmin(1)])
    return result


def assert_one_board_each(found, truth):
    boards = []
    for grid, rows in zip(found.grids, matched(found, truth), strict=True):
        assert len(np.unique(rows)) == len(rows)
        board = np.unique(truth.board[rows])
        assert len(board) == 1
        boards.append(int(board[0]))
        # (i, j) -> (column, row) is a quarter turn and an offset, never a reflection.
        place = np.stack([truth.column[rows], truth.row[rows]], -1)
        equations = np.column_stack([grid.cells, np.ones(len(grid))])
        solution, *_ = np.linalg.lstsq(equations, place, rcond=None)
        assert np.allclose(solution, np.rint(solution), atol=1e-6)
        assert np.allclose(equations @ solution, place, atol=1e-6)
        assert np.linalg.det(solution[:2]) == pytest.approx(1.0)
        # The square up-left of corner (0, 0) is dark, so the one down-right of it is too, and a
        # square (c, r)..(c + 1, r + 1) is dark where c + r is even.
        centre = solution[2] + [0.5, 0.5] @ solution[:2]
        dark = np.floor(centre).sum() % 2 == 0
        assert grid.parity == (-1 if dark else 1)
        assert (grid.cells.min(0) == 0).all()
    assert len(set(boards)) == len(boards)
    return boards


def recall(found, truth):
    visible = np.nonzero(truth.visible)[0]
    rows = np.concatenate(matched(found, truth))
    return np.isin(visible, rows).mean()


def errors(found, truth):
    return np.concatenate(
        [
            g.pixel - truth.pixel[rows]
            for g, rows in zip(found.grids, matched(found, truth), strict=True)
        ]
    )


@pytest.mark.slow
def test_every_board_is_one_grid_with_all_its_visible_corners(box):
    image, truth = box
    found = find_grids(image)
    boards = assert_one_board_each(found, truth)
    counts = np.bincount(truth.board[truth.visible], minlength=4)
    assert set(boards) >= set(np.nonzero(counts >= 12)[0])
    assert recall(found, truth) > 0.985
    error = errors(found, truth)
    assert np.sqrt((error**2).mean()) < 0.03
    assert np.hypot(*error.mean(0)) < 0.005
    grid = found.grids[0]
    column = grid.pixel[grid.cells[:, 0] == 3]
    assert grid.step == pytest.approx(np.median(np.hypot(*np.diff(column, axis=0).T)), rel=0.4)


@pytest.mark.slow
def test_without_noise_positions_have_no_bias():
    image, truth = photo(0.6, noise=0.0, supersample=5)
    error = errors(find_grids(image), truth)
    assert np.hypot(*error.mean(0)) < 0.003
    assert np.median(np.hypot(*error.T)) < 0.015


@pytest.mark.slow
def test_squares_of_six_pixels_are_found():
    image, truth = photo(0.36)
    found = find_grids(image)
    assert_one_board_each(found, truth)
    shortest = np.median([g.step for g in found.grids])
    assert shortest < 16
    assert recall(found, truth) > 0.95


@pytest.mark.slow
def test_a_blurred_and_noisy_photo_keeps_its_boards_whole():
    image, truth = photo(0.6, noise=6.0, blur=1.2)
    found = find_grids(image)
    assert_one_board_each(found, truth)
    assert recall(found, truth) > 0.93
    assert np.sqrt((errors(found, truth) ** 2).mean()) < 0.12


@pytest.mark.slow
@pytest.mark.parametrize(("share", "scale"), [(0.5, 1.6), (0.7, 1.0), (0.75, 1.6)])
def test_markers_in_the_light_squares_do_not_hide_a_board(tmp_path, share, scale):
    path = tmp_path / "target.yaml"
    path.write_text(
        "units: mm\nboards:\n- {name: b, type: charuco, corners: [8, 6], square: 40, "
        f"marker: {40 * share}, dictionary: DICT_6X6_250}}\n"
    )
    target, lens = Target.load(path), lens_of_size(scale)
    pose = look_at((120, 60, -220), (140, 100, 0), roll=0.3)
    image = render(
        target, lens.unproject, pose, lens.image_size, noise=2.0, blur=0.6, supersample=2, seed=1
    )
    found, truth = find_grids(image), project_corners(target, lens, pose, lens.image_size)
    assert [len(grid) for grid in found.grids] == [48]
    assert recall(found, truth) == 1


@pytest.mark.slow
def test_a_shadow_across_a_board_does_not_split_it(box):
    image, truth = box
    shaded = image.astype(float)
    x = np.arange(image.shape[1])
    shaded *= 1 - 0.55 / (1 + np.exp((np.abs(x - 280) - 50) / 2.0))
    found = find_grids(shaded.astype(np.uint8))
    assert_one_board_each(found, truth)
    assert recall(found, truth) > 0.93


@pytest.mark.parametrize(
    "turn",
    [0.3, pytest.param(0.8, marks=pytest.mark.slow), pytest.param(1.2, marks=pytest.mark.slow)],
)
def test_bars_of_shadow_across_all_of_a_board_do_not_hide_it(turn):
    """As of sunlight between laths: of every corner's light another share is gone."""
    picture, i, j = drawn_board()
    shaded = (i * np.cos(turn) + j * np.sin(turn)) % 3.2 < 1.6
    (grid,) = find_grids(seen(picture * np.where(shaded, 0.35, 1.0))).grids
    assert len(grid) > 0.75 * 54


@pytest.mark.slow
def test_number_type_and_range_do_not_matter(box):
    image, _ = box
    reference = find_grids(image)
    for other in (image.astype(np.uint16) * 16, image.astype(np.float32) / 255, image + 1e4):
        found = find_grids(other)
        assert [len(g) for g in found.grids] == [len(g) for g in reference.grids]
        assert np.allclose(found.grids[0].pixel, reference.grids[0].pixel, atol=0.02)
    scaled = find_grids(image.astype(np.uint16) * 16)
    assert np.median(scaled.grids[0].contrast / reference.grids[0].contrast) == pytest.approx(
        16, rel=0.02
    )


@pytest.mark.slow
def test_the_same_photo_gives_the_same_grids(box):
    first, second = find_grids(box[0]), find_grids(box[0])
    for a, b in zip(first.grids, second.grids, strict=True):
        assert np.array_equal(a.pixel, b.pixel)
        assert np.array_equal(a.cells, b.cells)


@pytest.mark.slow
def test_a_large_photo_is_searched_reduced_and_refined_at_full_size(monkeypatch):
    image, truth = photo(1.0, supersample=2)
    monkeypatch.setattr(ladder, "MOST_PIXELS", image.size // 2)
    found = find_grids(image)
    assert found.image_size == (image.shape[1], image.shape[0])
    assert_one_board_each(found, truth)
    assert recall(found, truth) > 0.97
    assert np.sqrt((errors(found, truth) ** 2).mean()) < 0.04


def textures():
    rng = np.random.default_rng(0)
    height, width = 300, 400
    y, x = np.mgrid[:height, :width].astype(float)
    brick_x = x + (y // 25 % 2) * 30
    text = np.full((height, width), 240, np.uint8)
    for line in range(20, height, 20):
        cv2.putText(text, "HXH #### XOXO %&%& quick brown", (5, line), 0, 0.6, 20, 1, 16)
    smooth = rng.normal(0, 1, (height, width))
    return {
        "black": np.zeros((height, width)),
        "noise": rng.uniform(0, 255, (height, width)),
        **{f"cloud {s}": 128 + 120 * s * cv2.GaussianBlur(smooth, (0, 0), s) for s in (1, 2, 4)},
        "bricks": np.where((y % 25 < 4) | (brick_x % 60 < 4), 190, 110),
        "windows": np.where((x % 50 < 14) | (y % 50 < 14), 180, 50),
        "mesh": np.where((x % 12 < 2) | (y % 12 < 2), 200, 40),
        "text": text,
        "sum of sines": 128 + 60 * np.sin(np.pi * x / 20) + 50 * np.sin(np.pi * y / 20),
        "dots": np.where((x % 30 - 15) ** 2 + (y % 30 - 15) ** 2 < 81, 30, 220),
        "separate tiles": np.where(
            ((x // 40 + y // 40) % 2 == 0) & (abs(x % 40 - 20) < 16) & (abs(y % 40 - 20) < 16),
            220,
            30,
        ),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(textures()))
def test_texture_is_not_a_board(name):
    image = np.clip(textures()[name], 0, 255).astype(np.uint8)
    found = find_grids(image)
    assert found.grids == ()
    assert explain_no_grids(image, found).code


@pytest.mark.slow
def test_growth_over_dots_ends_early(monkeypatch):
    """A lattice of small dots is full of saddles: each piece would grow over the whole photo."""
    j, i = np.meshgrid(np.arange(0, 480, 6), np.arange(0, 640, 6))
    photo = np.full((480, 640), 230, np.uint8)
    for x, y in np.column_stack([i.ravel(), j.ravel()])[(i + j).ravel() // 6 % 2 == 0].tolist():
        cv2.circle(photo, (x, y), 2, 30, -1, cv2.LINE_AA)
    photo = cv2.warpAffine(photo, cv2.getRotationMatrix2D((320, 240), 6, 1.3), (640, 480))
    corners = []
    refine = search.verify

    def counted(pyramid, lattice, cells, **how):
        corners.append(len(cells))
        return refine(pyramid, lattice, cells, **how)

    monkeypatch.setattr(search, "verify", counted)
    assert find_grids(photo).grids == ()
    assert len(corners) > 5
    assert sum(corners) < 10_000


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1), (24, 24), (25, 60), (50, 49)])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_tiny_photos_do_no_harm(shape, kind):
    rng = np.random.default_rng(0)
    assert find_grids(rng.integers(0, 255, shape).astype(kind)).grids == ()
    assert find_grids(np.zeros(shape, kind)).grids == ()


def test_values_that_are_not_finite_do_no_harm():
    assert find_grids(np.full((80, 80), np.nan, np.float32)).grids == ()


@pytest.mark.slow
def test_the_explanation_names_the_cause(box):
    image, _ = box

    def explained(picture):
        found = find_grids(picture)
        assert found.grids == ()
        return explain_no_grids(picture, found)

    dark = np.where(image > 100, 5, 4).astype(np.uint8)[::3, ::3]
    assert explained(dark).code == Code.TOO_DARK
    assert explained(np.full((100, 100), 80, np.uint8)).code == Code.NO_PATTERN
    assert explained(image[:10, :10]).code == Code.PHOTO_TOO_SMALL
    assert explained(cv2.GaussianBlur(image, (0, 0), 8)).code == Code.BLURRED
    refused = FoundGrids(grids=(), refused=np.zeros((3, 2)), image_size=(576, 432))
    assert explain_no_grids(image, refused).code == Code.NO_CHECKERBOARD


@cache
def drawn_board(gap=0.0, side=24):
    """A 9x6 board, drawn at five times its size, whose dark squares draw back by half a gap."""
    x, y = ((np.arange(5 * length, dtype=np.float32) + 0.5) / 5 - 0.5 for length in (320, 240))
    i, j = ((x - 60.1) / side)[None, :], ((y - 60.3) / side)[:, None]
    edge = gap / 2 / side
    across = (i > -1) & (i < 9) & (np.abs(i - np.floor(i) - 0.5) < 0.5 - edge)
    down = (j > -1) & (j < 6) & (np.abs(j - np.floor(j) - 0.5) < 0.5 - edge)
    dark = across & down & ((np.floor(i) + np.floor(j)) % 2 == 0)
    light = np.where(dark, np.float32(40), np.float32(255))
    for one in (light, i, j):
        one.flags.writeable = False  # they are handed out again
    return light, i, j


def seen(light):
    light = cv2.GaussianBlur(light, (0, 0), 2.5).reshape(240, 5, 320, 5).mean((1, 3))
    light += np.random.default_rng(0).normal(0, 1.5, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def cause(picture):
    found = find_grids(picture)
    assert found.grids == ()
    return explain_no_grids(picture, found)


def without_a_board():
    """Photos for which no cause but the missing board may be named."""
    rng = np.random.default_rng(5)
    noise = rng.normal(0, 1.5, (360, 480))
    page = np.full((360, 480), 255, np.uint8)
    for y in range(30, 350, 26):
        cv2.putText(page, "plain text on white paper", (12, y), 0, 0.8, 30, 2, cv2.LINE_AA)
    front = np.full((360, 480), 262.0)
    for y in range(20, 330, 44):
        for x in range(20, 440, 38):
            cv2.rectangle(front, (x, y), (x + 20, y + 24), float(rng.uniform(20, 60)), -1)
    cells = cv2.resize(rng.uniform(20, 250, (90, 120)), (480, 360), interpolation=0)
    lawn = np.kron(rng.uniform(0, 255, (120, 160)), np.ones((3, 3)))
    down, across = np.indices((360, 480))
    curtain = np.where(across // 9 % 2, 60.0, 160.0) * (1 + 0.4 * np.sin(down / 40))
    pictures = {"page": page, "burnt-out front": front, "cells of 4 px": cells, "lawn": lawn}
    pictures["curtain"] = curtain
    return {
        name: np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)
        for name, picture in pictures.items()
    }


@pytest.mark.parametrize("gap", [10, 13])
def test_burnt_out_white_is_named_where_dark_squares_no_longer_touch(gap):
    reported = cause(seen(drawn_board(gap=gap)[0] * 1.1))
    assert (reported.code, reported.case) == (Code.TOO_BRIGHT, "burnt")


@pytest.mark.slow
@pytest.mark.parametrize("blur", [7, 12])
def test_blur_is_named_where_a_board_is_seen_through_it(blur):
    light = cv2.GaussianBlur(drawn_board()[0], (0, 0), 5 * blur)
    sharp_frame = np.where(np.indices(light.shape)[0] < 60, 20.0, light)
    assert cause(seen(sharp_frame)).code == Code.BLURRED


def moved(light, length_px, towards_deg):
    """Light while the camera turns evenly, so that all of a picture moves by as much."""
    steps = np.linspace(-0.5, 0.5, 23)[:, None] * 5 * length_px  # of a pixel
    angle = np.radians(towards_deg)
    still = np.float64([[1, 0, 0], [0, 1, 0]])
    light = light.astype(np.uint8)
    total = np.zeros(light.shape, np.float32)
    for shift in steps * [np.cos(angle), np.sin(angle)]:
        still[:, 2] = shift
        one = cv2.warpAffine(light, still, light.shape[::-1], borderMode=cv2.BORDER_REFLECT)
        cv2.accumulate(one, total)
    return total / len(steps)


@pytest.mark.parametrize("towards_deg", [30, pytest.param(135, marks=pytest.mark.slow)])
def test_motion_is_named_though_edges_along_it_stay_sharp(towards_deg):
    reported = cause(seen(moved(drawn_board()[0], 22, towards_deg)))
    assert reported.code == Code.BLURRED


def test_small_squares_are_named_with_their_size():
    reported = cause(seen(drawn_board(side=3)[0]))
    assert reported.code == Code.SQUARES_TOO_SMALL
    assert reported.figures["side_px"] == pytest.approx(3.0, rel=0.05)
    assert (reported.figures["least_px"], reported.figures["seen_at"]) == (6, "full")


def large(light, blur_px, frame_px=60):
    """A photo of 1280x960 of the drawn board, four times as large, within a sharp frame."""
    photo = cv2.resize(light, (1280, 960), interpolation=cv2.INTER_AREA)
    photo = cv2.GaussianBlur(photo, (0, 0), blur_px)
    photo[:frame_px] = 20
    photo = photo + np.random.default_rng(0).normal(0, 1.5, photo.shape)
    return np.clip(np.rint(photo), 0, 255).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize("blur_px", [20, 26])
def test_a_grid_that_only_a_coarse_scale_shows_is_told_with_its_blur(blur_px):
    photo = large(drawn_board()[0], blur_px)
    reported = explain_no_grids(photo, FoundGrids(grids=(), refused=[], image_size=(1280, 960)))
    assert (reported.code, reported.case) == (Code.BLURRED, "grid")
    figures = reported.figures
    assert {figures["columns"], figures["rows"]} <= {7, 8, 9, 5, 6}
    assert figures["side_px"] == pytest.approx(96, rel=0.05)
    assert figures["blur_px"] == pytest.approx(blur_px, rel=0.4)
    assert figures["seen_at"] != "full"


@pytest.mark.slow
def test_a_grid_that_is_seen_and_not_read_is_told():
    """Squares that do not touch, as tiles with wide joints."""
    reported = cause(np.clip(textures()["separate tiles"], 0, 255).astype(np.uint8))
    assert (reported.code, reported.case) == (Code.NO_CHECKERBOARD, "grid")
    assert reported.figures["side_px"] == pytest.approx(40, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(without_a_board()))
def test_no_cause_is_named_for_photos_without_a_board(name):
    assert cause(without_a_board()[name]).code in (Code.NO_CHECKERBOARD, Code.NO_CORNER)


def test_pieces_that_hang_together_nowhere_are_no_board():
    cells = np.argwhere(np.ones((3, 2))).tolist() + [
        (i + 2, j + 3) for j in range(3) for i in (0, 1)
    ]
    joining = [(1, 2), (2, 2), (3, 2)]

    def of(cells):
        cells = np.array(cells)
        return Lattice.from_cells(cells, 20.0 * cells[:, ::-1], np.ones(len(cells)), 1)

    assert not is_large_enough(of(cells))
    assert is_large_enough(of(cells + joining))


def cells_with_a_piece(*, alone):
    """Cells of 16 px, black or white at random or all white, with 5x4 chequers among them."""
    rng = np.random.default_rng(5)
    cells = np.ones((15, 20), bool) if alone else rng.random((15, 20)) < 0.5
    i, j = np.indices((5, 4))
    cells[5:10, 7:11] = (i + j) % 2 == 0
    return seen(np.kron(np.where(cells, 220.0, 30.0), np.ones((80, 80))))


def test_a_piece_of_chequerboard_among_random_cells_is_no_board():
    assert [len(grid) for grid in find_grids(cells_with_a_piece(alone=True)).grids] == [12]
    assert find_grids(cells_with_a_piece(alone=False)).grids == ()


def cut_board(side, corners):
    """So many corners of a wooden board that the photo's border cuts, and crossings beside it."""
    rng = np.random.default_rng(4)
    y, x = np.indices((480, 640))
    i, j = np.floor((x - 640) / side + corners[0] + 0.5), np.floor((y - 6) / side)
    board = (i >= 0) & (j >= 0) & (j <= corners[1])
    light = np.where(board & ((i + j) % 2 == 0), 40.0, 210.0)
    # Where things cross: a pair of wedges each, none of which goes with another one's.
    for k in range(30):
        at, turn = np.array([30 + 62 * (k % 6), 40 + 95 * (k // 6)]), rng.uniform(0, np.pi)
        for way in (turn, turn + np.pi):
            ends = at + 22 * np.array([[np.cos(way + w), np.sin(way + w)] for w in (0, 1.5)])
            cv2.fillPoly(light, [np.vstack([at, ends]).astype(int)], 40.0)
    wood = cv2.GaussianBlur(rng.normal(0, 120, light.shape), (0, 0), 6)
    light = cv2.GaussianBlur(light, (0, 0), 0.8) + wood + rng.normal(0, 0.5, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("side", "corners"), [(24, (2, 6)), (90, (3, 4))])
def test_as_little_of_a_board_as_the_border_leaves_is_found(side, corners):
    grids = find_grids(cut_board(side, corners)).grids
    assert [len(grid) for grid in grids] == [np.prod(corners)]


def test_a_stray_corner_on_a_single_link_is_left_out():
    light, i, j = drawn_board()
    # Something dark beyond the margin touches the outer corner of a dark square.
    beside = (i > -2) & (i < -1) & (j > 0) & (j < 0.6)
    found = find_grids(seen(np.where(beside, 40.0, light)))
    assert [len(grid) for grid in found.grids] == [54]
    assert found.grids[0].cells.max(0).tolist() in ([8, 5], [5, 8])


def test_corners_in_a_line_have_squares_without_a_side_and_no_warning():
    pixel = np.tile([[20.0, 20.0]], (4, 1))
    cells = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    lattice = Lattice.from_cells(cells, pixel, np.ones(4), 1)
    image = np.random.default_rng(0).integers(0, 255, (48, 48)).astype(np.uint8)
    measure_contrast(build_pyramid(image), lattice)
    assert np.isfinite(lattice.contrast).all()


@pytest.mark.parametrize(("lamp", "least"), [((3.4, 2.4), 43), ((5, 2), 45)])
def test_corners_around_a_lamp_s_reflection_are_kept(lamp, least):
    light, i, j = drawn_board()
    # Bright beyond white: dark squares fade into it, and those at its rim draw back.
    light = light + 420 * np.exp(-0.5 * ((i - lamp[0]) ** 2 + (j - lamp[1]) ** 2) / 1.2**2)
    found = find_grids(seen(np.minimum(light, 255.0)))
    assert len(found.grids) == 1
    truth = np.stack(np.meshgrid(60.1 + 24.0 * np.arange(9), 60.3 + 24.0 * np.arange(6)), -1)
    away = found.grids[0].pixel[:, None] - truth.reshape(-1, 2)
    assert np.hypot(*away.transpose(2, 0, 1)).min(1).max() < 0.5
    assert len(found.grids[0]) >= least


@pytest.mark.parametrize("gap", [0.8, 2.0, 4.0])
def test_a_board_whose_dark_squares_no_longer_touch_is_whole(gap):
    light, _, _ = drawn_board(gap=gap)
    found = find_grids(seen(light))
    assert [len(grid) for grid in found.grids] == [54]
    truth = np.stack(np.meshgrid(60.1 + 24.0 * np.arange(9), 60.3 + 24.0 * np.arange(6)), -1)
    away = found.grids[0].pixel[:, None] - truth.reshape(-1, 2)
    error = away[np.arange(54), np.hypot(*away.transpose(2, 0, 1)).argmin(1)]
    assert np.hypot(*error.T).max() < 0.15
    assert np.hypot(*error.mean(0)) < 0.02
