"""What the fit says beyond its figures: bad photos and boards are named, with a likely cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import synthetic
from lenses import random_rays

from cubicfish.calibration import calibrate
from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.diagnosis.left_out import dropped_boards
from cubicfish.fit.calibrate import calibrate as fit
from cubicfish.fit.coverage import FieldCells, blind_angle
from cubicfish.judge.codes import Code
from cubicfish.judge.fit_record import DroppedCorner
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.subset import select

TARGET = synthetic.corner_of_three()


@pytest.fixture
def pairs():
    poses = synthetic.poses_around(TARGET, 10, seed=21)
    return synthetic.synthetic_correspondences(TARGET, poses, noise=0.1, seed=22)


def swapped(pairs, photo):
    """The names of two boards exchanged in one photo, where both have the corner."""
    board = pairs.board.copy()
    own = pairs.image == photo
    board[own & (pairs.board == 0)], board[own & (pairs.board == 1)] = 1, 0
    changed = replace(pairs, board=board)
    fits = (changed.column < 7) & (changed.row < 5)
    world = TARGET.world_points(board[fits], pairs.column[fits], pairs.row[fits])
    return replace(
        changed,
        image=pairs.image[fits],
        world=world,
        pixel=pairs.pixel[fits],
        weight=pairs.weight[fits],
        board=board[fits],
        column=pairs.column[fits],
        row=pairs.row[fits],
    )


@pytest.mark.slow
def test_swapped_boards_are_named(pairs):
    result = calibrate(swapped(pairs, 4), target=TARGET, hold_out=False)
    said = " ".join(map(str, result.findings)) + " ".join(result.unfit)
    assert "04.png" in said
    assert result.errors.rms_px < 0.2
    lost = {corner.image for corner in result.fit.dropped_corners} | set(result.unfit)
    assert lost == {"04.png"}


@pytest.mark.slow
def test_a_board_that_moved_in_one_photo_is_named(pairs):
    own = (pairs.image == 2) & (pairs.board == 1)
    world = pairs.world.copy()
    world[own] += [0, 0, 12.0]
    moved = pairs.with_world(world)
    result = fit(moved, target=TARGET, hold_out=False, diagnose=find_faults)
    (note,) = [one for one in result.findings if one.code == Code.BOARD_DROPPED]
    assert (note.images, note.boards) == (("02.png",), ("left",))
    assert note.figures["corners"] == own.sum()
    assert result.errors.rms_px < 0.16


def test_photos_that_lost_the_same_board_are_reported_in_one_line(pairs):
    one = DroppedCorner(image="00.png", board="left", error_px=3.0)
    dropped = [one] * 9 + [DroppedCorner(image="02.png", board="left", error_px=8.0)] * 8
    dropped += [DroppedCorner(image="02.png", board="floor", error_px=2.5)]
    dropped += [DroppedCorner(image="03.png", error_px=9.0)]
    seen = sum(
        ((pairs.image == photo) & (pairs.board == pairs.boards.index("left"))).sum()
        for photo in (0, 2)
    )
    few, _ = select(pairs, (pairs.column < 4) & (pairs.row < 4))
    assert dropped_boards(SimpleNamespace(pairs=pairs, dropped=[one])) == []
    (reported,) = dropped_boards(SimpleNamespace(pairs=few, dropped=dropped))
    assert (reported.images, reported.boards) == (("00.png", "02.png"), ("left",))
    assert reported.figures["corners"] < seen
    assert reported.figures["dropped"] == 17
    assert (reported.figures["low_px"], reported.figures["high_px"]) == (3.0, 8.0)


def test_corners_beyond_the_field_say_nothing_of_its_middle() -> None:
    assert blind_angle(np.zeros((0, 3))) == 0
    assert blind_angle(np.full((9, 3), np.nan)) == 0


@pytest.mark.slow
def test_a_middle_that_no_side_shows_is_the_camera_itself() -> None:
    """As wide a hole on all sides, in a picture beyond 90°: that of a camera in its mirror."""
    rays = random_rays(115.0, 3000)
    angle = np.degrees(np.arccos(rays[:, 2] / np.linalg.norm(rays, axis=1)))
    assert np.degrees(blind_angle(rays[angle > 45])) == pytest.approx(45, abs=2)
    assert blind_angle(rays) == 0
    assert blind_angle(rays[angle > 15]) == 0  # as happens to photographers
    assert blind_angle(rays[(angle > 45) & (angle < 85)]) == 0
    assert blind_angle(rays[(angle > 45) | ((rays[:, 0] > 0) & (angle > 20))]) == 0
    assert blind_angle(rays[(angle > 45) & (rays[:, 0] > 0)]) == 0


@pytest.mark.slow
def test_a_blurred_photo_is_named_and_left_out(pairs):
    pixel = pairs.pixel.copy()
    own = pairs.image == 6
    pixel[own] += np.random.default_rng(0).normal(0, 0.9, (own.sum(), 2))
    result = calibrate(replace(pairs, pixel=pixel), target=TARGET, hold_out=False)
    assert list(result.unfit) == ["06.png"]
    assert result.unfit["06.png"].code == Code.NOISY
    assert [(one.code, one.images) for one in result.unfit.values()] == [(Code.NOISY, ("06.png",))]
    assert "06.png" not in result.pairs.images
    assert result.errors.rms_px < 0.16


@pytest.mark.slow
def test_photos_that_are_all_noisy_are_kept(pairs):
    pixel = pairs.pixel + np.random.default_rng(0).normal(0, 0.9, pairs.pixel.shape)
    assert not calibrate(replace(pairs, pixel=pixel), target=TARGET, hold_out=False).unfit


@pytest.mark.slow
def test_a_good_set_is_not_talked_about(pairs):
    assert not calibrate(pairs, hold_out=False).findings


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "cause"), [("square", "board_square"), ("place", "board_place")]
)
def test_a_wrong_drawing_is_blamed_on_its_board_alone(pairs, change, cause):
    """The object is right and its file is wrong: what it does to the other boards is not said."""
    boards = list(TARGET.boards)
    if change == "square":
        boards[2] = replace(boards[2], square=boards[2].square * 1.04)
    else:
        boards[1] = replace(boards[1], origin=boards[1].origin + np.array([0, 6.0, 0]))
    wrong = replace(TARGET, boards=tuple(boards))
    world = wrong.world_points(pairs.board, pairs.column, pairs.row)
    result = calibrate(replace(pairs, world=world), target=wrong, refine_target="shape")
    (finding,) = result.findings
    assert finding.code == cause
    assert finding.boards == (boards[2 if change == "square" else 1].name,)


def test_coverage_counts_the_valid_field():
    outline = np.array([[0, 0], [800, 0], [800, 800], [0, 800]], float)
    corners = np.stack(np.meshgrid(np.arange(5.0, 400, 10), np.arange(5.0, 800, 10)), -1)

    def coverage(pixel, outline):
        camera = SimpleNamespace(image_size=(800, 800), outline=lambda: outline)
        return FieldCells.of(camera, pixel).coverage

    assert coverage(corners.reshape(-1, 2), outline) == pytest.approx(0.5)
    triangle = np.array([[0, 0], [800, 0], [0, 800]], float)
    assert coverage(np.zeros((0, 2)), triangle) == 0
    everywhere = np.stack(np.meshgrid(np.arange(800.0), np.arange(800.0)), -1).reshape(-1, 2)
    assert coverage(everywhere, triangle) == 1


@pytest.mark.slow
def test_the_cubic_is_not_worse_than_its_companion_on_a_radial_lens():
    """Few noisy corners of a lens that is the reference's own: the freedom must not hurt."""
    truth = RadialCamera(
        image_size=(960, 720), fx=255, fy=255, cx=485, cy=350, k=np.array([-0.02, 0, 0, 0])
    )
    poses = synthetic.poses_around(TARGET, 5, seed=3)
    pairs = synthetic.synthetic_correspondences(TARGET, poses, lens=truth, noise=0.4, seed=9)
    held_out = calibrate(pairs).held_out
    assert held_out is not None
    assert held_out.rms_px <= 1.01 * held_out.radial_rms_px
