"""The second pass adds corners that the photos show and the first pass missed, and no others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import as_type

from cubicfish_cli.app.detection import second_pass
from cubicfish_cli.app.executors.pool import Work
from cubicfish_cli.app.photos import find_photos
from cubicfish_cli.core.io.observations_csv import load_corners
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import load_target
from cubicfish_cli.corners.identification.identified import Detection, PhotoReport
from cubicfish_cli.corners.identification.second_pass import predicted_corners

SAMPLE = Path(__file__).parents[3] / "sample_data"
TARGET = load_target(SAMPLE / "target.yaml")
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
