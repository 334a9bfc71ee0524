"""One contract for every camera: projection and its inverse, derivatives, and NaN outside."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lenses import cubic_camera, numeric_jacobian, radial_camera, random_rays

from cubicfish.fit import decentred
from cubicfish.fit.decentred import DecentredFit, StillRays
from cubicfish.fit.lenses import CubicFit, NearestCubic, Tie
from cubicfish.geometry import kannala_brandt, kannala_brandt_slope
from cubicfish.models.cubic import UNPROJECT_TOLERANCE_PX, CubicCamera
from cubicfish.models.lift import SIZE, sphere_basis
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.fit_lens import FixedLens, FreeLens

CAMERAS = {
    "radial": (radial_camera(), 99.9),
    "radial, narrow": (radial_camera(40.0), 39.9),
    "cubic": (cubic_camera(), 95.0),
    "cubic, narrow": (cubic_camera(40.0, bend=0.002), 35.0),
    "cubic, 230 degrees": (cubic_camera(115.0, bend=0.002), 110.0),
}


@pytest.fixture(params=CAMERAS)
def camera_and_angle(request):
    return CAMERAS[request.param]


def test_round_trip_over_the_field(camera_and_angle):
    camera, angle = camera_and_angle
    rays = random_rays(angle, 3000)
    pixel = camera.project(rays)
    assert np.isfinite(pixel).all()
    again = camera.unproject(pixel)
    np.testing.assert_allclose(again, rays, atol=1e-9)
    np.testing.assert_allclose(camera.project(again), pixel, atol=UNPROJECT_TOLERANCE_PX)


@pytest.mark.slow
@pytest.mark.parametrize("name", CAMERAS)
@given(exponent=st.floats(-300, 307.5))
def test_length_of_a_point_does_not_matter(name, exponent):
    camera, angle = CAMERAS[name]
    rays = random_rays(angle, 50)
    far = rays * 10.0**exponent
    np.testing.assert_allclose(camera.project(far), camera.project(rays), atol=1e-9)
    if isinstance(camera, CubicCamera):
        _, slope = camera.project_jacobian(rays)
        pixel, far_slope = camera.project_jacobian(far)
        np.testing.assert_allclose(pixel, camera.project(rays), atol=1e-9)
        with np.errstate(over="ignore"):
            np.testing.assert_allclose(far_slope, slope * 10.0**-exponent, rtol=1e-6, atol=1e-200)


def test_leading_axes_are_kept(camera_and_angle):
    camera, angle = camera_and_angle
    rays = random_rays(angle, 12)
    pixel = camera.project(rays.reshape(3, 4, 3))
    np.testing.assert_array_equal(pixel.reshape(12, 2), camera.project(rays))
    assert camera.unproject(pixel).shape == (3, 4, 3)
    assert camera.project(np.zeros((0, 3))).shape == (0, 2)
    assert camera.unproject(np.zeros((0, 2))).shape == (0, 3)


@pytest.mark.parametrize(
    "bad", [[0, 0, 0], [np.nan, 0, 1], [0, np.inf, 1], [0, 0, -1], [1e-3, 0, -1]]
)
def test_points_that_no_pixel_sees_are_nan(bad, camera_and_angle):
    camera, _ = camera_and_angle
    assert np.isnan(camera.project(np.array([bad, [0, 0, 1.0]], float))).all(axis=1).tolist() == [
        True,
        False,
    ]


def test_pixels_outside_are_nan(camera_and_angle):
    camera, _ = camera_and_angle
    outside = np.array([[-1e5, 3], [1e300, 0], [np.nan, 5], [np.inf, 5], [5e3, 5e3]])
    assert np.isnan(camera.unproject(outside)).all()


def test_a_pixel_just_beyond_what_any_ray_reaches_is_nan():
    # An orthographic lens: pixels grow to a radius of 300 at 90 degrees, and no farther.
    P = np.zeros((3, SIZE))
    P[0, [-4, -1]], P[1, [-3, -1]], P[2, -1] = [300, 480], [300, 360], 1
    radial = radial_camera(90.0, centre=(480.0, 360.0))
    camera = CubicCamera(image_size=(960, 720), P=P, max_angle_deg=89.9, radial=radial)
    azimuth = np.linspace(0, 2 * np.pi, 50)
    around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    assert np.isfinite(camera.unproject(np.array([480, 360]) + 299 * around)).all()
    assert np.isnan(camera.unproject(np.array([480, 360]) + 301 * around)).all()


def test_edge_of_the_cone():
    camera = cubic_camera(bend=0.0004)  # so near that two rounds find the nearest bent lens
    azimuth = np.linspace(0, 6, 30)
    for angle_deg, seen in ((94.9999, True), (95.0001, False)):
        theta = np.deg2rad(angle_deg)
        rays = np.stack(
            [
                np.sin(theta) * np.cos(azimuth),
                np.sin(theta) * np.sin(azimuth),
                np.full_like(azimuth, np.cos(theta)),
            ],
            axis=-1,
        )
        assert np.isfinite(camera.project(rays)).all() == seen
        pixel, _ = camera.pixel_and_slope(rays)
        assert np.isfinite(camera.unproject(pixel)).all() == seen


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.floats(25, 120))
def test_round_trip_of_random_cubics(seed, angle):
    camera = cubic_camera(angle, bend=0.001, seed=seed)
    rays = random_rays(camera.max_angle_deg, 200, seed)
    np.testing.assert_allclose(camera.unproject(camera.project(rays)), rays, atol=1e-8)


def test_outline_is_the_edge_of_what_is_seen():
    camera = cubic_camera(bend=0.0004)  # so near that two rounds find the nearest bent lens
    outline = camera.outline(90)
    width, height = camera.image_size
    assert (outline >= -0.5 - 1e-6).all()
    assert (outline <= np.array([width, height]) - 0.5 + 1e-6).all()
    middle = camera.project([0.0, 0.0, 1.0])
    rays = camera.unproject(middle + 0.999 * (outline - middle))
    assert np.isfinite(rays).all()
    beyond = middle + 1.01 * (outline - middle)
    in_photo = ((beyond >= -0.5) & (beyond <= np.array([width, height]) - 0.5)).all(axis=1)
    assert in_photo.any()
    assert np.isnan(camera.unproject(beyond[in_photo])).all()


def test_radial_profile_beyond_its_fold():
    camera = RadialCamera(
        image_size=(100, 100), fx=30, fy=30, cx=50, cy=50, k=np.array([-0.1, 0, 0, 0])
    )
    fold = np.sqrt(1 / 0.3)
    assert camera.max_angle == pytest.approx(fold)
    assert np.isnan(camera.project([np.sin(fold + 0.01), 0, np.cos(fold + 0.01)])).all()
    assert np.isnan(camera.angle(camera.profile(fold) * 1.0001))
    assert camera.angle(camera.profile(0.9 * fold)) == pytest.approx(0.9 * fold)


def test_slope_of_the_radial_profile():
    k, theta = (-0.03, 0.02, -0.005, 0.0004), np.linspace(0, 1.8, 50)
    slope = (kannala_brandt(theta + 1e-6, k) - kannala_brandt(theta - 1e-6, k)) / 2e-6
    np.testing.assert_allclose(kannala_brandt_slope(theta, k), slope, atol=1e-8)


LENSES = {
    "radial": FreeLens.of(radial_camera()),
    "radial, two terms": FreeLens.of(radial_camera(k=(0.01, -0.003, 0, 0)), fixed=("k3", "k4")),
    "bent": DecentredFit(
        values=np.array([*radial_camera().parameters, 2e-3, -1e-3, 4e-3, 3e-3, -2e-3]),
        terms=4,
        noise_px=0.1,
        spread=0.01,
        anchor=np.array([470.0, 350.0]),
        anchor_px=4.0,
    ),
    "bent, one term": DecentredFit(
        values=np.array([*radial_camera(k=(0.01, 0, 0, 0)).parameters, 0, 1e-3, 0, 3e-3, 1e-3]),
        terms=1,
        noise_px=0.1,
        spread=0.01,
    ),
}


def test_a_bent_lens_projects_many_points_as_it_does_each(monkeypatch):
    lens, points = LENSES["bent"], random_rays(60, 1_000)
    monkeypatch.setattr(decentred, "_AT_ONCE", 300)
    np.testing.assert_array_equal(lens.project(points), lens.pixel_and_slopes(points)[0])


def _cubic_fit() -> CubicFit:
    camera = cubic_camera(bend=0.0004)  # so near that two rounds find the nearest bent lens
    rays = random_rays(100, 50)
    rays = rays[np.argsort(-rays[:, 2])]  # outwards
    scale, centre = 200.0, np.array([480.0, 350.0])
    normalisation = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])
    coefficients = np.linalg.solve(normalisation, camera.P) @ sphere_basis()
    coefficients *= 1 / coefficients[2, -1]
    mean = np.ones(16) / 4
    free = CubicFit(
        coefficients=coefficients,
        denominator_basis=np.linalg.svd(mean[None])[2][1:].T,
        centre=centre,
        scale=scale,
    )
    near = NearestCubic(
        rays=rays,
        within=rays[:, 2] > 0.2,
        lens=replace(free, coefficients=1.1 * coefficients),
        miss=0.5 * np.sin(np.arange(100.0)).reshape(50, 2),
    )
    return replace(
        free,
        tie=Tie(
            near=near,
            lens=DecentredFit(
                values=np.array([*radial_camera().parameters, 0, 0, 0, 0, 0]),
                terms=4,
                noise_px=0.1,
                spread=0.01,
                anchor=np.array([479.0, 351.0]),
                anchor_px=4.0,
            ),
            weight=0.7,
            denominator_weight=0.3,
        ),
    )


@pytest.fixture(params=[*LENSES, "cubic", "fixed cubic", "fixed radial"])
def lens(request):
    if request.param == "cubic":
        return _cubic_fit()
    if request.param.startswith("fixed"):
        return FixedLens(camera=CAMERAS[request.param.removeprefix("fixed ")][0])
    return LENSES[request.param]


def test_derivatives_by_the_point(lens):
    points = random_rays(95, 60) * np.linspace(0.5, 3, 60)[:, None]
    pixel, d_point, _ = lens.pixel_and_slopes(points)
    np.testing.assert_allclose(pixel, lens.project(points), atol=1e-9)
    np.testing.assert_allclose(
        d_point, numeric_jacobian(lens.project, points), atol=1e-3, rtol=1e-5
    )


def test_derivatives_on_the_axis():
    lens = LENSES["radial"]
    points = np.array([[0, 0, 2.0], [1e-9, 0, 2.0], [1e-7, -1e-7, 0.5]])
    pixel, d_point, d_parameters = lens.pixel_and_slopes(points)
    assert np.isfinite(pixel).all()
    assert np.isfinite(d_parameters).all()
    np.testing.assert_allclose(d_point, numeric_jacobian(lens.project, points), atol=1e-3)


@pytest.mark.parametrize("name", ["bent", "bent, one term"])
def test_rays_that_never_move_are_seen_as_any_others(name):
    lens, rays = LENSES[name], np.vstack([random_rays(120, 60), [[0, 0, 1]]])
    pixel, by_parameters = lens.seen(StillRays.of(rays))
    expected, _, by_lens = lens.pixel_and_slopes(rays)
    np.testing.assert_allclose(pixel, expected, atol=1e-9)
    np.testing.assert_allclose(by_parameters, by_lens, atol=1e-9)


def test_derivatives_by_the_parameters(lens):
    points = random_rays(95, 60)
    start = lens.parameters
    _, _, d_parameters = lens.pixel_and_slopes(points)
    assert d_parameters.shape == (60, 2, len(start))
    prior = lens.pulls()
    assert prior.shape == (len(start) + 1, len(start) + 1)
    for index in range(len(start)):
        step = np.zeros_like(start)
        step[index] = 1e-6 * max(1, abs(start[index]))
        up, down = lens.with_parameters(start + step), lens.with_parameters(start - step)
        slope = (up.project(points) - down.project(points)) / (2 * step[index])
        np.testing.assert_allclose(d_parameters[:, :, index], slope, rtol=1e-4, atol=1e-3)
        costs = [0.5 * moved.pulls()[-1, -1] for moved in (up, down)]
        slope = (costs[0] - costs[1]) / (2 * step[index])
        assert prior[index, -1] == pytest.approx(slope, rel=1e-4, abs=1e-2)


def test_what_the_nearest_lens_can_follow_is_not_held():
    lens = _cubic_fit()
    prior = lens.tie
    _, _, by_cubic = lens.pixel_and_slopes(prior.near.rays)
    pixel = lens.project(prior.near.rays)
    _, (_, by_lens) = prior.nearest(pixel)
    wanted = by_lens.reshape(pixel.size, -1)
    wanted /= np.linalg.norm(wanted, axis=0)
    # P's changes that move its pixels as the nearest lens's parameters do, as far as P can.
    change = np.linalg.lstsq(by_cubic.reshape(pixel.size, -1), wanted, rcond=None)[0]
    moved = by_cubic.reshape(pixel.size, -1) @ change
    held = np.sqrt(np.einsum("ij,ik,kj->j", change, lens.pulls()[:-1, :-1], change))
    like = np.linalg.norm(moved - wanted, axis=0) < 0.1
    assert like.sum() >= 8
    assert (held[like] < 0.15 * prior.weight).all()


def test_derivatives_of_x_and_y_apart_are_those_of_both(lens):
    points = random_rays(95, 20)
    pixel, by_point, whole = lens.pixel_and_slopes(points)
    again, by_point_again, parts, columns = lens.separate_slopes(points)
    np.testing.assert_allclose(again, pixel)
    np.testing.assert_allclose(by_point_again, by_point)
    rows = np.concatenate([np.broadcast_to(one, (2, *one.shape[1:])) for one in parts], axis=1)
    for axis in range(2):
        found = np.zeros((whole.shape[2], len(points)))
        found[columns[axis]] = rows[axis]
        np.testing.assert_allclose(found.T, whole[:, axis], atol=1e-9)


def test_parameters_round_trip(lens):
    again = lens.with_parameters(lens.parameters)
    points = random_rays(95, 20)
    np.testing.assert_allclose(again.project(points), lens.project(points), atol=1e-12)
