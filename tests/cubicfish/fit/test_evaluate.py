"""Evaluating a known camera: poses refitted, the lens fixed."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from lenses import cubic_camera

from cubicfish.errors import FitError
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.evaluate import evaluate
from cubicfish.solve.subset import select

TARGET = synthetic.box_of_four()


@pytest.fixture(scope="module")
def camera():
    return cubic_camera(98.0, bend=0.002)


@pytest.fixture(scope="module")
def pairs(camera):
    poses = synthetic.poses_around(TARGET, 6, seed=2)
    return synthetic.synthetic_correspondences(TARGET, poses, lens=camera, noise=0.1, seed=3)


def test_error_is_the_noise_for_the_true_camera(camera, pairs):
    result = evaluate(camera, pairs)
    assert result.errors.corners == len(pairs.pixel)
    assert result.outside == 0
    expected = 0.1 * np.sqrt(2 - 36 / len(pairs.pixel))
    assert result.errors.rms_px == pytest.approx(expected, rel=0.04)
    record = result.as_record()
    assert record["images"] == 6
    assert len(record["per_image"]) == 6
    total = sum(row["rms_px"] ** 2 * row["corners"] for row in record["per_image"])
    assert np.sqrt(total / len(pairs.pixel)) == pytest.approx(result.errors.rms_px)


def test_a_wrong_camera_shows(camera, pairs):
    P = camera.P.copy()
    P[0] *= 1 + 0.02 * np.linspace(-1, 1, 20)
    assert evaluate(replace(camera, P=P), pairs).errors.rms_px > 0.3


def test_corners_beyond_the_field_are_counted_not_used(camera, pairs):
    narrow = replace(camera, max_angle_deg=60.0)
    result = evaluate(narrow, pairs)
    assert result.outside > 0
    assert result.errors.corners + result.outside == len(pairs.pixel)
    assert result.errors.rms_px == pytest.approx(0.14, rel=0.1)


def test_outliers_do_not_pull_the_poses(camera, pairs):
    spoilt = replace(pairs, pixel=pairs.pixel.copy())
    spoilt.pixel[::40] += 25
    spoilt.pixel[20::40] -= 25
    result = evaluate(camera, spoilt)
    assert result.errors.median_px == pytest.approx(0.12, rel=0.15)
    assert result.errors.max_px > 30


def test_another_size_is_refused(camera, pairs):
    with pytest.raises(FitError, match=r"640x480.*960x720"):
        evaluate(camera, replace(pairs, image_size=(640, 480)))


def test_photos_with_too_few_corners_are_named(camera, pairs):
    keep = (pairs.image != 2) | (np.arange(len(pairs.image)) % 100 == 0)
    few, _ = select(pairs, keep)
    assert evaluate(camera, few).unplaced == ("02.png",)
    with pytest.raises(FitError, match="enough corners"):
        evaluate(camera, select(pairs, np.arange(len(pairs.image)) < 4)[0])


@pytest.mark.slow
def test_a_calibration_evaluates_as_it_was_fitted(pairs):
    result = calibrate(pairs, hold_out=False)
    again = evaluate(result.camera, pairs)
    assert again.errors.rms_px == pytest.approx(result.errors.rms_px, rel=1e-3)
