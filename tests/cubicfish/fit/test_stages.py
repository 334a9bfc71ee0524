"""What a fit tells of how far it is."""

import numpy as np
import pytest
from samples import SAMPLE

from cubicfish.fit.calibrate import calibrate
from cubicfish.io.corners_csv import load_corners
from cubicfish.solve.subset import select_photos
from cubicfish.target.target import Target


def reported(**options: object) -> list[tuple[str, float]]:
    target = Target.load(SAMPLE / "target.yaml")
    pairs = load_corners(SAMPLE / "true_corners.csv", target)
    few = select_photos(pairs, np.arange(4))
    said: list[tuple[str, float]] = []
    calibrate(few, target=target, progress=lambda *one: said.append(one), **options)  # type: ignore[arg-type]
    return said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "last", "some"),
    [
        ({"hold_out": False}, "what may be wrong", "the cubic camera"),
        ({"refine_target": "off"}, "what may be wrong", "held-out photos (4 of 4)"),
        ({}, "what may be wrong", "boards' shapes, held-out photos (3 of 4)"),
    ],
)
def test_a_fit_tells_its_stages_in_order(options: dict[str, object], last: str, some: str) -> None:
    said = reported(**options)
    words, shares = zip(*said, strict=True)
    assert words[0] == "poses and a radial lens"
    assert words[-1] == last
    assert some in words
    assert shares[0] == 0
    assert list(shares) == sorted(shares)
    assert 0.5 < shares[-1] < 1
    assert len(set(words)) == len(words)
