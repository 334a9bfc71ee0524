"""OpenCV's pinhole lens, against OpenCV."""

import cv2
import numpy as np
import pytest

from cubicfish_cli.extensions.formats.lenses import PinholeLens

K = np.array([[812.0, 0, 645.5], [0, 807.5, 355.2], [0, 0, 1]])
# k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau x, tau y: each says something.
D = np.array(
    [-0.21, 0.06, 0.013, -0.021, 0.011, 0.04, -0.03, 0.02, 4e-3, -3e-3, 2e-3, 5e-3, 0.02, -0.03]
)
RNG = np.random.default_rng(4)
POINTS = np.column_stack([RNG.uniform(-0.9, 0.9, (500, 2)), RNG.uniform(0.8, 3, 500)])


def lens(d: np.ndarray) -> PinholeLens:
    fx, _, cx, _, fy, cy = K[:2].ravel()
    return PinholeLens(image_size=(1280, 720), fx=fx, fy=fy, cx=cx, cy=cy, d=d)


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_every_term_is_opencvs(count: int) -> None:
    d = D[:count]
    theirs, _ = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), K, d if count else None)
    np.testing.assert_allclose(lens(d).project(POINTS), theirs[:, 0], atol=1e-8)


def test_nothing_behind_the_camera_is_seen() -> None:
    pixel = lens(D).project(POINTS * [1, 1, -1])
    assert np.isnan(pixel).all()
