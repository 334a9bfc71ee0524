"""Films of several cameras: their clocks, the moments that are taken, and how corners move."""

import json
import re
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

from filming import photos, write_film
from listening import Heard
from running import Run
from simulated_rig import combined, corner_target
from synthetic_lenses import synthetic_lens

from cubicfish import DetectionError, Event
from cubicfish.rigs.shots import time_of
from cubicfish.scene.photos import render
from cubicfish.scene.truth import Pose, pose_of_matrix
from cubicfish_cli import save_target
from cubicfish_cli.extensions.rigs import films as rig_films
from cubicfish_cli.extensions.rigs.calibrate import RigOptions, calibrate_rig_files
from cubicfish_cli.extensions.rigs.film_clocks import FilmMatch, FilmMotion, match_films
from cubicfish_cli.extensions.rigs.films import ShotFrame, find_ahead
from cubicfish_cli.extensions.rigs.moments import flow, moments
from cubicfish_cli.films.choose import choose, choose_shots
from cubicfish_cli.films.scan import Measured, scan
from cubicfish_cli.films.source import Film, open_films
from tests.cubicfish_cli.films.test_choose import at

SIZE = (480, 360)


def lively(seconds: float, rate: float, begin: float, seed: int = 0) -> FilmMotion:
    """By a film's own clock, how much it moves, where all films move alike."""
    rng = np.random.default_rng(9)
    knots = np.exp(rng.standard_normal(400))
    time = np.arange(begin, begin + seconds, 1 / rate)
    noise = np.random.default_rng(seed).standard_normal(len(time))
    moved = np.interp(time, 0.25 * np.arange(400), knots) * np.exp(0.1 * noise)
    return FilmMotion(time=time - begin, moved=moved)


@pytest.mark.parametrize("begin", [0.73, -0.31, 4.0])
def test_films_are_matched_by_when_they_move(begin: float) -> None:
    match = match_films(lively(20, 30, 5.0), lively(18, 25, 5.0 + begin, seed=1))
    assert match.ahead == pytest.approx(-begin, abs=0.04)


def test_clocks_that_agree_are_left_alone_and_what_is_not_sure_too() -> None:
    first, second = lively(20, 30, 5.0), lively(20, 30, 5.0, seed=1)
    assert match_films(first, second) == FilmMatch()
    other = np.exp(np.random.default_rng(3).standard_normal(len(second.time)))
    assert match_films(first, replace(second, moved=other)) == FilmMatch()
    assert match_films(first, replace(second, moved=0 * other)) == FilmMatch()
    short = [FilmMotion(time=one.time[:9], moved=one.moved[:9]) for one in (first, second)]
    assert match_films(*short) == FilmMatch()


def test_waves_of_a_hand_in_one_rhythm_are_matched_to_none() -> None:
    waves = []
    for seed, begin in enumerate((0.0, 0.7)):
        time = np.arange(begin, begin + 20, 0.04)
        noise = np.random.default_rng(seed).standard_normal(len(time))
        moved = np.abs(np.cos(2 * np.pi * time)) * np.exp(0.1 * noise)
        waves.append(FilmMotion(time=time - begin, moved=moved))
    match = match_films(*waves)
    assert match.ahead == 0
    rounds = (match.alike[1] - match.alike[0]) / 0.5
    assert rounds == pytest.approx(round(rounds), abs=0.1)


def slides(path: Path, stays: Sequence[int], skipped: int, seed: int) -> Measured:
    """A film of ten frames a second that stands still at each of some pictures, and jumps."""
    rng = np.random.default_rng(seed)
    frames = []
    for stay in stays:
        picture = cv2.GaussianBlur(rng.uniform(0, 255, (90, 120)).astype(np.float32), (0, 0), 2)
        grey = cv2.normalize(picture, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
        frames += [grey] * stay
    write_film(path, frames[skipped:])
    (film,) = open_films([path])
    return scan(film)


@pytest.mark.parametrize("steady", [True, False])
def test_slide_shows_are_matched_where_their_rhythm_is_uneven(steady: bool, tmp_path: Path) -> None:
    uneven = np.random.default_rng(2).integers(2, 9, 16).tolist()
    stays = [5] * 16 if steady else uneven
    films = {
        name: slides(tmp_path / f"{name}.mp4", stays, skipped, seed)
        for seed, (name, skipped) in enumerate({"left": 0, "right": 7}.items())
    }
    heard = Heard()
    ahead = find_ahead(films, heard)
    if steady:
        assert ahead == [0, 0]
        assert [event for event, _ in heard.events] == [Event.CLOCK_UNSURE]
    else:
        assert ahead[1] == pytest.approx(-0.7, abs=1e-3)
        assert [event for event, _ in heard.events] == [Event.CLOCK]


def measured(times: list[float], motion: list[float]) -> Measured:
    film = Film(
        path=Path("film.mp4"),
        label="film",
        size=SIZE,
        frames=0,
        rate=10.0,
    )
    return Measured(
        film=film,
        time=array("d", times),
        sharpness=array("f", [0.5] * len(times)),
        motion=array("f", motion),
    )


def test_moments_are_those_at_which_all_cameras_are_still() -> None:
    time = [0.1 * number for number in range(40)]
    moving = [8.0] * 40
    one, other = list(moving), list(moving)
    for stretch in range(4):
        one[10 * stretch + 2] = one[10 * stretch + 6] = 0.0
        other[10 * stretch + 6] = other[10 * stretch + 8] = 0.0
    late = [value + 0.52 for value in time]
    found = moments([measured(time, one), measured(late, other)], [0.0, 0.5], 4, None)
    assert found.frame.tolist() == [[n, n] for n in (6, 16, 26, 36)]
    assert np.allclose(found.time, np.array(time)[[6, 16, 26, 36]])
    assert np.allclose(found.late, [0, 0.02])


def test_films_without_a_common_time_have_no_moments() -> None:
    time = [0.1 * number for number in range(40)]
    films = [measured(time, [0.0] * 40), measured([one + 9 for one in time], [0.0] * 40)]
    assert not len(moments(films, [0.0, 0.0], 4, None).time)
    near = [films[0], measured([one + 0.04 for one in time], [0.0] * 40)]
    assert len(moments(near, [0.0, 0.0], 4, None).time) == 4
    assert not len(moments(near, [0.0, 0.0], 4, 0.005).time)


@pytest.mark.slow
def test_flow_is_how_corners_move() -> None:
    photo = photos(3)[0]
    corners = np.array([[200.0, 150.0], [230.0, 180.0], [180.0, 200.0]])
    moved = flow(photo, np.roll(photo, (3, -5), (0, 1)), corners)
    known = np.isfinite(moved).all(axis=1)
    assert known.any()
    assert np.allclose(moved[known], [-5, 3], atol=0.1)
    flat = np.full_like(photo, 99)
    assert not np.isfinite(flow(photo, flat, corners)).all()
    assert flow(photo, photo, np.zeros((0, 2))).shape == (0, 2)


def test_one_camera_is_chosen_for_as_a_rig_of_one() -> None:
    seen = [at(40, 40), at(44, 42), at(60, 50), at(300, 240), at(180, 140, moved=9.0)]
    alone = choose(seen, SIZE, 3, 0.6)
    as_rig = choose_shots([[one] for one in seen], [SIZE], 3, [0.6])
    assert (alone.order, alone.gain) == (as_rig.order, as_rig.gain)


def test_shots_that_two_cameras_see_come_first_and_spoilt_pictures_do_not_count() -> None:
    alone, both = [at(40, 40), None], [at(60, 200), at(100, 90)]
    half = [at(300, 240), at(300, 40, sharp=0.2)]
    made = choose_shots([alone, both, half], [SIZE, SIZE], 9, [0.6, 0.6])
    assert made.order[0] == 1
    assert sorted(made.order) == [0, 1, 2]
    assert made.gain[2] == pytest.approx(made.gain[1], rel=0.5)  # one camera's worth
    nothing = choose_shots([[None, None]], [SIZE, SIZE], 9, [0.6, 0.6])
    assert nothing.order == ()


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("cam0/1403636579763555584.png", 1403636579.763555584),
        ("1700000000.25.png", 1700000000.25),
        ("1700000000.25", 1700000000.25),
        ("left_1700000000123.jpg", 1700000000.123),
        ("film_000012.345s.png", 12.345),
        ("12.5.png", 12.5),
        ("left_0001.png", None),
        ("0001.png", None),
    ],
)
def test_names_tell_times(name: str, seconds: float | None) -> None:
    assert time_of(name) == (None if seconds is None else pytest.approx(seconds, abs=1e-6))


def poses(count: int) -> list[Pose]:
    """rig_from_world before a corner of three boards."""
    rng = np.random.default_rng(4)
    found = []
    for _ in range(count):
        eye = rng.uniform(250, 560, 3)
        forward = rng.uniform(0, 260, 3) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0] + 0.3 * rng.standard_normal(3))
        right /= np.linalg.norm(right)
        found.append(pose_of_matrix(np.stack([right, np.cross(forward, right), forward]), eye))
    return found


@pytest.mark.slow
def test_films_become_a_rig(run: Run, tmp_path: Path) -> None:
    """Held still at each of some places; the second film begins 0.7 s later than the first."""
    rng = np.random.default_rng(2)
    place = (np.array([0.0, 0.4, 0.02]), np.array([-90.0, 3.0, 5.0]))
    stays = rng.integers(2, 9, 12)
    save_target(tmp_path / "target.yaml", corner_target())
    for number, (own, kind) in enumerate(
        (((np.zeros(3), np.zeros(3)), "equisolid"), (place, "orthographic"))
    ):
        lens = synthetic_lens(kind, SIZE)
        frames = []
        for index, (pose, stay) in enumerate(zip(poses(12), stays, strict=True)):
            picture = render(
                corner_target(), lens.unproject, combined(own, pose), SIZE, supersample=2,
                noise=1.0, seed=(number, index),
            )  # fmt: skip
            frames += [picture] * int(stay)
        write_film(tmp_path / f"cam{number}.mp4", frames[7 * number :])
    said = run(
        "rig", "calibrate",
        tmp_path / "cam0.mp4", tmp_path / "cam1.mp4", "-t", tmp_path / "target.yaml",
        "-o", tmp_path / "rig", "--refine-target", "off", "--no-report", "--json",
    )  # fmt: skip
    behind = re.search(r"clock of cam1 is ((6|7)\d\d\.\d) ms behind that of cam0", said.stderr)
    assert behind is not None
    record = json.loads(said.stdout)
    right = record["cameras"][1]
    assert np.linalg.norm(right["position"]) == pytest.approx(np.linalg.norm(place[1]), abs=2)
    assert record["fit"]["rms_px"] < 0.3
    names = [one["shot"] for one in record["fit"]["per_shot"]]
    assert len(names) >= 8
    assert all(re.fullmatch(r"shot_\d{6}\.\d{3}s", name) for name in names)
    # What is left moves no corner of a target that is held still, and is fitted no further.
    assert float(behind[1]) + (right["fit"]["late_ms"] or 0) == pytest.approx(700, abs=3)
    frames = tmp_path / "rig" / "frames"
    assert not (frames / ".unfinished").exists()
    assert len(list((frames / "cam1").glob("*.png"))) == right["fit"]["images"]
    # What was written is a rig of photos.
    run(
        "rig", "calibrate", frames / "cam0", frames / "cam1", "--shots", frames / "shots.csv",
        "-t", tmp_path / "target.yaml", "-o", tmp_path / "again", "--refine-target", "off",
        "--no-report", "-q",
    )  # fmt: skip


def test_films_that_show_no_board_leave_no_folder(run: Run, tmp_path: Path) -> None:
    save_target(tmp_path / "target.yaml", corner_target())
    films = [tmp_path / f"{name}.mp4" for name in ("left", "right")]
    for number, path in enumerate(films):
        slides(path, [5] * 3, 0, number)
    said = run(
        "rig", "calibrate", *films, "-t", tmp_path / "target.yaml", "-o", tmp_path / "in" / "rig",
        code=1,
    )  # fmt: skip
    assert "no frame can be chosen" in said.stderr
    assert not (tmp_path / "in").exists()


def test_frames_that_stay_when_no_rig_is_found_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading films again would take as long as the first time."""
    save_target(tmp_path / "target.yaml", corner_target())
    grey = np.full((90, 120), 99, np.uint8)
    films = [write_film(tmp_path / f"{name}.mp4", [grey]) for name in ("left", "right")]

    def chosen(of: Mapping[str, Path], folder: Path, *_: Any, **options: Any) -> list[ShotFrame]:
        frames = []
        for name in of:
            picture = folder / name / "film_000000.000s.png"
            picture.parent.mkdir(parents=True)
            cv2.imwrite(str(picture), grey)
            nothing: tuple[None, None] = (None, None)
            frames.append(
                ShotFrame(shot="shot", camera=name, picture=picture, late=0.0, beside=nothing,
                          seconds=(-1.0, 1.0))
            )  # fmt: skip
        (folder / "shots.csv").write_text("shot,camera,image\n")
        return frames

    monkeypatch.setattr(rig_films, "rig_frames", chosen)
    options = RigOptions(
        cameras=films, target=tmp_path / "target.yaml", folder=tmp_path / "rig", report=False
    )
    with pytest.raises(DetectionError, match=r"frames stay in .*rig.frames.*--shots .*shots\.csv"):
        calibrate_rig_files(options)
    assert (tmp_path / "rig" / "frames" / "shots.csv").exists()
