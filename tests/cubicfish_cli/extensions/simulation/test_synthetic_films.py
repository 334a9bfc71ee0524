"""Films of known truth: where corners are, what a shutter does, and how a hand moves."""

import cv2
import numpy as np
import pytest
from looking import look_at
from synthetic import corner_of_three, flat_board, lens_of_size
from synthetic_lenses import synthetic_lens

pytest.importorskip("av")

from synthetic_films import Film, FilmOptions, HandPath

from cubicfish import Target
from cubicfish.scene.photos import Look, chosen_poses
from cubicfish.scene.scene import Scene
from cubicfish.scene.truth import rotation_matrix

LENS = lens_of_size(0.5)
SIZE = LENS.image_size
CLEAN = Look(noise=0.0, blur=0.7, vignetting=0.0)


class Slide:
    """A target that goes along x at an even speed, in front of a camera."""

    def __init__(self, speed: float, target: Target) -> None:
        world = target.corners()[3]
        self._middle = (world.min(axis=0) + world.max(axis=0)) / 2
        self._speed = speed

    def at(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        return np.eye(3), np.array([self._speed * seconds, 10.0, 260.0]) - self._middle


def refined(picture: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    start = np.ascontiguousarray(pixel, np.float32)[:, None].copy()
    return cv2.cornerSubPix(picture, start, (3, 3), (-1, -1), stop)[:, 0]


def taken(shutter_ms, readout_ms, rate=30):
    return FilmOptions(rate=rate, shutter_ms=shutter_ms, readout_ms=readout_ms)


def film_of(target, path, shutter, lens=LENS):
    return Film(target=target, lens=lens, image_size=SIZE, path=path, taken=shutter)


@pytest.mark.parametrize(
    ("lens", "readout"), [(LENS, 0.0), (synthetic_lens("moving-pupil", SIZE), 0.02)]
)
def test_corners_are_where_the_truth_says(lens, readout: float) -> None:
    target = flat_board()
    path, shutter = Slide(250.0, target), taken(2, 1000 * readout)
    film = film_of(target, path, shutter, lens)
    (picture,) = film.frames(1, CLEAN)
    _, true = film.corners(0)
    error = refined(picture, true) - true
    assert len(true) > 40
    # A half-pixel slip anywhere would show as a mean of 0.25 to 0.5 px.
    assert np.abs(error.mean(axis=0)).max() < 0.03
    assert np.median(np.hypot(*error.T)) < 0.06


def test_rows_that_are_read_later_see_what_moves_farther_on() -> None:
    target = flat_board()
    path = Slide(400.0, target)
    at_once, late = (
        film_of(target, path, taken(0, 1000 * readout)).corners(0) for readout in (0.0, 0.03)
    )
    np.testing.assert_array_equal(at_once[0], late[0])
    ahead = late[1][:, 0] - at_once[1][:, 0]
    # Of 400 mm a second at 260 mm, each row sees its share: pixels per radian about 131.
    expected = 131 * 400 * 0.03 * at_once[1][:, 1] / SIZE[1] / 260
    assert ahead.min() > 1
    np.testing.assert_allclose(ahead, expected, rtol=0.35)


@pytest.mark.slow
def test_a_longer_exposure_blurs_along_the_motion_alone() -> None:
    target = flat_board()
    path = Slide(400.0, target)

    def slopes(open_s: float) -> np.ndarray:
        shutter = taken(1000 * open_s, 0)
        (picture,) = film_of(target, path, shutter).frames(1, CLEAN)
        return np.array([np.quantile(np.abs(np.diff(picture.astype(float), axis=axis)), 0.999)
                         for axis in (1, 0)])  # fmt: skip

    along, across = slopes(0.04) / slopes(0.001)
    assert along < 0.6
    assert across > 0.85


@pytest.mark.slow
def test_a_plate_is_seen_before_what_is_behind_it_and_not_outside_the_field() -> None:
    target = corner_of_three()
    pose = chosen_poses(target, LENS, SIZE, 4)[1]

    class Still:
        def at(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
            return rotation_matrix(pose[0]), pose[1]

    shutter = taken(10, 10)
    (picture,) = film_of(target, Still(), shutter).frames(1, CLEAN)
    ((_, photo),) = Scene(target=target, lens=LENS, image_size=SIZE).photos({"one": pose}, CLEAN)
    ink = photo < 30
    assert 0.1 < ink.mean() < 0.9
    assert np.mean((picture < 30) == ink) > 0.985  # edges alone may differ
    outside = ~np.isfinite(LENS.unproject(np.argwhere(np.ones(photo.shape))[:, ::-1])[:, 0])
    assert outside.any()
    assert np.quantile(picture.ravel()[outside], 0.95) <= 8  # the rim is blurred


def test_a_hand_comes_to_every_place_and_goes_smoothly() -> None:
    eyes = [(-80.0, 20.0, -300.0), (90.0, 60.0, -350.0), (10.0, -90.0, -250.0)]
    poses = [look_at(eye, (0, 0, 0), up=(0, -1, 0)) for eye in eyes]
    path = HandPath.through(poses, np.zeros(3), 6.0, seed=2)
    times = np.arange(0, 6, 0.02)
    places = np.array([path.at(one)[1] for one in times])
    for _, moved in poses:
        # It sways and trembles by about a degree of 300 mm.
        assert np.linalg.norm(places - moved, axis=1).min() < 12
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 20
    for one in times[::50]:
        turn, _ = path.at(one)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    other = HandPath.through(poses, np.zeros(3), 6.0, seed=3)
    assert np.abs(np.array([other.at(one)[1] for one in times]) - places).max() > 1
