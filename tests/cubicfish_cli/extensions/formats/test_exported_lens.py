"""Lenses with one centre for cameras whose entrance pupil travels, and tilted ones."""

from dataclasses import replace

import numpy as np
import pytest
from lenses import cubic_camera, random_rays
from scipy.spatial.transform import Rotation

from cubicfish import CubicCamera
from cubicfish.fit import Conversion, to_lens
from cubicfish.models import RadialCamera
from cubicfish.models.lift import lift
from cubicfish.solve.statistics import rms_px
from cubicfish_cli.extensions.formats.colmap_cameras import RadTanThinPrismLens

DISTANCE, TRAVEL = 300.0, 4.0


@pytest.fixture(scope="module")
def camera() -> CubicCamera:
    return replace(cubic_camera(85.0, bend=1e-4), pupil_travel=TRAVEL, units="mm")


@pytest.fixture(scope="module")
def near(camera: CubicCamera) -> Conversion:
    return to_lens(camera, RadialCamera, distance=DISTANCE)


@pytest.fixture(scope="module")
def far(camera: CubicCamera) -> Conversion:
    return to_lens(camera, RadialCamera)


def loss_px(made: Conversion, camera: CubicCamera, distance: float) -> float:
    """RMS of the lens on points at a distance from its own place."""
    points = distance * random_rays(75.0, 2000) + made.place
    own = (points - made.place) @ made.lens_from_camera.T
    return rms_px(made.lens.project(own) - camera.project(points, near=True))


def test_a_lens_is_right_at_the_distance_that_it_is_for(camera, near, far):
    assert loss_px(near, camera, DISTANCE) < 0.25 * loss_px(far, camera, DISTANCE)
    assert loss_px(far, camera, 1e6) < 0.25 * loss_px(near, camera, 1e6)
    assert near.distance == DISTANCE
    assert near.distant.rms_px == pytest.approx(loss_px(near, camera, 1e6), rel=0.5)
    assert far.distant is far.distance is None


def test_its_place_is_where_rays_cross_most_nearly(camera, near, far):
    """From there the spread of distances costs less than from anywhere else on the axis."""
    assert 0.05 * TRAVEL < near.place[2] < 0.6 * TRAVEL
    assert not near.place[:2].any()
    assert not far.place.any()
    spread = [near.error.rms_px]
    for shift in (-TRAVEL / 3, TRAVEL / 3):
        with pytest.MonkeyPatch.context() as patch:
            place = near.place[2] + shift
            patch.setattr("cubicfish.fit.exported_lens._central_place", lambda _, z=place: z)
            spread.append(to_lens(camera, RadialCamera, distance=DISTANCE).error.rms_px)
    assert spread[0] < 0.8 * min(spread[1:])


def test_poses_go_to_that_place(near):
    rotation = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    turned, moved = near.moved(rotation, np.array([5.0, 6.0, 7.0]))
    point = np.array([1.0, 2.0, 3.0])
    own = near.lens_from_camera @ (rotation @ point + [5, 6, 7] - near.place)
    np.testing.assert_allclose(turned @ point + moved, own, atol=1e-12)


def test_distance_is_nothing_to_a_central_camera(camera):
    central = replace(camera, pupil_travel=0.0)
    made = [to_lens(central, RadialCamera, distance=one) for one in (None, DISTANCE)]
    np.testing.assert_array_equal(made[0].lens.parameters, made[1].lens.parameters)
    assert made[1].distance is made[1].distant is None


def test_a_thin_prism_lens_follows_a_tilted_axis_by_its_frame(monkeypatch):
    """A lens that is tilted as a whole by two degrees."""
    camera = cubic_camera(60.0, bend=0.0)
    turn = Rotation.from_euler("y", 2, degrees=True).as_matrix()
    rays = random_rays(58.0, 4000)
    columns = np.linalg.lstsq(lift(rays), lift(rays @ turn.T), rcond=None)[0]
    tilted = replace(camera, P=camera.P @ columns.T, max_angle_deg=56.0)
    made = to_lens(tilted, RadTanThinPrismLens)
    monkeypatch.setattr(RadTanThinPrismLens, "tilts", False)
    assert made.error.rms_px < 0.3 * to_lens(tilted, RadTanThinPrismLens).error.rms_px
    assert 1 < made.turned_deg < 3
