"""The lens beside another one that sees nearly the same."""

from dataclasses import replace

import numpy as np
from lenses import radial_camera

from cubicfish.models.sphere import cone_rays
from cubicfish.solve.fit_lens import lens_beside, nearest_lens

LENS = radial_camera(95.0)
RAYS = cone_rays(np.deg2rad(80), 300)


def test_the_lens_beside_is_found_to_the_last_digits():
    start = replace(LENS, fx=1.03 * LENS.fx, cy=LENS.cy - 4, k=0.8 * LENS.k)
    found = lens_beside(start, RAYS, LENS.project(RAYS))
    np.testing.assert_allclose(found.project(RAYS), LENS.project(RAYS), atol=1e-6)


def test_it_is_the_nearest_one_and_what_is_fixed_stays():
    pixel = LENS.project(RAYS) + np.random.default_rng(1).normal(size=(len(RAYS), 2))
    fixed = ["k4", "cx"]
    start = replace(LENS, cx=LENS.cx + 3)
    found = lens_beside(start, RAYS, pixel, fixed=fixed)
    wanted = nearest_lens([start], RAYS, pixel, fixed=fixed)
    np.testing.assert_allclose(found.parameters, wanted.parameters, rtol=1e-3, atol=1e-3)
    assert (found.cx, found.k[3]) == (start.cx, start.k[3])
