"""The paper's synthetic camera, as the benchmark builds it, behaves as the science page says."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "paper.py"


@pytest.fixture(scope="module")
def paper():
    spec = importlib.util.spec_from_file_location("benchmark_paper", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_all_points_are_where_the_lens_still_grows(paper):
    for pose in paper.POSES:
        points = pose.camera_points(np.vstack([paper.OBJECT, paper.OFF_PLANES]))
        assert (points[:, 2] > 0).all()
        angle = np.rad2deg(np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2]))
        assert angle.max() < 65
        pixel = paper.true_pixels(points)
        assert ((pixel > 0) & (pixel < paper.SIZE)).all()


def test_three_planes_leave_the_point_lift_free_off_them(paper):
    for pose in paper.POSES:
        rank, errors = paper.point_lift(pose, 0.0, np.random.default_rng(0))
        assert rank == 19
        assert errors.corners["refined"] < 0.03
        assert errors.on["refined"] < 0.03
        assert errors.off["refined"] > 4


def test_the_ray_lift_is_right_on_and_off_the_planes(paper):
    rank, errors = paper.ray_lift(0.0, np.random.default_rng(0))
    assert rank == 16
    assert errors.off["refined"] < 0.01
    _, noisy = paper.ray_lift(0.1, np.random.default_rng(0))
    assert noisy.corners["plain"] > 5 * noisy.corners["reweighted"]
    assert noisy.off["refined"] < 0.1
