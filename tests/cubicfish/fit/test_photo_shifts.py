"""How far the camera moves without a photo, beside fits without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import SAMPLE

from cubicfish import Target, load_corners
from cubicfish.fit import photo_shifts
from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.fit.photo_shifts import photo_shifts_px
from cubicfish.fit.prior import EXPECTED
from cubicfish.fit.radial_reference import fit_radial, refit_radial
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.poses import cross_matrix
from cubicfish.solve.subset import middle, select_photos, world_scale
from cubicfish.types import FloatArray


@pytest.fixture(scope="module")
def fit() -> CameraFit:
    pairs = load_corners(SAMPLE / "true_corners.csv", Target.load(SAMPLE / "target.yaml"))
    noise = np.random.default_rng(0).normal(0, 0.1, pairs.pixel.shape)
    pairs = replace(pairs, pixel=pairs.pixel + noise)
    pairs = pairs.with_world((pairs.world - middle(pairs)) / world_scale(pairs))
    return fit_cubic(fit_radial(pairs), EXPECTED)


def moved_px(after: CameraFit, before: CameraFit, rays: FloatArray) -> float:
    """RMS of the pixels' difference, without the turn that makes it least."""
    _, by_point, _ = before.lens.far_jacobian(rays)
    turned = (-by_point @ cross_matrix(rays)).reshape(-1, 3)
    moved = (after.lens.far(rays) - before.lens.far(rays)).reshape(-1)
    left = moved - turned @ np.linalg.lstsq(turned, moved, rcond=None)[0]
    return float(np.linalg.norm(left) / np.sqrt(len(rays)))


def test_a_photo_moves_the_camera_as_a_fit_without_it_says(fit: CameraFit) -> None:
    rays = cone_rays(fit.reference.covered, 300)
    shifts, photos = photo_shifts_px(fit, rays), np.arange(len(fit.poses))
    assert len(shifts) == len(photos)
    for photo in np.argsort(shifts)[[-1, -4]].tolist():
        others = np.delete(photos, photo)
        pairs = select_photos(fit.pairs, others)
        again = fit_cubic(refit_radial(fit.reference, pairs, fit.poses[others]), EXPECTED)
        assert shifts[photo] == pytest.approx(moved_px(again, fit, rays), rel=0.1)


def test_of_many_photos_the_equations_are_those_of_all(
    fit: CameraFit, monkeypatch: pytest.MonkeyPatch
) -> None:
    rays = cone_rays(fit.reference.covered, 100)
    alone = photo_shifts_px(fit, rays)
    monkeypatch.setattr(photo_shifts, "_MOST_ALONE", 1)
    kept = photo_shifts_px(fit, rays)
    assert all(0.5 * one < other < one for one, other in zip(alone, kept, strict=True))
    monkeypatch.setattr(photo_shifts, "_MOST", 5)
    assert photo_shifts_px(fit, rays) == [None] * len(alone)
