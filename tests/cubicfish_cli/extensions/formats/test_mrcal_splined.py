"""mrcal's splined lens: against mrcal itself where it is installed, and against its definition."""

from pathlib import Path

import numpy as np
import pytest
from lenses import cubic_camera, random_rays
from mrcal_itself import ask_mrcal, needs_mrcal

from cubicfish import CubicCamera
from cubicfish.models import cone_rays
from cubicfish_cli.extensions.formats.mrcal_model import mrcal_text, read_mrcal
from cubicfish_cli.extensions.formats.mrcal_splined import SplinedLens
from cubicfish_cli.foreign.file_contents import PlacedLens


def field(camera: CubicCamera, count: int = 12_000) -> tuple[np.ndarray, np.ndarray]:
    rays = cone_rays(np.deg2rad(camera.max_angle_deg), count)
    pixel = camera.project(rays)
    seen = ((pixel > -0.5) & (pixel < np.array(camera.image_size) - 0.5)).all(axis=1)
    return rays[seen], pixel[seen]


def random_lens(order: int, nx: int, ny: int, fov_x_deg: int) -> SplinedLens:
    rng = np.random.default_rng(order + nx)
    return SplinedLens(
        image_size=(960, 720),
        fx=250.0,
        fy=252.0,
        cx=480.0,
        cy=350.0,
        order=order,
        fov_x_deg=fov_x_deg,
        control=0.05 * rng.normal(size=(ny, nx, 2)),
        region=np.zeros((0, 2)),
    )


@pytest.mark.slow
@needs_mrcal
@pytest.mark.parametrize("shape", [(3, 11, 8, 200), (2, 9, 7, 150)])
def test_splines_are_those_of_mrcal(tmp_path: Path, shape: tuple[int, int, int, int]) -> None:
    lens = random_lens(*shape)
    path = tmp_path / "a.cameramodel"
    path.write_text(mrcal_text(PlacedLens(lens=lens)).replace("\n    'extrinsics'", _ANY_REGION))
    rays = random_rays(110, 800)
    pixel = lens.project(rays)
    # Far outside the spline's edges it is cubics of large numbers.
    assert ask_mrcal(path, rays)[0] == pytest.approx(pixel, rel=1e-9, abs=1e-8)


_ANY_REGION = "\n    'valid_intrinsics_region': [[0, 0], [9, 0], [9, 9], [0, 0]],\n    'extrinsics'"


@pytest.mark.slow
@needs_mrcal
@pytest.mark.parametrize("half_angle_deg", [45, 115])
def test_mrcal_sees_with_the_written_model_what_the_camera_sees(
    tmp_path: Path, half_angle_deg: float
) -> None:
    camera = cubic_camera(half_angle_deg)
    lens = SplinedLens.nearest_to(camera, *field(camera))
    path = tmp_path / "camera.cameramodel"
    path.write_text(mrcal_text(PlacedLens(lens=lens)))
    rays, pixel = field(camera, 1501)  # other rays than those of the fit
    seen, back, region, size = ask_mrcal(path, rays)
    assert np.linalg.norm(seen - pixel, axis=1).max() < 0.01
    assert np.degrees(np.arccos(np.clip((back * rays).sum(axis=1), -1, 1))).max() < 0.01
    assert size.tolist() == list(camera.image_size)
    assert np.array_equal(region, lens.region)


@pytest.mark.slow
@pytest.mark.parametrize("half_angle_deg", [30, 60, 95, 120])
def test_the_spline_is_within_a_hundredth_of_a_pixel(half_angle_deg: float) -> None:
    camera = cubic_camera(half_angle_deg)
    lens = SplinedLens.nearest_to(camera, *field(camera))
    rays, pixel = field(camera, 5003)
    apart = np.linalg.norm(lens.project(rays) - pixel, axis=1)
    assert apart.max() < 0.01  # NaN nowhere, up to the rim
    rows, columns, _ = lens.control.shape
    assert max(rows, columns) <= 39


def test_the_spline_goes_on_in_order_outside_the_field() -> None:
    """Straight on beyond its edges, as mrcal does: pixels still move outwards as rays do."""
    camera = cubic_camera(70)
    lens = SplinedLens.nearest_to(camera, *field(camera))
    azimuth = np.linspace(0, 2 * np.pi, 73)[:, None]
    theta = np.deg2rad(np.linspace(1, camera.max_angle_deg + 25, 60))
    sine = np.sin(theta)
    across = np.stack([np.cos(azimuth) * sine, np.sin(azimuth) * sine], axis=-1)
    rays = np.concatenate([across, np.broadcast_to(np.cos(theta), across.shape[:2])[..., None]], -1)
    pixel = lens.project(rays.reshape(-1, 3)).reshape(73, 60, 2)
    radius = np.linalg.norm(pixel - [lens.cx, lens.cy], axis=-1)
    assert np.diff(radius, axis=1).min() > 0
    assert np.isnan(lens.project(np.array([[0.0, 0.0, -1.0]]))).all()


@pytest.mark.slow
def test_the_region_is_the_outline_of_the_field() -> None:
    camera = cubic_camera(100)
    region = SplinedLens.nearest_to(camera, *field(camera)).region
    width, height = camera.image_size
    assert np.array_equal(region[0], region[-1])
    assert (region >= -0.5 - 1e-9).all()
    assert (region <= [width - 0.5, height - 0.5]).all()
    x, y = region.T
    area = abs(0.5 * np.sum(x[1:] * y[:-1] - x[:-1] * y[1:]))
    grid = np.stack(np.meshgrid(np.arange(width)[::4], np.arange(height)[::4]), axis=-1)
    seen = np.isfinite(camera.unproject(grid.reshape(-1, 2))[:, 0]).mean()
    assert area / (width * height) == pytest.approx(seen, abs=0.005)


def test_a_stereographic_lens_is_a_spline_of_zeros(tmp_path: Path) -> None:
    path = tmp_path / "s.cameramodel"
    path.write_text(
        "{'lensmodel': 'LENSMODEL_STEREOGRAPHIC', 'intrinsics': [200, 210, 480, 350],"
        " 'extrinsics': [0,0,0,0,0,0], 'imagersize': [960, 720]}"
    )
    lens = read_mrcal(path)
    angle = np.deg2rad([0.0, 40.0, 120.0])
    rays = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    pixel = lens.project(rays)
    assert np.abs(pixel[:, 0] - (480 + 400 * np.tan(angle / 2))).max() < 1e-9


@pytest.mark.slow
@needs_mrcal
def test_opencv_lenses_of_mrcal_are_read_as_mrcal_means_them(tmp_path: Path) -> None:
    path = tmp_path / "o.cameramodel"
    path.write_text(
        "{'lensmodel': 'LENSMODEL_OPENCV12', 'intrinsics': [500, 510, 480, 350,"
        " -0.2, 0.05, 0.001, -0.002, 0.01, 0.02, 0.01, 0.003, 0.001, -0.002, 0.003, -0.004],\n"
        " 'valid_intrinsics_region': [[0, 0], [9, 0], [9, 9], [0, 0]],"
        " 'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [960, 720]}"
    )
    rays = random_rays(45, 300)
    assert ask_mrcal(path, rays)[0] == pytest.approx(read_mrcal(path).project(rays))
