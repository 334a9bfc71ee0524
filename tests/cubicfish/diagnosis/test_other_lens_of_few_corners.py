"""Photos of another lens with so few corners that any lens fits some of them."""

import numpy as np
import wrong_setups as wrong

from cubicfish.calibration import calibrate
from cubicfish.judge.codes import Code


def test_a_zoom_is_named_though_its_photos_lost_corners_and_were_not_left_out():
    setup = wrong.mixed(np.random.default_rng([51, 815]), 2.5, 0, half_way=True)
    made = calibrate(setup.corners, setup.target, refine_target="off", hold_out=False)
    assert list(made.unfit) == ["10.png"]  # of four corners, which say nothing of the order either
    (found,) = made.findings
    assert (found.code, found.figures["where"]) == (Code.ZOOM, "from")
    assert found.images[0] == "08.png"
    np.testing.assert_allclose(found.figures["focal_off"], 1.5, atol=0.02)
