"""The cubic's start: no pole that corners happen to miss."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from asymmetric_lens import AsymmetricLens
from simulated import CornerErrors, simulated_corners

from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.nearest_cubic import MARGIN_DEG, cone_angle, linear_cubic
from cubicfish.fit.prior import EXPECTED, decentred_lens
from cubicfish.fit.radial_reference import fit_radial, refit_radial
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.statistics import huber_px
from cubicfish.solve.subset import world_scale
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.target import Target

TARGET = Target(units="mm", boards=(synthetic.checkerboard("board", 9, 6, 30.0),))


# Its profile bends up and down again beyond 20°.
BENT_TWICE = AsymmetricLens(
    image_size=(640, 480), fx=540.0, fy=539.0, cx=330.6, cy=245.2,
    k=(0.08823282, -0.46934271, 1.42274144, -1.53901124), max_angle_deg=36.0,
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("photos", "seed"), [(6, 14), (6, 33)])
def test_a_pole_that_corners_miss_is_no_start(photos, seed):
    """Of a narrow lens the linear solution has one: denominator and numerators vanish."""
    errors = CornerErrors(noise=0.1)
    seen, _ = simulated_corners(BENT_TWICE, TARGET, photos, seed=seed, errors=errors)
    seen = seen.with_target(TARGET)
    reference = fit_radial(seen.with_world(seen.world / world_scale(seen)))
    cone = float(np.rad2deg(cone_angle(reference.camera, reference.covered, MARGIN_DEG)))
    near, (bent, _) = reference.cubic, decentred_lens(reference, EXPECTED.spread)
    weights = np.where(near.within, 1.0, 0.1)
    most_exact = linear_cubic(
        near.rays,
        bent.project(near.rays),
        reference.camera,
        denominator_pull=1e-4,
        weights=weights,
    )
    assert pole_or_fold_deg(most_exact.P, cone) is not None
    assert pole_or_fold_deg(near.lens.P, cone) is None
    fit = fit_cubic(reference, EXPECTED)
    assert pole_or_fold_deg(fit.lens.P, fit.max_angle_deg) is None
    assert fit.prior == EXPECTED


class NarrowLens:
    """A lens of the shop for machine vision: Brown's barrel distortion, decentred, no fisheye."""

    def __init__(self, width_deg: float) -> None:
        self.image_size = (960, 720)
        half = np.tan(np.radians(width_deg / 2))
        self.focal = 480 / (half * (1 - 0.12))
        self.k = np.array([-0.16, 0.05]) / half ** np.array([2, 4])
        self.p = np.array([4e-4, -6e-4]) / half
        self.max_angle_deg = float(np.rad2deg(np.arctan(1.25 * half)))  # the picture's corners

    def project(self, points):
        points = np.asarray(points, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = np.moveaxis(points[..., :2] / points[..., 2:], -1, 0)
        square = a * a + b * b
        ratio = 1 + self.k[0] * square + self.k[1] * square**2
        p1, p2 = self.p
        x = a * ratio + 2 * p1 * a * b + p2 * (square + 2 * a * a)
        y = b * ratio + p1 * (square + 2 * b * b) + 2 * p2 * a * b
        pixel = self.focal * np.stack([x, y], axis=-1) + [482.3, 356.1]
        seen = points[..., 2] > np.cos(np.radians(self.max_angle_deg)) * np.linalg.norm(
            points, axis=-1
        )
        return np.where(seen[..., None], pixel, np.nan)

    def unproject(self, pixel):
        start = (np.asarray(pixel, float) - [482.3, 356.1]) / self.focal
        found = start
        for _ in range(40):
            with_depth = np.concatenate([found, np.ones_like(found[..., :1])], axis=-1)
            found = found + start - (self.project(with_depth) - [482.3, 356.1]) / self.focal
        rays = np.concatenate([found, np.ones_like(found[..., :1])], axis=-1)
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize("width_deg", [40, 70, 100])
def test_a_narrow_camera_is_no_worse_than_its_radial_lens(width_deg):
    """Although corners are off by a twentieth of a square of where they are drawn."""
    board = synthetic.checkerboard("board", 9, 6, 30.0)
    rng = np.random.default_rng(width_deg)
    offsets = rng.normal(0, 0.05 * 30, (board.rows, board.columns, 3)) * [1, 1, 0]
    shape = BoardShape(bend=np.zeros(2), twist=0.0, stretch=np.zeros(2), offsets=offsets)
    real = replace(TARGET, boards=(replace(board, shape=shape),))
    seen, _ = simulated_corners(NarrowLens(width_deg), real, 16, seed=width_deg)
    kept = []
    found = calibrate(
        seen.with_target(TARGET),
        target=TARGET,
        diagnose=lambda evidence: kept.append(evidence) or (),
    )
    assert found.refined == "points"
    assert found.held_out.rms_px <= 1.005 * found.held_out.radial_rms_px
    # Far from the end, and beside it, other starts lead there too.
    (evidence,) = kept
    fit = evidence.fit
    limit, world = huber_px(fit.errors), fit.world
    ends = [
        adjust(lens, poses, fit.reference.pairs, huber_px=limit, world=world).cost
        for lens, poses in fit.prior.starts(fit.reference, fit, fit.errors)
    ]
    assert len(ends) == 5
    assert ends == pytest.approx([ends[0]] * 5, rel=1e-3)


@pytest.mark.slow
def test_the_prior_is_of_the_reference_that_the_fit_has_now():
    """Not of the one that a warm start was fitted with, whose noise and corners are others."""
    seen, _ = simulated_corners(BENT_TWICE, TARGET, 8, seed=3)
    pairs = seen.with_target(TARGET)
    rough = fit_radial(pairs.with_world(pairs.world / world_scale(pairs)))
    first = fit_cubic(rough, EXPECTED)
    noisy = rough.pairs.pixel + np.random.default_rng(1).normal(0, 0.5, rough.pairs.pixel.shape)
    other = refit_radial(rough, replace(rough.pairs, pixel=noisy), rough.poses)
    warm, fresh = fit_cubic(other, EXPECTED, start=first), fit_cubic(other, EXPECTED)
    for prior in (warm.lens.tie, fresh.lens.tie):
        assert prior.near.rays is other.cubic.rays
        assert prior.denominator_weight > 2 * first.lens.tie.denominator_weight
    # Each with its own loss at the end, which follows the noise.
    warm, fresh = (fit_cubic(other, EXPECTED, start=one) for one in (warm, fresh))
    assert warm.cost == pytest.approx(fresh.cost, rel=1e-4)
    rays = other.cubic.rays[other.cubic.within]
    np.testing.assert_allclose(warm.lens.far(rays), fresh.lens.far(rays), atol=1e-3)
