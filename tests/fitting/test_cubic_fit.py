"""The cubic's start: no pole that corners happen to miss."""

import numpy as np
import pytest
import synthetic
from simulated import CornerErrors, simulated_corners

from cubicfish_cli.fitting import cubic_fit
from cubicfish_cli.fitting.cubic_fit import fit_cubic
from cubicfish_cli.fitting.hold import EXPECTED
from cubicfish_cli.fitting.radial_reference import MARGIN_DEG, fit_radial
from cubicfish_cli.fitting.subset import world_scale
from cubicfish_cli.lenses.asymmetric import AsymmetricLens
from cubicfish_cli.lenses.cubic import check_validity
from cubicfish_cli.target import Target

TARGET = Target(units="mm", boards=(synthetic.checkerboard("board", 9, 6, 30.0),))


@pytest.mark.parametrize(("photos", "seed"), [(6, 14), (6, 33)])
def test_a_pole_that_corners_miss_is_no_start(photos, seed):
    """Of a narrow lens whose profile bends up and down again: denominator and numerators vanish."""
    lens = AsymmetricLens(
        image_size=(640, 480), fx=540.0, fy=539.0, cx=330.6, cy=245.2,
        k=(0.08823282, -0.46934271, 1.42274144, -1.53901124), max_angle_deg=36.0,
    )  # fmt: skip
    seen, _ = simulated_corners(lens, TARGET, photos, seed=seed, errors=CornerErrors(noise=0.1))
    seen = seen.with_target(TARGET)
    reference = fit_radial(seen.with_world(seen.world / world_scale(seen)))
    cone = float(np.rad2deg(cubic_fit._cone(reference, MARGIN_DEG)))
    most_exact, _ = next(cubic_fit._starts(reference, EXPECTED, None))
    assert not check_validity(most_exact.P, cone).valid
    start, _ = cubic_fit._first(reference, EXPECTED, None, None, cone)
    assert check_validity(start.P, cone).valid
    fit = fit_cubic(reference, EXPECTED)
    assert fit.validity.valid
    assert fit.hold == EXPECTED
