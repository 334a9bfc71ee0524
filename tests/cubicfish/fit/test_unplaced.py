"""Photos whose place on the board is not known tell no error once each corner has its own place."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import synthetic_lens

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.held_out import HeldOut
from cubicfish.fit.photo_spread import _group_photos
from cubicfish.judge.codes import Code
from cubicfish.judge.fit_record import FitRecord
from cubicfish.judge.verdict import photo_verdicts
from cubicfish.solve.statistics import photo_weights, rms_px
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.target import Target

NOISE = 0.1
PHOTOS = 8
NOMINAL = Target(units="mm", boards=(synthetic.checkerboard("board", 9, 6, 30.0),))
UNPLACED = [1, 4, 6]


@pytest.fixture(scope="module")
def pairs():
    """Corners of a sheet that is printed unevenly; of some photos it is not known which."""
    offsets = np.random.default_rng(2).normal(0, 0.3, (6, 9, 3)) * [1, 1, 0.5]
    shape = BoardShape(bend=np.zeros(2), twist=0.0, stretch=np.zeros(2), offsets=offsets)
    real = NOMINAL.with_boards({0: replace(NOMINAL.boards[0], shape=shape)})
    errors = CornerErrors(noise=NOISE, shared=0, spread=0)
    corners, _ = simulated_corners(synthetic_lens("equisolid"), real, PHOTOS, seed=2, errors=errors)
    pairs = corners.with_target(NOMINAL)
    return replace(pairs, certain=~np.isin(pairs.image, UNPLACED))


@pytest.fixture(scope="module")
def fit(pairs):
    return calibrate(pairs, target=NOMINAL)


def test_they_are_in_no_figure_of_a_fit(pairs, fit):
    assert fit.refined == "points"
    # Their points follow them: that is no small error, it is none.
    reported, length = fit.pairs.certain, np.hypot(*fit.residual.T)
    assert np.median(length[~reported]) < np.median(length[reported]) / 2
    assert len(fit.pairs.pixel) == len(reported) == fit.errors.corners
    assert fit.errors.rms_px == pytest.approx(rms_px(fit.residual[reported]))
    assert fit.errors.median_px == pytest.approx(np.median(length[reported]))
    assert fit.fit.radial_rms_px > fit.errors.rms_px / 2
    assert fit.fit.uncertainty.noise_px == pytest.approx(NOISE, rel=0.25)
    held_out = fit.held_out
    assert held_out is not None
    assert np.array_equal(np.isnan(held_out.square), ~reported)
    assert np.array_equal(np.isnan(held_out.photos_px), np.isin(np.arange(PHOTOS), UNPLACED))


def test_they_are_listed_without_one(pairs, fit):
    photos = fit.fit.per_image
    for photo, (one, reported) in enumerate(
        zip(photos, photo_verdicts(FitRecord(per_image=photos), pairs.image_size), strict=True)
    ):
        assert one.corners > 0
        unplaced = photo in UNPLACED
        assert np.isnan([one.rms_px, one.median_px, one.p95_px, one.max_px]).tolist() == (
            [unplaced] * 4
        )
        assert (Code.NO_ERROR in [finding.code for finding in reported.reasons]) is unplaced


def test_they_have_errors_where_corners_have_no_places_of_their_own(pairs):
    shape = calibrate(pairs, target=NOMINAL, refine_target="shape", hold_out=False)
    assert all(one.rms_px > NOISE for one in shape.fit.per_image)


def test_where_no_corner_is_certain_all_that_is_left_is_reported(pairs):
    none = replace(pairs, certain=np.zeros(len(pairs.pixel), bool))
    fit = calibrate(none, target=NOMINAL, refine_target="points", hold_out=False)
    assert fit.errors.rms_px == pytest.approx(rms_px(fit.residual))


def test_they_weigh_as_much_as_others_do(pairs):
    residual = np.random.default_rng(3).normal(0, NOISE, pairs.pixel.shape)
    residual[np.isin(pairs.image, [0, 2])] *= 4
    some = replace(pairs, error_known=pairs.certain)
    weight = photo_weights(some, np.where(pairs.certain[:, None], residual, 1e-3))
    np.testing.assert_allclose(weight[UNPLACED], weight[UNPLACED[0]])
    assert weight[0] < weight[UNPLACED[0]] < 2 * weight[3]
    assert weight[pairs.image].mean() == pytest.approx(1)


def test_they_are_no_clusters_that_could_be_left_out(pairs):
    some = replace(pairs, error_known=pairs.certain)
    places = np.array([0, 1, 2, 2, 4, 5, 6, 7])
    found = _group_photos(places, some)
    assert sorted(np.concatenate(found)) == [0, 2, 3, 5, 7]
    assert [2, 3] in [part.tolist() for part in found]
    assert len(_group_photos(places, pairs)) == PHOTOS - 1
    assert not _group_photos(places, replace(pairs, error_known=pairs.image == 3))


def test_errors_are_compared_where_both_are_known():
    square, image = np.array([1.0, 1.0, 9.0, 9.0]), np.array([0, 0, 1, 1])
    whole = HeldOut(square=square, radial_square=square, image=image, folds=2)
    part = replace(whole, square=np.array([1.0, 1.0, np.nan, np.nan]))
    assert part.times(whole) == whole.times(part) == 1
