"""The sample photos are what their script, target and lens say."""

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
from synthetic import corner_of_three

from cubicfish import Target, load_camera, load_corners
from cubicfish.models import angle_from_axis, cone_rays

SAMPLE = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("render_sample", SAMPLE / "render_sample.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_files_are_few_and_small(script):
    photos = sorted((SAMPLE / "photos").iterdir())
    assert [photo.name for photo in photos] == list(script.poses())
    assert sum(photo.stat().st_size for photo in photos) < 3_000_000


@pytest.mark.slow
def test_the_photos_show_what_the_script_renders(script):
    target, lens = Target.load(SAMPLE / "target.yaml"), script.true_lens()
    name = "corner_03.jpg"
    photo = cv2.imread(str(SAMPLE / "photos" / name), cv2.IMREAD_UNCHANGED)
    again = script.photograph(script.Room(target), lens, script.poses()[name], rays_a_side=1)
    assert photo.shape == again.shape == (720, 960, 3)
    for channel in range(3):
        shown, made = (cv2.GaussianBlur(p[..., channel], (0, 0), 2) for p in (photo, again))
        assert np.corrcoef(shown.ravel(), made.ravel())[0, 1] > 0.97
    assert np.corrcoef(photo[::-1].ravel(), again.ravel())[0, 1] < 0.9


def test_the_true_corners_are_the_scripts(script, tmp_path):
    target, lens = Target.load(SAMPLE / "target.yaml"), script.true_lens()
    (tmp_path / "again.csv").write_text(script.true_corners(target, lens), encoding="utf-8")
    again = load_corners(tmp_path / "again.csv", target)
    corners = load_corners(SAMPLE / "true_corners.csv", target)
    for name in ("image", "board", "column", "row"):
        np.testing.assert_array_equal(getattr(corners, name), getattr(again, name))
    np.testing.assert_allclose(corners.pixel, again.pixel, atol=2e-6)
    assert corners.image_size == (960, 720)
    assert len(corners.images) == 10
    angle = np.degrees(angle_from_axis(lens.unproject(corners.pixel)))
    assert angle.min() < 5
    assert 88 < angle.max() < 95
    assert len(corners.pixel) > 1000


def test_the_true_camera_is_near_the_scripts_lens(script):
    lens, true = script.true_lens(), load_camera(SAMPLE / "true_camera.yaml").camera
    assert true.image_size == lens.image_size == (960, 720)
    rays = cone_rays(np.radians(true.max_angle_deg - 0.01), 5000)
    miss = np.hypot(*(true.project(rays) - lens.project(rays)).T)
    assert np.sqrt(np.mean(miss**2)) < 0.007
    assert miss.max() < 0.04


def test_the_object_is_that_of_the_other_tests():
    loaded, built = Target.load(SAMPLE / "target.yaml"), corner_of_three()
    for one, other in zip(loaded.boards, built.boards, strict=True):
        assert (one.name, one.columns, one.rows) == (other.name, other.columns, other.rows)
        np.testing.assert_allclose(one.world_points(2, 3), other.world_points(2, 3))
