"""A camera turned into its reference's frame is the same camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lenses import cubic_camera, random_rays

from cubicfish.comparison import aligned_difference
from cubicfish.fit.alignment import in_references_frame
from cubicfish.models.lift import lift_rotation
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.poses import Poses, rotation_from_vector

COVERED = np.deg2rad(80.0)


def test_the_frame_is_turned_and_no_corner_moves():
    turned = rotation_from_vector([[0.004, -0.003, 0.002]])[0]
    camera = cubic_camera(90.0, bend=0.001)
    camera = replace(camera, P=camera.P @ lift_rotation(turned))
    rotation = rotation_from_vector([[0.3, -0.2, 0.9], [-0.4, 0.1, 2.0]])
    poses = Poses(rotation=rotation, translation=np.array([[0.1, -0.2, 3.0], [0.4, 0.2, 2.5]]))
    image = np.repeat([0, 1], 200)
    points = np.concatenate([random_rays(70.0, 200, seed) for seed in (1, 2)])
    # World points that the two photos see along those rays.
    world = ((points * 3 - poses.translation[image])[:, None] @ poses.rotation[image])[:, 0]
    before = camera.project(poses.apply(image, world))

    new, new_poses = in_references_frame(camera, poses, COVERED)

    after = new.project(new_poses.apply(image, world))
    assert np.isfinite(before).all()
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-8)
    _, left = aligned_difference(new, new.radial, cone_rays(COVERED, 2000))
    _, had = aligned_difference(camera, camera.radial, cone_rays(COVERED, 2000))
    angle = [np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)) for turn in (left, had)]
    assert angle[1] > 0.003
    assert angle[0] < 1e-4 * angle[1]
    assert abs(np.linalg.norm(new.P) - 1) < 1e-12


def test_a_frame_whose_cone_would_hold_a_pole_stays():
    camera = cubic_camera(90.0, bend=0.0)
    wild = replace(camera, P=camera.P * np.array([[1.0], [1.0], [-1.0]]))
    poses = Poses(rotation=np.eye(3)[None], translation=np.zeros((1, 3)))
    new, new_poses = in_references_frame(wild, poses, COVERED)
    assert new is wild
    assert new_poses is poses
