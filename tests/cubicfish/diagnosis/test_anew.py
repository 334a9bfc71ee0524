"""What is another in every photo, and is told by its cause."""

import numpy as np
import pytest
import wrong_setups as wrong

from cubicfish.calibration import calibrate
from cubicfish.judge.codes import Code, Remedy
from cubicfish.target.observations import Observations


@pytest.mark.parametrize(
    ("make", "code", "remedy"),
    [
        (wrong.bends_anew, Code.BENT, Remedy.TAKE_AGAIN),
        (wrong.moves_all_the_while, Code.PHOTO_LENS, Remedy.HOLD_STILL),
    ],
)
def test_what_is_another_in_every_photo_is_told_by_its_cause(make, code, remedy):
    setup = make(np.random.default_rng(2))
    made = calibrate(setup.corners, setup.target, refine_target="off", hold_out=False)
    (found,) = made.findings
    assert (found.code, found.case, found.remedy) == (code, "anew", remedy)
    # The worst come first.
    rms = {photo.image: photo.rms_px for photo in made.fit.per_image}
    named = [rms[photo] for photo in found.images]
    assert len(named) > len(rms) / 2
    assert named[0] > np.percentile(list(rms.values()), 75)
    assert named[-1] < np.median(list(rms.values()))


@pytest.mark.parametrize("noise", [0.1, 0.7])
def test_the_corners_own_noise_hides_no_cause(noise):
    """It makes most of the squared error of a weak camera, and none of what is beyond noise."""
    setup = wrong.bends_anew(np.random.default_rng(4), noise)
    made = calibrate(setup.corners, setup.target, refine_target="off", hold_out=False)
    (found,) = made.findings
    assert (found.code, found.case) == (Code.BENT, "anew")
    assert found.figures["share"] > 0.8


def test_a_cause_that_leaves_much_of_what_is_beyond_noise_is_not_told():
    """A sheet that waves more than it bends."""
    setup = wrong.bends_anew(np.random.default_rng(4), bend=1.0, waves=1.5)
    made = calibrate(setup.corners, setup.target, refine_target="off", hold_out=False)
    assert made.fit.rms_px > 0.3
    assert not [one for one in made.findings if one.case == "anew"]


def test_a_board_that_stays_bent_is_not_bent_anew():
    setup = wrong.bent(np.random.default_rng(2))
    made = calibrate(setup.corners, setup.target, refine_target="off", hold_out=False)
    assert made.fit.rms_px > 0.5
    assert not [one for one in made.findings if one.case == "anew"]


def test_points_without_a_board_do_not_bend():
    setup = wrong.moves_all_the_while(np.random.default_rng(2))
    pairs = setup.corners.with_target(setup.target)
    photos = [pairs.image == photo for photo in range(len(pairs.images))]
    world, pixel = ([array[own] for own in photos] for array in (pairs.world, pairs.pixel))
    points = Observations.from_points(world, pixel, pairs.image_size)
    (found,) = calibrate(points, hold_out=False).findings
    assert (found.code, found.case) == (Code.PHOTO_LENS, "anew")
