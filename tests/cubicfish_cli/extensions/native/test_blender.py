"""Blender, where its wheel is installed, renders through the camera that was exported to it."""

import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from lenses import cubic_camera, smaller
from synthetic import flat_board

from cubicfish import CameraFile, detect, read_picture
from cubicfish.scene.truth import rotation_matrix
from cubicfish_cli.extensions.native.source import source_text

SCRIPT = Path(__file__).parents[3] / "support" / "blender_board.py"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("bpy") is None, reason="there is no bpy")
def test_blender_shows_corners_where_the_camera_sees_them(tmp_path: Path) -> None:
    camera = replace(smaller(cubic_camera(98.0), 2), pupil_travel=3.5, units="mm")
    shader = tmp_path / "camera.osl"
    shader.write_text(source_text(CameraFile(camera=camera), "osl", "near"))
    target = flat_board()
    turn, place = rotation_matrix(np.array([0.3, -0.25, 0.1])), np.array([-150.0, -100.0, 130.0])
    # Squares around the inner corners, within a light rim.
    row, column = np.mgrid[-2:9, -2:12].reshape(2, -1)
    dark = ((row + column) % 2 == 0) & (row > -2) & (row < 8) & (column > -2) & (column < 11)
    edges = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    squares = 30.0 * (np.stack([column, row, 0 * row], axis=-1)[:, None] + edges)
    np.savez(
        tmp_path / "squares.npz",
        corners=squares @ turn.T + place,
        dark=dark,
        size=camera.image_size,
    )
    names = ("camera.osl", "squares.npz", "board.png")
    words = [sys.executable, SCRIPT, *(tmp_path / name for name in names)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    found = detect({"board.png": read_picture(tmp_path / "board.png")}, target).corners
    points = found.world @ turn.T + place
    seen = camera.project(points, near=True)
    assert len(seen) == 88
    assert np.linalg.norm(seen - camera.project(points), axis=1).max() > 0.2
    assert np.abs(found.pixel - seen).max() < 0.05
    assert np.abs((found.pixel - seen).mean(axis=0)).max() < 0.01
