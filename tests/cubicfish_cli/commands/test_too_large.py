"""Photos that show more than the target has are the first reason wherever a verdict is."""

import json

import cv2
import numpy as np
import pytest
from synthetic import checkerboard, lens_of_size, poses_around

from cubicfish import Target
from cubicfish.scene import Look, Scene
from cubicfish.scene.truth import camera_points


@pytest.mark.slow
def test_wrong_counts_are_the_first_reason_wherever_a_verdict_is(run, tmp_path, with_report):
    """A board of 8x6 that is said to be one of 7x5: half of the photos show no more than that."""
    target = Target(units="mm", boards=(checkerboard("board", 8, 6, 30.0),))
    lens = lens_of_size(0.6)
    poses = poses_around(target, 12, distance=(0.7, 0.9), off_axis_deg=35, slant_deg=40, seed=4)
    named = {f"{number:02d}": pose for number, pose in enumerate(poses)}
    pictures = Scene(target=target, lens=lens, image_size=lens.image_size).photos(named, Look())
    (tmp_path / "photos").mkdir()
    for number, ((name, picture), pose) in enumerate(zip(pictures, poses, strict=True)):
        for axis in (0, 1) if number % 2 else ():
            rim = np.array([(6.5, -2), (9, -2), (9, 9), (6.5, 9)])
            strip = (rim if axis == 0 else (rim - [2, 0])[:, ::-1]) * 30.0
            pixel = lens.project(camera_points(pose, np.pad(strip, ((0, 0), (0, 1)))))
            cv2.fillPoly(picture, [np.round(pixel * 16).astype(np.int32)], 130, cv2.LINE_AA, 4)
        cv2.imwrite(str(tmp_path / "photos" / f"{name}.png"), picture)
    folder = tmp_path / "calibration"
    options = ("--board", "7x5", "--square", "30mm", "-o", folder, "--json")
    made = json.loads(run("calibrate", tmp_path / "photos", *options).stdout)
    assert made["images"] == 6
    first = made["verdict"]["reasons"][0]
    assert (made["verdict"]["level"], first["code"]) == ("care", "too_large")
    why = "they show grids of 8x6 (in 6) inner corners, larger than any board of the target"
    assert why in first["why"]
    assert why in run("info", folder).stdout
    assert why in (folder / "report.html").read_text(encoding="utf-8")
