"""Lenses of simulators, read back by the simulators' own libraries where these are installed."""

import json
from pathlib import Path

import numpy as np
import pytest
from lenses import cubic_camera, random_rays

from cubicfish import CameraFile
from cubicfish_cli import export_camera

CAMERA = cubic_camera(85.0, bend=0.002)
RAYS = random_rays(80.0, 2000)
PIXEL = CAMERA.project(RAYS)


def exported(to: str) -> tuple[str, np.ndarray, float]:
    """The text of the file, rays in the lens's frame, and the largest error that is stated."""
    made = export_camera(CameraFile(camera=CAMERA), to, max_error=20)
    return made.text, RAYS @ made.conversion.lens_from_camera.T, made.conversion.error.max_px


def test_ftheta_holds_both_polynomials_and_the_linear_term() -> None:
    text, rays, largest = exported("ftheta")
    data = json.loads(text)
    rho, theta = np.hypot(*rays[:, :2].T), np.arccos(rays[:, 2])
    radius = np.polynomial.polynomial.polyval(theta, data["angle_to_pixeldist_poly"])
    c, d, e = data["linear_cde"]
    pixel = (radius / rho)[:, None] * rays[:, :2] @ [[c, e], [d, 1]] + data["principal_point"]
    assert np.linalg.norm(pixel - PIXEL, axis=1).max() <= 1.01 * largest
    again = np.polynomial.polynomial.polyval(radius, data["pixeldist_to_angle_poly"])
    np.testing.assert_allclose(again, theta, atol=2e-3)
    assert theta.max() < data["max_angle"] < 1.01 * np.deg2rad(CAMERA.max_angle_deg)


@pytest.mark.slow
def test_ncore_reads_ftheta() -> None:
    ncore = pytest.importorskip("ncore.data")
    sensors = pytest.importorskip("ncore.sensors")
    text, rays, largest = exported("ftheta")
    lens = ncore.FThetaCameraModelParameters.from_dict(json.loads(text))
    model = sensors.CameraModel.from_parameters(lens, device="cpu")
    seen = model.camera_rays_to_image_points(rays.astype(np.float32))
    # Its pixel (0, 0) is the corner of the first one here.
    miss = np.linalg.norm(np.asarray(seen.image_points) - 0.5 - PIXEL, axis=1)
    assert miss.max() <= 1.01 * largest + 1e-3
    assert np.asarray(seen.valid_flag).all()
    back = np.asarray(model.image_points_to_camera_rays(np.asarray(seen.image_points)))
    np.testing.assert_allclose(back, rays, atol=1e-4)


@pytest.mark.slow
def test_projectaria_reads_fisheye624() -> None:
    calibration = pytest.importorskip("projectaria_tools.core.calibration")
    text, rays, largest = exported("fisheye624")
    lens = calibration.device_calibration_from_json_string(text).get_camera_calib("camera")
    assert tuple(lens.get_image_size()) == CAMERA.image_size
    miss = [np.linalg.norm(lens.project(ray) - own) for ray, own in zip(rays, PIXEL, strict=True)]
    assert max(miss) <= 1.01 * largest


def test_fisheye624_has_one_focal_length() -> None:
    text, _, largest = exported("fisheye624")
    (camera,) = json.loads(text)["CameraCalibrations"]
    assert len(camera["Projection"]["Params"]) == 15
    assert largest < 20


def test_woodscape_counts_from_the_middle() -> None:
    text, rays, largest = exported("woodscape")
    data = json.loads(text)["intrinsic"]
    theta = np.arccos(rays[:, 2])
    rho = sum(data[f"k{n}"] * theta**n for n in range(1, 1 + data["poly_order"]))
    plane = rho[:, None] * rays[:, :2] / np.hypot(*rays[:, :2].T)[:, None]
    middle = (np.array([data["width"], data["height"]]) - 1) / 2
    centre = middle + np.array([data["cx_offset"], data["cy_offset"]])
    pixel = plane * [1, data["aspect_ratio"]] + centre
    assert np.linalg.norm(pixel - PIXEL, axis=1).max() <= 1.01 * largest


def test_bytes_of_rays_are_the_same_every_time(tmp_path: Path) -> None:
    from cubicfish_cli.extensions.formats.ray_grids import rays_content

    known = CameraFile(camera=CAMERA)
    content = rays_content(known, "rays", None)
    assert content == rays_content(known, "rays", None)
    path = tmp_path / "rays.npz"
    path.write_bytes(content)
    with np.load(path) as data:
        assert data["pixels"].shape == (33, 33, 2)
        assert data["largest_px"] < 0.001
