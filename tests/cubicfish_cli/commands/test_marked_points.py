"""2D-3D pairs that somebody marked by hand: few, one photo, errors of a pixel, no boards."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from looking import look_at
from running import run_cli

from cubicfish import load_camera
from cubicfish.models.radial import RadialCamera

SIZE = (1280, 960)
LENS = RadialCamera(
    image_size=SIZE, fx=330.0, fy=330.0, cx=642.0, cy=476.0, k=np.array([-0.012, 0.004, 0.0, 0.0])
)


def marked(path: Path, count: int, noise_px: float, weights: bool = False) -> Path:
    """Write points of a hall, 12 m long, seen in one photo from its middle."""
    rng = np.random.default_rng(3)
    up = np.array([0.0, 0.0, 1.0])
    turn, shift = look_at(np.array([0.3, -0.2, 1.5]), np.array([1.0, 6.0, 1.6]), up=up)
    world = rng.uniform([-6, 0, 0], [6, 8, 4], (400, 3))
    seen = world @ cv2.Rodrigues(turn)[0].T + shift
    angle = np.arctan2(np.hypot(*seen[:, :2].T), seen[:, 2])
    pixel = LENS.project(seen)
    inside = ((pixel > 0) & (pixel < SIZE)).all(axis=1) & (angle < 1.5)
    world, pixel = world[inside][:count], pixel[inside][:count]
    pixel = pixel + noise_px * rng.normal(size=pixel.shape)
    weight = np.ones(count)
    if weights:
        pixel[0] += 12
        weight[0] = 1e-4
    rows = np.column_stack([world, pixel, weight])
    lines = ["hall.jpg," + ",".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\n".join(["image,X,Y,Z,x,y,weight", *lines]) + "\n")
    return path


def calibrated(tmp_path: Path, table: Path, *more: object) -> dict:
    line = ("calibrate", "--correspondences", table, "--size", "1280x960", "--no-report")
    done = run_cli(*line, "-o", tmp_path / "c", "--json", "--overwrite", *more)
    assert "target.yaml" not in done.stdout + done.stderr
    found = json.loads(done.stdout)
    said = [reason["why"] + (reason["do"] or "") for reason in found["verdict"]["reasons"]]
    assert not any(word in text for text in said for word in ("board", "target", "corner"))
    return found


def test_what_is_printed_speaks_of_points(tmp_path: Path) -> None:
    table = marked(tmp_path / "p.csv", 60, 0.6)
    line = ("calibrate", "--correspondences", table, "--size", "1280x960", "--no-report")
    said = run_cli(*line, "-o", tmp_path / "c", "--noise", 0.6).stdout
    assert "px where points were" in said
    assert re.search(r"; points reach \d", said)
    assert "of the field covered by points" in said


def codes(record: dict) -> set[tuple[str, str]]:
    reasons = record["verdict"]["reasons"]
    return {(reason["code"], reason["severity"]) for reason in reasons}


def test_28_points_of_one_photo_make_a_radial_camera(tmp_path: Path) -> None:
    found = calibrated(tmp_path, marked(tmp_path / "p.csv", 28, 0.6), "--noise", 0.6)
    assert found["verdict"]["level"] == "care"
    assert ("few_corners", "care") in codes(found)
    camera = load_camera(tmp_path / "c" / "camera.yaml")
    pixel = np.stack(np.meshgrid(np.arange(400.0, 900, 50), np.arange(250.0, 750, 50)), axis=-1)
    rays = LENS.unproject(pixel.reshape(-1, 2))
    plain = camera.camera.radial.project(rays)
    assert np.abs(camera.camera.project(rays) - plain).max() < 0.05
    off = camera.camera.project(rays) - pixel.reshape(-1, 2)
    off = np.linalg.norm(off - off.mean(axis=0), axis=1)  # without the turn
    assert np.median(off) < 3 * camera.fit.uncertainty.field.median_px < 9


def test_errors_count_by_how_exact_points_are_said_to_be(tmp_path: Path) -> None:
    table = marked(tmp_path / "p.csv", 60, 1.5)
    plain, stated = calibrated(tmp_path, table), calibrated(tmp_path, table, "--noise", 1.5)
    assert ("large_errors", "bad") in codes(plain)
    assert stated["verdict"]["level"] == "care"
    assert load_camera(tmp_path / "c" / "camera.yaml").fit.marked.noise_px == 1.5
    wrong = calibrated(tmp_path, table, "--noise", 0.2)
    assert ("large_errors", "bad") in codes(wrong)


def test_a_point_counts_by_its_weight(tmp_path: Path) -> None:
    light = calibrated(tmp_path, marked(tmp_path / "p.csv", 40, 0.3, weights=True))
    clean = calibrated(tmp_path, marked(tmp_path / "q.csv", 40, 0.3))
    assert light["median_px"] == pytest.approx(clean["median_px"], rel=0.3)


def test_too_few_points_are_refused_with_how_many_are_needed(tmp_path: Path) -> None:
    table = marked(tmp_path / "p.csv", 13, 0.5)
    line = ("calibrate", "--correspondences", table, "--size", "1280x960", "-o", tmp_path / "c")
    assert "mark at least 14" in run_cli(*line, code=1).stderr
