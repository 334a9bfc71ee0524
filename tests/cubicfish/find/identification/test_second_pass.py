"""The second pass adds corners that the photos show and the first pass missed, and no others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import TRUE_LENS, as_type, corner_of_three, poses_around, synthetic_corners

from cubicfish.find.identification import second_pass as passes
from cubicfish.find.identification.identified import Detection, PhotoReport
from cubicfish.find.identification.second_pass import predicted_corners
from cubicfish.fit.rough_fit import RoughFit
from cubicfish.io.corners_csv import load_corners
from cubicfish.observe.detection import second_pass
from cubicfish.photos.photos import Photo, find_photos
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.workers.pool import Work

SAMPLE = Path(__file__).parents[4] / "sample_data"
TARGET = Target.load(SAMPLE / "target.yaml")
PHOTOS = find_photos([SAMPLE / "photos"])[:4]


def truth() -> Observations:
    corners = load_corners(SAMPLE / "true_corners.csv", TARGET)
    names = [photo.name for photo in PHOTOS]
    return subset(corners, np.isin(np.array(corners.images)[corners.image], names))


def subset(corners: Observations, keep) -> Observations:
    return corners.select(keep).only_seen()[0]


def first_pass(corners: Observations, *, exact: bool = True) -> Detection:
    counts = np.bincount(corners.image, minlength=len(corners.images))
    by_name = dict(zip(corners.images, counts.tolist(), strict=True))
    return Detection(
        corners=corners,
        photos=tuple(
            PhotoReport(name=photo.name, corners=by_name.get(photo.name, 0), exact=exact)
            for photo in PHOTOS
        ),
    )


def keys(corners: Observations):
    return {
        (corners.images[i], b, c, r): tuple(p)
        for i, b, c, r, p in zip(
            corners.image.tolist(),
            corners.board.tolist(),
            corners.column.tolist(),
            corners.row.tolist(),
            corners.pixel.tolist(),
            strict=True,
        )
    }


@pytest.fixture(scope="module")
def thinned():
    """Two thirds of the corners, as a first pass might have them."""
    corners = truth()
    return subset(corners, np.random.default_rng(0).random(len(corners.pixel)) < 0.67)


def search_again(first, target, jobs=1):
    return second_pass(PHOTOS, first, predicted_corners(first, target), Work(jobs=jobs))


@pytest.mark.slow
def test_missed_corners_are_added_where_they_are(thinned):
    true = keys(truth())
    detection = search_again(first_pass(thinned), TARGET)
    found, had = keys(detection.corners), keys(thinned)
    assert {name: found[name] for name in had} == had
    added = {name: pixel for name, pixel in found.items() if name not in had}
    missing = true.keys() - had.keys()
    assert len(added.keys() & missing) > 0.97 * len(missing)
    miss = [np.subtract(added[name], true[name]) for name in added.keys() & missing]
    assert np.sqrt(np.mean(np.sum(np.square(miss), axis=1))) < 0.05
    assert sum(photo.added for photo in detection.photos) == len(added)
    assert sum(photo.corners for photo in detection.photos) == len(found)
    assert (np.diff(detection.corners.image) >= 0).all()


@pytest.mark.slow
def test_a_board_that_only_the_second_pass_saw_is_reported(thinned):
    without = subset(thinned, (thinned.image != 0) | (thinned.board != 2))
    detection = search_again(first_pass(without), TARGET)
    report = next(one for one in detection.photos if one.name == without.images[0])
    assert report.boards == TARGET.board_names


@pytest.mark.slow
def test_nothing_is_added_that_no_photo_shows(thinned):
    """What is added beyond the list of true corners lies at the rim of what can be seen."""
    detection = search_again(first_pass(truth()), TARGET)
    assert sum(photo.added for photo in detection.photos) < 0.1 * len(truth().pixel)


@pytest.mark.slow
def test_photos_placed_by_convention_are_left_alone(thinned):
    detection = search_again(first_pass(thinned, exact=False), TARGET)
    assert sum(photo.added for photo in detection.photos) == 0


def reports(corners: Observations) -> tuple[PhotoReport, ...]:
    counts = np.bincount(corners.image, minlength=len(corners.images)).tolist()
    return tuple(
        PhotoReport(name=name, corners=count)
        for name, count in zip(corners.images, counts, strict=True)
    )


def misses(corners: Observations, hidden, target) -> list[float]:
    """How far hidden corners are from where the others say that they are, pixels."""
    kept = subset(corners, ~hidden).with_target(target)
    expected = predicted_corners(Detection(corners=kept, photos=reports(kept)), target)
    true = keys(subset(corners, hidden))
    said = {key: pixel for one in expected.values() for key, pixel in keys(one.corners).items()}
    return [float(np.hypot(*np.subtract(said[key], true[key]))) for key in true.keys() & said]


@pytest.fixture(scope="module")
def one_board() -> tuple[Observations, Target]:
    """Photos that show all corners of a target of one board."""
    target = replace(TARGET, boards=TARGET.boards[:1])
    corners = load_corners(SAMPLE / "true_corners.csv", TARGET)
    corners = subset(corners, corners.board == 0)
    size = target.boards[0].columns * target.boards[0].rows
    photos = np.flatnonzero(np.bincount(corners.image) == size)
    own = subset(corners, np.isin(corners.image, photos))
    return replace(own, boards=target.board_names).with_target(target), target


def test_no_camera_is_fitted_where_all_corners_are_known(one_board, monkeypatch):
    corners, target = one_board
    monkeypatch.setattr(passes, "fit_roughly", lambda _: pytest.fail("a camera is fitted"))
    assert predicted_corners(Detection(corners=corners, photos=reports(corners)), target) == {}


def test_only_photos_that_lack_corners_are_read(one_board, monkeypatch):
    corners, target = one_board
    lacking = subset(corners, (corners.image > 0) | (corners.column > 1))
    first = Detection(corners=lacking, photos=reports(lacking))
    read, how = [], Photo.read_grey
    monkeypatch.setattr(Photo, "read_grey", lambda photo: read.append(photo.name) or how(photo))
    photos = [photo for photo in find_photos([SAMPLE / "photos"]) if photo.name in corners.images]
    detection = second_pass(photos, first, predicted_corners(first, target), Work(jobs=1))
    assert read == [corners.images[0]]
    hidden = keys(corners).keys() - keys(lacking).keys()
    assert len(hidden & keys(detection.corners).keys()) >= len(hidden) - 1


def test_only_boards_that_lack_corners_are_looked_at():
    corners = truth()
    first = first_pass(subset(corners, (corners.board != 1) | (corners.column > 0)))
    expected = predicted_corners(first, TARGET)
    for one in expected.values():
        board = one.corners.board
        assert set(board.tolist()) == set(board[~one.known].tolist())
    assert {len(set(one.corners.board.tolist())) for one in expected.values()} != {3}


@pytest.mark.slow
def test_a_part_of_the_photo_shows_what_the_whole_does(thinned, monkeypatch):
    first = first_pass(thinned)
    part = search_again(first, TARGET).corners
    monkeypatch.setattr(passes, "_MARGIN_PX", 10_000)
    monkeypatch.setattr(passes, "_AROUND", 10000)
    whole = search_again(first, TARGET).corners
    assert keys(part).keys() == keys(whole).keys()
    apart = np.hypot(*(part.pixel - whole.pixel).T)
    assert np.percentile(apart, 99) < 1e-3
    assert apart.max() < 0.1


@pytest.mark.slow
def test_a_lens_that_a_rough_fit_does_not_follow_is_fitted_with_care(monkeypatch):
    """Mirrors that do not stand above their lens are as far from symmetric as this one."""
    target, lens = corner_of_three(), replace(TRUE_LENS, p=(0.01, -0.006), tilt=(0.03, -0.02))
    corners = synthetic_corners(target, poses_around(target, 8, seed=1), lens=lens, noise=0.1)
    hidden = (corners.column == 0) & (corners.image < 4)
    kept = subset(corners, ~hidden).with_target(target)
    assert not isinstance(passes._fit_camera(kept, target), RoughFit)
    plain = synthetic_corners(target, poses_around(target, 8, seed=1), noise=0.1)
    assert isinstance(passes._fit_camera(plain.with_target(target), target), RoughFit)
    off = misses(corners, hidden, target)
    assert len(off) > 0.8 * hidden.sum()
    assert np.percentile(off, 95) < 0.5
    monkeypatch.setattr(passes, "_NEAR_SHARE", np.inf)
    assert np.percentile(misses(corners, hidden, target), 95) > 1.5


@pytest.mark.slow
def test_a_sheet_that_bends_is_followed_by_its_own_corners(monkeypatch):
    target = corner_of_three()
    corners = synthetic_corners(target, poses_around(target, 6, seed=3), noise=0.05)
    # Each board of each photo bends anew, by up to some pixels.
    rng = np.random.default_rng(5)
    amount = rng.normal(0, 2.0, (len(corners.images), len(target.boards), 2))
    away = np.square((corners.column - 4) / 4)[:, None]
    bent = replace(corners, pixel=corners.pixel + away * amount[corners.image, corners.board])
    hidden = (corners.column >= 7) & (rng.random(len(corners.pixel)) < 0.3)
    followed = np.median(misses(bent, hidden, target))
    monkeypatch.setattr(passes, "_find_shared_miss", lambda *_: 0.0)
    assert followed < 0.75 * np.median(misses(bent, hidden, target))


def test_without_a_camera_the_first_pass_stands(thinned):
    few = first_pass(subset(thinned, np.arange(len(thinned.pixel)) < 12))
    assert search_again(few, TARGET) is few


@pytest.mark.slow
def test_processes_do_not_change_the_result(thinned):
    one = search_again(first_pass(thinned), TARGET)
    two = search_again(first_pass(thinned), TARGET, jobs=2)
    np.testing.assert_array_equal(one.corners.pixel, two.corners.pixel)


def test_boards_of_tags_alone_have_no_second_pass():
    detection = first_pass(truth())
    tags = replace(TARGET, boards=tuple(as_type(b, "aprilgrid") for b in TARGET.boards))
    assert search_again(detection, tags) is detection


@pytest.mark.slow
def test_boards_of_the_other_colours_are_looked_at_as_they_are(thinned):
    """What the first pass saw of the colours counts, not what the target says."""
    others = {"dark": "light", "light": "dark"}
    wrong = replace(
        TARGET,
        boards=tuple(replace(b, first_square=others[b.first_square]) for b in TARGET.boards),
    )
    first = first_pass(thinned)
    right = search_again(first, TARGET)
    seen = search_again(replace(first, other_colours=True), wrong)
    np.testing.assert_array_equal(seen.corners.pixel, right.corners.pixel)
    assert len(seen.corners.pixel) > len(thinned.pixel)
