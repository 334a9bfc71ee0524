"""Every lens model by one contract."""

from dataclasses import replace

import numpy as np
import pytest
from lenses import cubic_camera, radial_camera, random_rays

from cubicfish.angles import unit_rays
from cubicfish.fit.exported_lens import lens_near
from cubicfish.models import angle_from_axis
from cubicfish.solve import nearest_lens
from cubicfish.solve.fit_lens import FreeLens
from cubicfish_cli.extensions.formats.colmap_cameras import (
    RadialPolyLens,
    RadTanThinPrismLens,
    ThinPrismLens,
)
from cubicfish_cli.extensions.formats.lenses import DoubleSphereLens, PinholeLens, UnifiedLens
from cubicfish_cli.extensions.formats.mrcal_splined import SplinedLens
from cubicfish_cli.extensions.formats.ocamcalib import ScaramuzzaLens
from cubicfish_cli.extensions.formats.simulators import Fisheye624Lens, FThetaLens

LENSES = (
    DoubleSphereLens,
    Fisheye624Lens,
    FThetaLens,
    PinholeLens,
    RadTanThinPrismLens,
    RadialPolyLens,
    ScaramuzzaLens,
    SplinedLens,
    ThinPrismLens,
    UnifiedLens,
)
RADIAL = radial_camera(100.0)
WIDE_DEG = 94


def bent(kind):
    """A lens of the kind near RADIAL with every free parameter off its special place."""
    lens = kind.starts(RADIAL, np.deg2rad(WIDE_DEG + 1))[0]
    free = FreeLens.of(lens)
    parameters = free.parameters
    scale = np.maximum(np.abs(parameters), 0.02)
    rng = np.random.default_rng(4)
    return free.with_parameters(parameters + 0.02 * scale * rng.uniform(-1, 1, scale.shape)).lens


@pytest.fixture(scope="module", params=LENSES, ids=lambda kind: kind.name)
def lens(request):
    return bent(request.param)


def field_deg(lens):
    """How far out a model is asked: a pinhole sees nothing at 90° from its axis."""
    return 60 if isinstance(lens, PinholeLens) else WIDE_DEG


def points(lens):
    near_axis = [[0, 0, 1], [1e-8, -2e-8, 1], [1e-3, 2e-3, 1]]
    rays = np.vstack([random_rays(field_deg(lens), 60), near_axis])
    return rays * np.random.default_rng(1).uniform(0.5, 3, (len(rays), 1))


def test_names_are_unique():
    for names in ([kind.name for kind in LENSES], [kind.label for kind in LENSES]):
        assert len(set(names)) == len(LENSES)


def test_parameters_are_named_and_go_back_in(lens):
    parameters = lens.parameters
    assert len(set(lens.parameter_names)) == len(parameters) == len(lens.units)
    assert {*lens.fixed, *lens.unwritten, *lens.limits} <= {*lens.parameter_names}
    other = lens.with_parameters(parameters + lens.units)
    np.testing.assert_array_equal(other.parameters, parameters + lens.units)
    again = other.with_parameters(parameters)
    np.testing.assert_array_equal(again.project(points(lens)), lens.project(points(lens)))


def test_rays_and_pixels_go_both_ways(lens):
    at = points(lens)
    pixel = lens.project(at)
    assert np.isfinite(pixel).all()
    np.testing.assert_allclose(lens.unproject(pixel), unit_rays(at), atol=1e-8)
    np.testing.assert_allclose(lens.project(lens.unproject(pixel)), pixel, atol=1e-6)


def test_shapes_are_kept(lens):
    at = points(lens)[:60].reshape(5, 4, 3, 3)
    pixel = lens.project(at)
    assert pixel.shape == (5, 4, 3, 2)
    assert lens.unproject(pixel).shape == at.shape


def test_outside_the_field_is_nan(lens):
    behind = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])
    assert np.isnan(lens.project(behind)).all()
    everywhere = lens.project(random_rays(180, 2000))
    assert not np.isinf(everywhere).any()
    assert np.isnan(lens.unproject([[np.nan, 1.0], [1e9, -1e9]])).all()
    width, height = lens.image_size
    grid = np.random.default_rng(3).uniform(-3, 4, (400, 2)) * [width, height]
    rays = lens.unproject(grid)
    seen = np.isfinite(rays[:, 0])
    assert seen.any()
    assert angle_from_axis(rays[seen]).max() <= lens.max_angle + 1e-9
    np.testing.assert_allclose(lens.project(rays[seen]), grid[seen], atol=1e-5)


def test_derivatives_by_the_point(lens):
    at = points(lens)
    pixel, slope, _ = lens.pixel_and_slopes(at)
    np.testing.assert_allclose(lens.project(at), pixel, atol=1e-9)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-5
        numeric = (lens.project(at + step) - lens.project(at - step)) / 2e-5
        np.testing.assert_allclose(slope[:, :, axis], numeric, atol=2e-4, rtol=1e-6)
    np.testing.assert_allclose(lens.pixel_and_slope(at)[1], slope, atol=1e-9)


def test_length_of_a_point_does_not_matter(lens):
    rays = random_rays(field_deg(lens), 40)
    np.testing.assert_allclose(lens.project(7 * rays), lens.project(rays), atol=1e-8)
    slope = lens.pixel_and_slopes(rays)[1]
    np.testing.assert_allclose((slope @ rays[:, :, None]), 0, atol=1e-6)


def test_start_is_near_the_radial_lens(lens):
    """Near enough that least squares finds its way."""
    rays = random_rays(30 if isinstance(lens, PinholeLens) else 60, 200)
    start = type(lens).starts(RADIAL, np.deg2rad(95))[0]
    away = np.linalg.norm(start.project(rays) - RADIAL.project(rays), axis=1)
    assert away.max() < 0.15 * min(RADIAL.image_size)


# A spline's fit is linear, and it has control points where no pixel is.
@pytest.mark.parametrize(
    "kind",
    [
        *sorted({*LENSES} - {SplinedLens, UnifiedLens}, key=lambda kind: kind.name),
        pytest.param(UnifiedLens, marks=pytest.mark.slow),
    ],
)
def test_a_lens_is_found_again_from_its_pixels(kind):
    """The one fit serves every model; numbers that no pixel tells apart may differ."""
    wanted = bent(kind)
    rays = random_rays(field_deg(wanted) - 5, 400)
    pixel = wanted.project(rays)
    starts = kind.starts(RADIAL, np.deg2rad(field_deg(wanted)))
    found = nearest_lens(starts, rays, pixel)
    assert np.linalg.norm(found.project(rays) - pixel, axis=1).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("kind", LENSES, ids=lambda kind: kind.name)
def test_nearest_to_a_camera(kind):
    camera = cubic_camera(50, bend=0.0)
    rays = random_rays(45, 2000)
    lens = lens_near(kind, camera, rays, camera.project(rays))
    away = np.linalg.norm(lens.project(rays) - camera.project(rays), axis=1)
    assert np.sqrt(np.mean(away**2)) < 0.012 * min(camera.image_size)
    for name, (least, most) in lens.limits.items():
        assert least <= getattr(lens, name) <= most


@pytest.mark.slow
def test_what_other_tools_refuse_is_not_written():
    """The nearest lens whose α they take, and not the nearest one with another α put in."""
    rays = random_rays(60, 400)
    wanted = DoubleSphereLens.near(RADIAL, xi=0.2, alpha=-0.1)
    pixel = wanted.project(rays)
    starts = DoubleSphereLens.starts(RADIAL, np.deg2rad(60))
    assert nearest_lens(starts, rays, pixel).alpha == pytest.approx(-0.1, abs=1e-4)
    seen = replace(cubic_camera(60, bend=0.0), radial=RADIAL)
    found = lens_near(DoubleSphereLens, seen, rays, pixel)
    assert found.alpha == 0
    away = np.linalg.norm(found.project(rays) - pixel, axis=1).max()
    clipped = np.linalg.norm(replace(wanted, alpha=0.0).project(rays) - pixel, axis=1).max()
    assert away < 0.5 * clipped


def test_scaramuzza_undoes_its_own_definition():
    lens = bent(ScaramuzzaLens)
    xy = np.random.default_rng(2).uniform(-1.2, 1.2, (300, 2)) * lens.a[0]
    r = np.hypot(*xy.T)
    rays = np.column_stack([xy, np.polynomial.polynomial.polyval(r, lens.a)])
    assert (rays[:, 2] < 0).any()
    pixel = xy @ lens.stretch.T + [lens.cx, lens.cy]
    np.testing.assert_allclose(lens.project(rays), pixel, atol=1e-8)


def test_what_a_model_has_no_pixel_for_costs_a_fit_dearly():
    weak = replace(bent(UnifiedLens), xi=0.3)
    assert np.isinf(weak.pixels(np.array([[0.1, 0, -1.0]]))).all()
