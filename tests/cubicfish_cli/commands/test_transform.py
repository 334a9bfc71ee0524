"""A camera for other modes of its sensor is the same camera, in other pixels."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from lenses import random_rays
from running import Run
from samples import SAMPLE

from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish_cli import load_camera
from cubicfish_cli.commands.transform import Crop, transform_camera

CROP = Crop(100, 60, 800, 600)


def moved(pixel, crop, scale):
    return (pixel - [crop.x, crop.y] + 0.5) * scale - 0.5


@pytest.mark.parametrize("scale", [1.0, 0.5, 0.125, 1.5, 4.0])
def test_pixels_are_those_of_the_whole_photo_moved(calibrated: Path, scale: float) -> None:
    known = load_camera(calibrated)
    made = transform_camera(known, crop=CROP, scale=scale)
    assert made.camera.image_size == (800 * scale, 600 * scale)
    rays = random_rays(known.camera.max_angle_deg - 1e-6, 2000)
    wanted = moved(known.camera.project(rays), CROP, scale)
    np.testing.assert_allclose(made.camera.project(rays), wanted, rtol=0, atol=1e-9)
    radial = moved(known.camera.radial.project(rays), CROP, scale)
    np.testing.assert_allclose(made.camera.radial.project(rays), radial, rtol=0, atol=1e-9)
    near = moved(known.camera.project(100 * rays, near=True), CROP, scale)
    np.testing.assert_allclose(made.camera.project(100 * rays, near=True), near, rtol=0, atol=1e-9)
    assert pole_or_fold_deg(made.camera.P, made.camera.max_angle_deg) is None


def test_what_is_known_of_the_camera_goes_along(run: Run, calibrated: Path, tmp_path: Path) -> None:
    known = load_camera(calibrated)
    goal = tmp_path / "half.yaml"
    said = run("transform", calibrated, "--crop", "100,60,800x600", "--scale", 0.5, "-o", goal)
    assert str(goal) in said.stdout
    made = load_camera(goal)
    assert made.made_by["command"].endswith("--crop 100,60,800x600 --scale 0.5")
    inside = np.stack(np.meshgrid(np.arange(0, 400, 7), np.arange(0, 300, 7)), axis=-1)
    inside = inside.reshape(-1, 2).astype(float)
    before = 0.5 * known.uncertainty((inside + 0.5) / 0.5 - 0.5 + [100, 60])
    # Either is read between the nodes of a coarse grid of its own.
    ratio = made.uncertainty(inside) / before
    assert np.isfinite(ratio).mean() > 0.5
    assert np.nanmedian(ratio) == pytest.approx(1, rel=0.02)
    assert np.nanpercentile(np.abs(np.log(ratio)), 95) < np.log(1.2)
    assert made.fit.rms_px == pytest.approx(0.5 * known.fit.rms_px)
    assert made.fit.radial_rms_px == pytest.approx(0.5 * known.fit.radial_rms_px)
    assert made.fit.covered_deg == known.fit.covered_deg
    assert made.camera.max_angle_deg == known.camera.max_angle_deg
    assert made.fit.poses.keys() == known.fit.poses.keys()
    assert made.fit.uncertainty.focal_px == pytest.approx(
        0.5 * np.array(known.fit.uncertainty.focal_px)
    )
    outline = made.camera.outline()
    assert outline.min() >= -0.5 - 1e-6
    assert (outline.max(axis=0) <= np.array([400, 300]) - 0.5 + 1e-6).all()


def test_a_photo_that_is_cropped_and_scaled_is_that_of_the_camera(calibrated: Path) -> None:
    """OpenCV's INTER_AREA halves a photo by the mean of four pixels: their middle is the pixel."""
    known = load_camera(calibrated)
    made = transform_camera(known, crop=CROP, scale=0.5).camera
    x, y = np.meshgrid(np.arange(960.0), np.arange(720.0))
    photo = np.stack([x, y], axis=-1).astype(np.float32)  # each pixel says where it is
    cut = photo[60:660, 100:900]
    half = cv2.resize(cut, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    places = np.stack(np.meshgrid(np.arange(400.0), np.arange(300.0)), axis=-1)[::50, ::50]
    whole = known.camera.project(made.unproject(places))
    seen = np.isfinite(whole[..., 0])
    assert seen.mean() > 0.7  # the picture of a fisheye is round
    np.testing.assert_allclose(whole[seen], half[::50, ::50][seen], atol=1e-4)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (("--crop", "900,60,800x600"), "900,60,800x600"),
        (("--crop", "0,0,0x10"), "0,0,0x10"),
        (("--crop", "1,2,3"), "1280x720"),
        (("--scale", "0.3333"), "whole"),
        (("--scale", "1e-9"), "whole"),
        (("--scale", "0"), "--scale"),
    ],
)
def test_what_is_no_mode_is_wrong_usage(run: Run, tmp_path: Path, given, named: str) -> None:
    goal = tmp_path / "c.yaml"
    said = run("transform", SAMPLE / "true_camera.yaml", *given, "-o", goal, code=2).stderr
    assert named in said
    assert not goal.exists()
