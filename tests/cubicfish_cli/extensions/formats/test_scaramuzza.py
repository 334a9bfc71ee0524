"""OCamCalib's lens: fitted to cubic cameras, against formulas written down a second time."""

import numpy as np
import pytest
from lenses import cubic_camera

from cubicfish.fit import to_lens
from cubicfish.models import cone_rays
from cubicfish_cli import CubicCamera
from cubicfish_cli.extensions.formats import ocamcalib
from cubicfish_cli.extensions.formats.ocamcalib import ScaramuzzaLens

SIZE = (960, 720)
LENS = ScaramuzzaLens(
    image_size=SIZE,
    cx=488.2,
    cy=351.4,
    stretch=np.array([[1.002, 0.0011], [-0.0007, 1.0]]),
    a=np.array([205.0, 0.0, -2.2e-3, 4.8e-6, -1.8e-8]),
)


def field(camera: CubicCamera, count: int = 800) -> tuple[np.ndarray, np.ndarray]:
    """Rays of a camera's cone that it sees in its photo, and their pixels."""
    rays = cone_rays(np.deg2rad(camera.max_angle_deg), count)
    pixel = camera.project(rays)
    seen = ((pixel > -0.5) & (pixel < np.array(camera.image_size) - 0.5)).all(axis=1)
    return rays[seen], pixel[seen]


def published_ray(pixel: np.ndarray) -> np.ndarray:
    """cam2world of LENS as published: straighten, then (x, y, f(r))."""
    stretch, a = LENS.stretch, LENS.a
    x, y = np.linalg.inv(stretch) @ (pixel - [LENS.cx, LENS.cy])
    r = np.hypot(x, y)
    ray = np.array([x, y, a[0] + a[2] * r**2 + a[3] * r**3 + a[4] * r**4])
    return ray / np.linalg.norm(ray)


def assert_it_goes_on_behind(lens: ScaramuzzaLens, camera: CubicCamera) -> None:
    """Right behind the field f does not fold."""
    end = np.degrees(ocamcalib._tabulate_angles(lens.a, 500.0)[1][-1])
    assert end > camera.max_angle_deg + 10


def test_projection_undoes_the_published_way_from_pixels_to_rays() -> None:
    pixel = np.array(
        [[488.2, 351.4], [488.2, 352.0], [100.0, 80.0], [900.0, 351.0], [480.0, 700.0]]
    )
    rays = np.array([published_ray(one) for one in pixel])
    assert np.abs(LENS.unproject(pixel) - rays).max() < 1e-14
    assert np.abs(LENS.project(3.7 * rays) - pixel).max() < 1e-9
    assert np.degrees(np.arccos(rays[3, 2])) > 90  # the lens looks back there


def test_what_the_lens_does_not_reach_is_nan() -> None:
    rays = np.array([[0.0, 0.0, -1.0], [0.0, 0.05, -1.0], [0.0, 0.0, 1.0]])
    assert np.isnan(LENS.project(rays)).all(axis=1).tolist() == [True, True, False]
    lens = LENS.with_inverse(1.5)
    assert np.isnan(lens.project_by_inverse(rays)).all(axis=1).tolist() == [
        True,
        True,
        False,
    ]


@pytest.mark.parametrize("farthest_deg", [20, 60, 95, 110])
def test_the_inverse_polynomial_is_near_the_radius(farthest_deg: float) -> None:
    lens = LENS.with_inverse(np.deg2rad(farthest_deg))
    rays = cone_rays(np.deg2rad(farthest_deg), 2000)
    pixel = LENS.project(rays)
    inside = np.isfinite(pixel[:, 0])
    assert inside.mean() > 0.8
    apart = np.linalg.norm(lens.project_by_inverse(rays) - pixel, axis=1)
    assert apart[inside].max() < 0.005
    assert len(lens.inverse) <= 15


def test_a_lens_of_the_model_is_found_again() -> None:
    """A cubic camera cannot be one; its reference's pixels are replaced by the lens's own."""
    camera = cubic_camera(80)
    rays, _ = field(camera)
    pixel = LENS.project(rays)
    found = ScaramuzzaLens.of_degree(4, camera, rays, pixel)
    assert np.abs(found.project(rays) - pixel).max() < 1e-5
    assert found.cx == pytest.approx(LENS.cx, abs=1e-5)
    assert found.a == pytest.approx(LENS.a, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("half_angle_deg", [50, 75, 100, 112])
def test_a_fit_is_as_near_as_any_radial_lens(half_angle_deg: float) -> None:
    """Of a camera with no bend of its own hardly anything is lost, in either direction."""
    camera = cubic_camera(half_angle_deg, bend=0.0)
    rays, pixel = field(camera)
    lens = ScaramuzzaLens.nearest_to(camera, rays, pixel)
    apart = np.linalg.norm(lens.project(rays) - pixel, axis=1)
    assert np.sqrt((apart**2).mean()) < 0.05
    assert apart.max() < 0.25
    by_inverse = np.linalg.norm(lens.project_by_inverse(rays) - pixel, axis=1)
    assert np.abs(by_inverse - apart).max() < 0.005
    back = np.sum(lens.unproject(pixel) * rays, axis=1)
    assert np.degrees(np.arccos(np.clip(back, -1, 1))).max() < 0.1
    assert_it_goes_on_behind(lens, camera)


@pytest.mark.slow
def test_a_camera_that_is_no_radial_lens_is_met_as_well_as_by_its_radial_reference() -> None:
    camera = cubic_camera(95)
    rays, pixel = field(camera)
    lens = ScaramuzzaLens.nearest_to(camera, rays, pixel)
    reference = np.sqrt(((camera.radial.project(rays) - pixel) ** 2).sum(axis=1).mean())
    found = np.sqrt(((lens.project(rays) - pixel) ** 2).sum(axis=1).mean())
    assert found < reference
    # A higher degree that gains next to nothing is not taken.
    assert len(lens.a) == 5
    assert_it_goes_on_behind(lens, camera)


@pytest.mark.slow
def test_f_does_not_fold_right_behind_a_narrow_field() -> None:
    camera = cubic_camera(50)
    assert_it_goes_on_behind(ScaramuzzaLens.nearest_to(camera, *field(camera)), camera)


@pytest.mark.slow
def test_what_the_inverse_polynomial_loses_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = cubic_camera(80, bend=0.0)
    error = to_lens(camera, ScaramuzzaLens).error
    (way,) = error.also.values()
    assert 0 < way["max_px"] <= error.max_px < 0.1
    monkeypatch.setattr(ocamcalib, "_INVERSE_DEGREES", range(1, 2))  # an inverse of too few terms
    rough = to_lens(camera, ScaramuzzaLens).error
    (way,) = rough.also.values()
    assert way["max_px"] == rough.max_px > 0.1
    assert way["rms_px"] == rough.rms_px > error.rms_px
    assert rough.as_record()["also"] == rough.also
