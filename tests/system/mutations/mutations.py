"""Lines of the maths, each with a fault that someone could make, and the tests that must see it."""

from __future__ import annotations

from typing import NamedTuple


class Mutation(NamedTuple):
    """A line that is right and one that is wrong.

    Attributes:
        module: path below ``cubicfish_cli``.
        right: text that stands there exactly once.
        wrong: what takes its place.
        tests: test files that must fail then, below ``tests`` and without ``.py``.

    """

    module: str
    right: str
    wrong: str
    tests: tuple[str, ...]


MUTATIONS = tuple(
    Mutation(module, right, wrong, tuple(tests.split()))
    for module, right, wrong, tests in (
        # The lift and the camera.
        ("lenses/lift.py", "XXY XXZ YYX", "XXY YYX XXZ", "lenses/test_lift lenses/test_cameras"),
        ("lenses/lift.py", "share = 1 / len", "share = 1.01 / len", "lenses/test_lift"),
        (
            "lenses/lift.py",
            "(factor.tolist())], column] -= 1",
            "(factor.tolist())], column] += 1",
            "lenses/test_lift",
        ),
        (
            "lenses/lift.py",
            "np.asarray(rotation, float).T)",
            "np.asarray(rotation, float))",
            "lenses/test_lift",
        ),
        (
            "lenses/cubic.py",
            "rays = unit_rays(points)\n        with",
            "rays = points\n        with",
            "lenses/test_cameras",
        ),
        (
            "lenses/cubic.py",
            "<= np.deg2rad(self.max_angle_deg) + _EDGE_SLACK_RAD",
            "<= np.pi",
            "lenses/test_cameras",
        ),
        (
            "lenses/sphere.py",
            "error <= tolerance_px",
            "error <= 1e3",
            "lenses/test_cameras system/test_numerical_truth",
        ),
        (
            "lenses/sphere.py",
            "d * miss[:, 0] - b * miss[:, 1]",
            "d * miss[:, 0] + b * miss[:, 1]",
            "lenses/test_cameras system/test_numerical_truth",
        ),
        (
            "geometry.py",
            "return 1 + s * (3 * k1 + s * (5",
            "return 1 + s * (3 * k1 + s * (4",
            "lenses/test_cameras",
        ),
        (
            "lenses/radial.py",
            "slope * z / norm_squared - g",
            "slope * z / norm_squared + g",
            "lenses/test_cameras",
        ),
        (
            "lenses/cubic.py",
            "good = (denominator > 0) & (determinant > 0)",
            "good = denominator > 0",
            "lenses/test_validity",
        ),
        # Start poses and the linear solution.
        ("fitting/radial_pose.py", "b = -b if product < 0 else b", "b = b", "fitting/test_start"),
        (
            "fitting/radial_pose.py",
            "for sign in (1.0, -1.0)",
            "for sign in (1.0, 1.0)",
            "fitting/test_start",
        ),
        (
            "fitting/linear.py",
            "rows = values * (weight / denominator)[:, None]",
            "rows = values * weight[:, None]",
            "fitting/test_linear",
        ),
        # The adjustment and its priors.
        (
            "fitting/linearise.py",
            "d_turn, d_shift = cross",
            "d_turn, d_shift = -cross",
            "fitting/test_adjustment",
        ),
        (
            "fitting/linearise.py",
            "scale * (distance - 0.5 * scale)",
            "scale * distance",
            "fitting/test_adjustment",
        ),
        (
            "fitting/normal_equations.py",
            "gradient[own] += prior[:-1, -1]",
            "gradient",
            "fitting/test_adjustment",
        ),
        ("fitting/lenses.py", "slope - radial[:, None] * rays", "slope", "lenses/test_cameras"),
        (
            "fitting/lenses.py",
            "whole[:, kept[:, None], kept] - cross.transpose(0, 2, 1) @ followed",
            "whole[:, kept[:, None], kept]",
            "lenses/test_cameras",
        ),
        (
            "fitting/lenses.py",
            "self.coefficients[2] + self.denominator_basis @ moved",
            "self.coefficients[2] - self.denominator_basis @ moved",
            "lenses/test_cameras",
        ),
        (
            "geometry.py",
            "return 2 * p1 * y + 6 * p2 * x",
            "return 2 * p1 * x + 6 * p2 * y",
            "lenses/test_cameras",
        ),
        (
            "fitting/asymmetric.py",
            "= -self.values[:2, None, None] * self.tilted[:, None]",
            "= self.values[:2, None, None] * self.tilted[:, None]",
            "lenses/test_cameras",
        ),
        (
            "fitting/frame.py",
            "rotation.T @ poses.rotation",
            "rotation @ poses.rotation",
            "fitting/test_frame",
        ),
        (
            "fitting/cubic_fit.py",
            "if validity.valid:",
            "if True:",
            "fitting/test_calibrate",
        ),
        # What the fit says of itself.
        (
            "fitting/statistics.py",
            "np.mean(np.sum(residual * residual, axis=-1))",
            "np.mean(residual * residual)",
            "fitting/test_calibrate",
        ),
        (
            "fitting/held_out.py",
            "np.setdiff1d(np.arange(len(pairs.images)), test)",
            "np.arange(len(pairs.images))",
            "fitting/test_calibrate fitting/test_refinement",
        ),
        (
            "fitting/uncertainty.py",
            "by_lens - turned @ self.turn",
            "by_lens + turned @ self.turn",
            "fitting/test_uncertainty",
        ),
        (
            "fitting/uncertainty.py",
            "hessian[lens, lens] += by_lens.T @ by_lens - cross",
            "hessian[lens, lens] += by_lens.T @ by_lens + cross",
            "advice/test_advice",
        ),
        (
            "diagnosis/two_lenses.py",
            "own=split.own[::-1]",
            "own=split.own",
            "diagnosis/test_diagnosis",
        ),
        # The object.
        (
            "boards/aprilgrid.py",
            "tag * (1 + self.spacing) + (index",
            "tag * (2 + self.spacing) + (index",
            "test_target",
        ),
        (
            "boards/board.py",
            "np.cross(self.x_axis, self.y_axis)",
            "np.cross(self.y_axis, self.x_axis)",
            "test_target",
        ),
        # Other tools' lenses.
        (
            "geometry.py",
            "p2 * (3 * xx + yy)",
            "p2 * (2 * xx + yy)",
            "lenses/test_pinhole",
        ),
        (
            "lenses/scaramuzza.py",
            "angle_from_axis(points) - np.pi / 2",
            "np.pi / 2 - angle_from_axis(points)",
            "lenses/test_scaramuzza",
        ),
        # Views and maps.
        (
            "undistortion/maps.py",
            "shift = (scale - 1) / 2",
            "shift = 0.0",
            "undistortion/test_frames",
        ),
        (
            "undistortion/projections.py",
            "np.arctan2(x, z), np.nan), slope",
            "np.arctan2(z, x), np.nan), slope",
            "undistortion/test_projections",
        ),
    )
)
