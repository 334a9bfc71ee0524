"""Tabulated rays, and photos of which only the edges are sub-sampled."""

import numpy as np
import pytest
from synthetic import corner_of_three, lens_of_size, plain_background, poses_around

from cubicfish.scene.photos import RayGrid, render

LENS = lens_of_size(0.5)
SIZE = LENS.image_size


def test_rays_between_pixels_are_the_lenss():
    grid = RayGrid.of(LENS.unproject, SIZE)
    pixel = np.random.default_rng(0).uniform((-0.5, -0.5), np.array(SIZE) - 0.5, (5000, 2))
    rays, exact = grid(pixel), LENS.unproject(pixel)
    seen = np.isfinite(exact[:, 0]) & np.isfinite(rays[:, 0])
    # At the rim a pixel is in the field or not, with all its rays.
    assert (np.isfinite(exact[:, 0]) != np.isfinite(rays[:, 0])).mean() < 0.01
    off = np.linalg.norm(LENS.project(rays[seen]) - pixel[seen], axis=1)
    assert np.nanmax(off) < 5e-3
    assert np.isfinite(off).mean() > 0.99


@pytest.mark.slow
def test_photos_with_smooth_edges_alone_are_the_same_photos():
    target = corner_of_three()
    pose = poses_around(target, 1, seed=3)[0]
    options = {"noise": 0, "blur": 0, "supersample": 3, "background": plain_background}
    whole = render(target, LENS.unproject, pose, SIZE, **options).astype(int)
    edges = render(target, LENS.unproject, pose, SIZE, **options)
    hard = render(target, LENS.unproject, pose, SIZE, **options | {"supersample": 1})
    assert (np.abs(edges - whole) > 1).mean() < 2e-4
    assert (np.abs(hard - whole) > 1).mean() > 0.02
    grid = render(target, RayGrid.of(LENS.unproject, SIZE), pose, SIZE, **options)
    assert (np.abs(grid - whole) > 2).mean() < 0.01


def test_a_dark_photo_is_the_same_with_less_light():
    target = corner_of_three()
    pose = poses_around(target, 1, seed=3)[0]
    bright, dark = (
        render(target, LENS.unproject, pose, SIZE, supersample=1, noise=0, exposure=light) - 6.0
        for light in (1.0, 0.5)
    )
    np.testing.assert_allclose(dark, bright / 2, atol=1)


def test_a_lamp_from_behind_leaves_boards_in_the_ambient_light():
    target = corner_of_three()
    pose = poses_around(target, 1, seed=3)[0]
    lit, unlit = (
        render(target, LENS.unproject, pose, SIZE, supersample=1, noise=0, light_from=lamp)
        for lamp in (np.ones(3) / np.sqrt(3), -np.ones(3) / np.sqrt(3))
    )
    assert lit.max() > 1.2 * unlit.max()
