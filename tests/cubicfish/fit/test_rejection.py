"""Corners that are left out: slips of detection, and not what neighbours share."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.rejection import strays

NOISE = 0.03
TARGET = synthetic.corner_of_three()


@pytest.fixture(scope="module")
def pairs():
    poses = synthetic.poses_around(TARGET, 6, seed=3)
    return synthetic.synthetic_correspondences(TARGET, poses, noise=NOISE, seed=4)


def noise_of(pairs, seed=5):
    return np.random.default_rng(seed).normal(0, NOISE, pairs.pixel.shape)


def test_a_slip_is_found_wherever_neighbours_say_so(pairs):
    residual = noise_of(pairs)
    slips = np.random.default_rng(6).choice(len(residual), 12, replace=False)
    residual[slips] += [0.6, -0.5]
    found = strays(pairs, residual)
    assert set(np.flatnonzero(found)) <= set(slips)
    # Corners of a board's tip have too few neighbours to tell.
    assert found.sum() >= 10


def test_what_neighbours_share_is_no_slip(pairs):
    residual = noise_of(pairs)
    bent = (pairs.image == 2) & (pairs.board == 1)
    slope = 0.05 * pairs.column[bent] ** 2
    residual[bent] += np.stack([slope, -slope], axis=1)
    assert np.hypot(*residual[bent].T).max() > 1
    assert not strays(pairs, residual).any()


def test_a_noisy_photo_is_judged_by_its_own_noise(pairs):
    residual = noise_of(pairs)
    residual[pairs.image == 4] *= 8
    assert not strays(pairs, residual).any()


def test_corners_without_a_board_are_none(pairs):
    alone = replace(pairs, boards=(), board=np.full_like(pairs.board, -1))
    residual = noise_of(pairs)
    residual[7] += 5
    assert not strays(alone, residual).any()


@pytest.mark.slow
def test_a_calibration_leaves_slips_out_and_says_which(pairs):
    slips = np.random.default_rng(8).choice(len(pairs.pixel), 10, replace=False)
    pixel = pairs.pixel.copy()
    pixel[slips] += [0.9, 0.7]
    clean, spoilt = calibrate(pairs), calibrate(replace(pairs, pixel=pixel))
    key = np.stack([pairs.image, pairs.board, pairs.column, pairs.row], axis=1)[slips]
    wrong = {
        (pairs.images[image], pairs.boards[board], int(column), int(row))
        for image, board, column, row in key
    }
    left_out = {(one.image, one.board, one.column, one.row) for one in spoilt.fit.dropped_corners}
    assert left_out <= wrong
    assert len(left_out) >= 8
    assert all(one.error_px == pytest.approx(1.14, abs=0.3) for one in spoilt.fit.dropped_corners)
    assert not clean.fit.dropped_corners
    counted, of_clean = (np.isfinite(one.held_out.square).sum() for one in (spoilt, clean))
    assert counted == of_clean - len(left_out)
    # With all of them it would be three times as much.
    assert spoilt.held_out.rms_px < 2 * clean.held_out.rms_px
