"""Cameras that look into a mirror which is not centred on them."""

import numpy as np
import pytest
import synthetic
from decentred_mirror import DecentredMirror

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.evaluate import evaluate
from cubicfish.fit.nearest_cubic import nearest_decentred_cubic
from cubicfish.fit.prior import tie_to
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.solve.statistics import rms_px
from cubicfish.solve.subset import world_scale

LENS = DecentredMirror(shift_mm=(2.0, -1.0), tilt_deg=(-5.0, -3.0))
TARGET = synthetic.flat_board()
NOISE = 0.05


def photos(count, seed):
    poses = synthetic.poses_around(TARGET, count, seed=seed, off_axis_deg=95)
    return synthetic.synthetic_correspondences(
        TARGET, poses, lens=LENS, image_size=LENS.image_size, noise=NOISE, seed=seed
    )


@pytest.fixture(scope="module")
def pairs():
    return photos(20, 2)


@pytest.fixture(scope="module")
def reference(pairs):
    return fit_radial(pairs.with_world(pairs.world / world_scale(pairs)))


@pytest.mark.parametrize("distance", [50.0, 300.0, 3000.0])
def test_a_point_is_seen_where_its_ray_comes_from(distance):
    pixel = np.random.default_rng(0).uniform((150, 50), (800, 650), (200, 2))
    start, way = LENS.rays(pixel)
    seen = LENS.project(start + distance * way)
    known = np.isfinite(seen[:, 0])
    assert known.sum() > 150
    np.testing.assert_allclose(seen[known], pixel[known], atol=1e-6)
    # Its rays do not go through one point, and it is no lens of one axis.
    passed = np.linalg.norm(np.cross(start, way)[known], axis=1)
    assert np.ptp(passed) > 1.0


@pytest.mark.slow
def test_a_mirror_that_is_not_centred_is_met_although_no_radial_lens_is_near(pairs):
    found = calibrate(pairs, target=TARGET, refine_target="off", hold_out=False)
    assert found.fit.radial_rms_px > 1.5
    assert found.fit.rms_px < 0.095
    assert evaluate(found.camera, photos(30, 99)).errors.rms_px < 0.14


def test_the_prior_of_an_asymmetric_lens_is_that_of_its_own_cubic(reference):
    radial, bent = tie_to(reference, 0.0), tie_to(reference, 1e-2)
    assert radial.near is reference.cubic
    # It counts by its own noise.
    assert bent.denominator_weight < 0.2 * radial.denominator_weight
    for prior in (radial, bent):
        near = prior.near
        miss = near.lens.far(near.rays) - prior.lens.project(near.rays) - near.miss
        assert rms_px(miss[near.within]) < 0.3
        assert pole_or_fold_deg(near.lens.P, np.rad2deg(reference.covered)) is None
    shares = bent.near.values @ np.column_stack(
        [one.near.lens.coefficients[2] for one in (bent, radial)]
    )
    assert np.abs(shares[:, 0] / shares[:, 1] - 1).max() > 0.3


def test_where_a_bent_lens_has_no_sound_cubic_the_radial_lenss_stays(reference):
    near = reference.cubic
    mirrored = 2 * near.lens.centre - near.lens.far(near.rays)
    turned = mirrored * [-1, 1] + [2 * near.lens.centre[0], 0]
    blind = np.full_like(turned, np.inf)
    for pixel in (turned, blind):
        assert nearest_decentred_cubic(near, pixel, 0.1, 100.0).lens is near.lens
