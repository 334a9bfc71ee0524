"""Photos that were saved mirrored or turned by 180°, of a board that looks the same then."""

import re

import numpy as np
import pytest
import wrong_setups as wrong

from cubicfish.calibration import calibrate
from cubicfish.judge.codes import Code, Severity

MIRRORED, TURNED = (Code.MIRRORED, "by_lens"), (Code.TURNED, "")


@pytest.mark.parametrize(
    ("ways", "expected"),
    [
        ((), []),
        (("mirrored",), [MIRRORED]),
        (("turned",), [TURNED]),
        (("turned", "mirrored"), [TURNED, MIRRORED]),
    ],
)
def test_photos_that_were_saved_otherwise_are_named(ways, expected):
    setup = wrong.one_otherwise(np.random.default_rng(1), *ways)
    made = calibrate(setup.corners, setup.target, hold_out=False)
    assert [(one.code, one.case) for one in made.findings] == expected
    photos = [re.findall(r"\d\d\.png", says)[0] for says in setup.says]
    assert [one.images for one in made.findings] == [(photo,) for photo in photos]
    # A photo that was left out by itself says nothing against the camera.
    for one in made.findings:
        assert (one.severity is Severity.NOTE) == (one.images[0] in made.unfit)


@pytest.mark.parametrize("off", [(4.0, 4.0), (8.0, 8.0)])
def test_a_mirrored_photo_is_named_where_the_centre_is_nearly_in_the_middle(off):
    """It has little more error than the others: most of what all have together is noise."""
    setup = wrong.one_otherwise(np.random.default_rng(2), "mirrored", off=off)
    (found,) = calibrate(setup.corners, setup.target, hold_out=False).findings
    assert (found.code, found.images) == (Code.MIRRORED, ("09.png",))


def test_a_mirror_and_half_a_turn_are_the_same_where_the_centre_is_off_along_one_side(monkeypatch):
    straight = wrong.lens_of
    monkeypatch.setattr(
        wrong, "lens_of", lambda rng: wrong.replace(straight(rng), p=(0, 0), tilt=(0, 0))
    )
    setup = wrong.one_otherwise(np.random.default_rng(1), "turned", off=(20.0, 0.0))
    (found,) = calibrate(setup.corners, setup.target, hold_out=False).findings
    assert (found.code, found.case) == (Code.MIRRORED, "or_turned")
