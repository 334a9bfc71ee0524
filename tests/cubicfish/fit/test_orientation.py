"""Photos of a board that looks the same after a turn are named the way round its print says."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import synthetic
from symmetric_board import drawn, misnamed, photos

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.calibration import Calibration
from cubicfish.fit.evaluate import evaluate
from cubicfish.fit.held_out import HeldOut
from cubicfish.fit.model_selection import better_named
from cubicfish.target.placement import symmetries


@cache
def fit_by_true_names(columns: int, rows: int, count: int) -> Calibration:
    truth = photos(columns, rows, 0.1, count)
    return calibrate(truth, target=drawn(columns, rows), refine_target="points")


@pytest.mark.parametrize(
    ("columns", "rows", "count"), [(6, 4, 10), pytest.param(4, 4, 24, marks=pytest.mark.slow)]
)
def test_names_by_chance_are_made_those_of_one_print(columns: int, rows: int, count: int) -> None:
    target = drawn(columns, rows)
    truth = photos(columns, rows, 0.1, count)
    given, way = misnamed(truth, target)
    motions = symmetries(target)
    assert set(way) == set(range(len(motions) + 1))
    right = fit_by_true_names(columns, rows, count)
    found = calibrate(given, target=target, refine_target="points")
    # All photos are named as they are, or all are turned alike.
    said = found.named(given)
    ways = [truth, *(motion.named(truth, target) for motion in motions)]
    assert any((said.column == one.column).all() and (said.row == one.row).all() for one in ways)
    # Those that are named as most are keep their names.
    assert 0 < len(found.renamed) <= count - np.bincount(way).max()
    assert found.as_record()["renamed_images"] == list(found.renamed)
    assert found.errors.rms_px == pytest.approx(right.errors.rms_px, rel=0.01)
    assert found.held_out is not None
    assert right.held_out is not None
    assert found.held_out.rms_px == pytest.approx(right.held_out.rms_px, rel=0.02)
    # The pairs that were used have these names, and poses that go with them.
    used = found.pairs
    points = found.poses.apply(used.image, used.world)
    residual = found.camera.project(points, near=True) - used.pixel
    np.testing.assert_allclose(residual, found.residual, atol=1e-3)


@pytest.mark.slow
def test_a_print_that_is_exact_loses_nothing_by_it() -> None:
    """There is nothing to tell names by, and nothing that hangs on them."""
    target = drawn(6, 4)
    truth = photos(6, 4, 0.0)
    given, _ = misnamed(truth, target)
    right, found = (calibrate(one, target=target, refine_target="points") for one in (truth, given))
    assert found.held_out is not None
    assert right.held_out is not None
    assert found.held_out.rms_px < 1.05 * right.held_out.rms_px


@pytest.mark.slow
def test_a_board_without_symmetry_keeps_its_names() -> None:
    target = drawn(7, 4)
    given = photos(7, 4, 0.1)
    found = calibrate(given, target=target, refine_target="points", hold_out=False)
    assert found.as_record()["renamed_images"] == []
    assert found.named(given) is given


@pytest.mark.slow
def test_corners_that_may_be_others_keep_their_names() -> None:
    target = drawn(6, 4)
    given, _ = misnamed(photos(6, 4, 0.1), target)
    doubtful = next(iter(calibrate(given, target=target, refine_target="points").renamed))
    given = replace(given, certain=given.image != given.images.index(doubtful))
    found = calibrate(given, target=target, refine_target="points")
    assert found.renamed
    assert doubtful not in found.renamed


def test_names_that_photos_left_out_speak_against_are_not_taken() -> None:
    given, better, worse = (
        HeldOut(square=np.full(4, px**2), radial_square=np.ones(4), image=np.arange(4), folds=3)
        for px in (0.2, 0.1, 0.3)
    )
    for likelier, taken in ((better, better), (worse, given), (None, given)):
        fits = [SimpleNamespace(held_out=one) for one in (given, likelier)]
        assert better_named(fits).held_out is taken
    assert better_named(fits[:1]).held_out is given


@pytest.mark.slow
def test_a_refined_board_says_which_way_round_new_photos_show_it() -> None:
    target = drawn(6, 4)
    truth = photos(6, 4, 0.1)
    found = fit_by_true_names(6, 4, 10)
    assert found.target is not None
    given, _ = misnamed(truth, target)
    by_truth, by_chance = (
        evaluate(found.camera, one.with_target(found.target)) for one in (truth, given)
    )
    assert by_chance.errors.rms_px == pytest.approx(by_truth.errors.rms_px, rel=1e-6)
    # As drawn there is nothing to tell: the error is what it was, and larger.
    nominal = evaluate(found.camera, given.with_target(target))
    assert nominal.errors.rms_px > 1.1 * by_chance.errors.rms_px
    np.testing.assert_array_equal(nominal.pairs.column, given.column)


@pytest.mark.slow
def test_dropped_corners_have_the_names_of_the_others() -> None:
    target = drawn(6, 4)
    given, way = misnamed(photos(6, 4, 0.1), target)
    # Whichever way round most photos are named, one of two photos is named otherwise.
    rows = [int(np.flatnonzero(given.image == way.index(one))[3]) for one in (0, 1)]
    pixel = given.pixel.copy()
    pixel[rows] += 20
    given = replace(given, pixel=pixel)
    found = calibrate(given, target=target, refine_target="points")
    assert sum(given.images[given.image[row]] in found.renamed for row in rows) == 1
    said = found.named(given)
    dropped = {(one.image, one.column, one.row) for one in found.fit.dropped_corners}
    assert dropped == {
        (given.images[given.image[row]], int(said.column[row]), int(said.row[row])) for row in rows
    }


@pytest.mark.slow
def test_a_box_of_which_some_boards_are_never_seen() -> None:
    """By other names photos show boards that no photo shows by the names given."""
    box = synthetic.box_of_four()
    assert symmetries(box)
    pairs = synthetic.synthetic_corners(
        box, synthetic.poses_around(box, 8, seed=21), noise=0.05, seed=21
    ).with_target(box)
    pairs = pairs.select(pairs.board < 2).only_seen()[0]
    found = calibrate(pairs, target=box, refine_target="points")
    assert found.refined == "points"
    assert found.errors.rms_px < 0.1


@pytest.mark.parametrize(
    "noise", [0.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (1e-12, 1e-3))]
)
def test_corners_without_errors_keep_their_names_and_their_fit(noise: float) -> None:
    target = drawn(6, 4)
    poses = synthetic.poses_around(target, 6, seed=2)
    exact = synthetic.synthetic_corners(target, poses, noise=noise, seed=2).with_target(target)
    found = calibrate(exact, target=target, refine_target="points")
    assert found.errors.rms_px < 0.01
