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
