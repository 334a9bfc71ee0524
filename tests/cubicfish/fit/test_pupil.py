"""A lens whose entrance pupil wanders is right far away, though its photos were taken near by."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from synthetic_lenses import SyntheticLens, synthetic_lens

from cubicfish.comparison import aligned_difference
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.calibration import Calibration
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.evaluate import evaluate
from cubicfish.fit.prior import Prior
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.models.sphere import cone_rays, ray_at
from cubicfish.solve.statistics import rms_px
from cubicfish.solve.subset import world_scale
from cubicfish.target.observations import Observations

TARGET = synthetic.box_of_four(8)
PHOTOS = 12
COUNTED = cone_rays(np.radians(80), 1000)


def photos(lens: SyntheticLens, *, noise: float = 0.05, seed: int = 5) -> Observations:
    """Corners whose errors are in part those of their photo: a shift of blurred edges."""
    pairs = synthetic.synthetic_correspondences(
        TARGET,
        synthetic.poses_around(TARGET, PHOTOS, seed=seed),
        lens=lens,
        image_size=lens.image_size,
        noise=noise,
        seed=seed,
    )
    shared = np.random.default_rng(seed).normal(size=(PHOTOS, 2, 2)) * noise / lens.image_size[0]
    off = pairs.pixel - np.array(lens.image_size) / 2
    return replace(pairs, pixel=pairs.pixel + np.einsum("nij,nj->ni", shared[pairs.image], off))


def off_far_away(found: Calibration, lens: SyntheticLens) -> float:
    """RMS distance to the lens as it sees what is far away, pixels."""
    miss, _ = aligned_difference(found.camera, lens.far, COUNTED)
    return float(np.sqrt(np.nanmean(np.sum(miss**2, axis=1))))


@pytest.fixture(scope="module")
def lens() -> SyntheticLens:
    lens = synthetic_lens("moving-pupil")
    return replace(lens, profile=replace(lens.profile, pupil_mm=4.0))


@pytest.fixture(scope="module")
def found(lens: SyntheticLens) -> Calibration:
    return calibrate(photos(lens), target=TARGET, refine_target="off", hold_out=False)


def test_a_pupil_that_wanders_is_found(found: Calibration, lens: SyntheticLens) -> None:
    assert found.camera.units == "mm"
    assert found.camera.pupil_travel == pytest.approx(lens.profile.pupil_mm, rel=0.25)
    assert off_far_away(found, lens) < 0.15
    record = found.as_record()["pupil"]
    assert record["units"] == "mm"
    # At the corners' distance this much of it is seen.
    point = record["distance"] * ray_at(np.full(1, np.radians(found.fit.covered_deg)), np.zeros(1))
    near, far = lens.project(point), lens.project(1e7 * point)
    assert record["rim_px"] == pytest.approx(np.linalg.norm(near - far), rel=0.3)


def test_other_photos_are_told_better_with_it(found: Calibration, lens: SyntheticLens) -> None:
    others = photos(lens, seed=6)
    reported = evaluate(found.camera, others).errors.rms_px
    central = replace(found.camera, pupil_travel=0.0)
    assert reported < 0.8 * evaluate(central, others).errors.rms_px
    in_cm = replace(found.camera, pupil_travel=found.camera.pupil_travel / 10, units="cm")
    assert evaluate(in_cm, others.with_target(TARGET)).errors.rms_px == pytest.approx(reported)


@pytest.mark.slow
def test_a_central_lens_stays_central() -> None:
    """Within what its photos leave open."""
    lens = synthetic.TRUE_LENS
    pairs = synthetic.synthetic_correspondences(
        TARGET, synthetic.poses_around(TARGET, PHOTOS, seed=1), lens=lens, noise=0.1, seed=1
    )
    found = calibrate(pairs, target=TARGET, refine_target="off", hold_out=False)
    assert abs(found.fit.pupil.rim_px) < 0.1


@pytest.mark.slow
def test_it_stands_still_where_that_is_how_p_is_held(lens: SyntheticLens) -> None:
    pairs = photos(lens)
    reference = fit_radial(replace(pairs, world=pairs.world / world_scale(pairs)))
    free = fit_cubic(reference, Prior(spread=1e-3, weight=1.0))
    still = fit_cubic(reference, replace(free.prior, central=True), start=free)
    assert free.lens.pupil_travel > 1e-3
    assert abs(still.lens.pupil_travel) < 1e-9
    assert rms_px(still.residual) > 1.1 * rms_px(free.residual)
    # And wanders again where it may.
    again = fit_cubic(reference, free.prior, start=still)
    assert again.lens.pupil_travel == pytest.approx(free.lens.pupil_travel, rel=1e-3)
