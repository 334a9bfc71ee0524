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
        (
            "core/lenses/lift.py",
            "XXY XXZ YYX",
            "XXY YYX XXZ",
            "core/lenses/test_lift core/lenses/test_cameras",
        ),
        ("core/lenses/lift.py", "share = 1 / len", "share = 1.01 / len", "core/lenses/test_lift"),
        (
            "core/lenses/lift.py",
            "(factor.tolist())], column] -= 1",
            "(factor.tolist())], column] += 1",
            "core/lenses/test_lift",
        ),
        (
            "core/lenses/lift.py",
            "np.asarray(rotation, float).T)",
            "np.asarray(rotation, float))",
            "core/lenses/test_lift",
        ),
        (
            "core/lenses/cubic.py",
            "rays = unit_rays(points)\n        with",
            "rays = points\n        with",
            "core/lenses/test_cameras",
        ),
        (
            "core/lenses/cubic.py",
            "<= np.deg2rad(self.max_angle_deg) + _EDGE_SLACK_RAD",
            "<= np.pi",
            "core/lenses/test_cameras",
        ),
        (
            "core/lenses/sphere.py",
            "error <= tolerance_px",
            "error <= 1e3",
            "core/lenses/test_cameras system/test_numerical_truth",
        ),
        (
            "core/lenses/sphere.py",
            "d * miss[:, 0] - b * miss[:, 1]",
            "d * miss[:, 0] + b * miss[:, 1]",
            "core/lenses/test_cameras system/test_numerical_truth",
        ),
        (
            "core/geometry.py",
            "return 1 + s * (3 * k1 + s * (5",
            "return 1 + s * (3 * k1 + s * (4",
            "core/lenses/test_cameras",
        ),
        (
            "core/lenses/radial.py",
            "slope * z / norm_squared - g",
            "slope * z / norm_squared + g",
            "core/lenses/test_cameras",
        ),
        (
            "core/lenses/cubic.py",
            "good = (denominator > 0) & (determinant > 0)",
            "good = denominator > 0",
            "core/lenses/test_validity",
        ),
        # Start poses and the linear solution.
        ("core/fit/radial_pose.py", "b = -b if product < 0 else b", "b = b", "core/fit/test_start"),
        (
            "core/fit/radial_pose.py",
            "for sign in (1.0, -1.0)",
            "for sign in (1.0, 1.0)",
            "core/fit/test_start",
        ),
        (
            "core/fit/nearest_cubic.py",
            "rows = values * (weight / denominator)[:, None]",
            "rows = values * weight[:, None]",
            "core/fit/test_linear",
        ),
        # The adjustment and its priors.
        (
            "core/fit/adjustment.py",
            "[cross(rotated, by_point).transpose(2, 0, 1), d_point]",
            "[-cross(rotated, by_point).transpose(2, 0, 1), d_point]",
            "core/fit/test_adjustment",
        ),
        (
            "core/fit/adjustment.py",
            "scale * (distance - 0.5 * scale)",
            "scale * distance",
            "core/fit/test_adjustment",
        ),
        (
            "core/fit/normal_equations.py",
            "shared[np.ix_(own, np.append(own, -1))] += prior[:-1]",
            "shared[np.ix_(own, own)] += prior[:-1, :-1]",
            "core/fit/test_adjustment",
        ),
        (
            "core/fit/lenses.py",
            "slope - radial[:, None] * rays",
            "slope",
            "core/lenses/test_cameras",
        ),
        (
            "core/fit/lenses.py",
            "whole[:, kept[:, None], kept] - cross.transpose(0, 2, 1) @ followed",
            "whole[:, kept[:, None], kept]",
            "core/lenses/test_cameras",
        ),
        (
            "core/fit/lenses.py",
            "third + self.denominator_basis @ moved",
            "third - self.denominator_basis @ moved",
            "core/lenses/test_cameras",
        ),
        (
            "core/geometry.py",
            "return 2 * p1 * y + 6 * p2 * x",
            "return 2 * p1 * x + 6 * p2 * y",
            "core/lenses/test_cameras",
        ),
        (
            "core/fit/asymmetric.py",
            "= -focal * tilted[:, None]",
            "= focal * tilted[:, None]",
            "core/lenses/test_cameras",
        ),
        (
            "core/fit/alignment.py",
            "rotation.T @ poses.rotation",
            "rotation @ poses.rotation",
            "core/fit/test_frame",
        ),
        (
            "core/fit/cubic_fit.py",
            "if fault_deg is None:",
            "if True:",
            "core/fit/test_calibrate",
        ),
        # What the fit says of itself.
        (
            "core/fit/statistics.py",
            "np.mean(np.sum(residual * residual, axis=-1))",
            "np.mean(residual * residual)",
            "core/fit/test_calibrate",
        ),
        (
            "core/fit/held_out.py",
            "np.setdiff1d(np.arange(len(pairs.images)), test)",
            "np.arange(len(pairs.images))",
            "core/fit/test_calibrate core/fit/test_refinement",
        ),
        (
            "core/fit/uncertainty.py",
            "by_lens - turned @ self.turn",
            "by_lens + turned @ self.turn",
            "core/fit/test_uncertainty",
        ),
        (
            "extensions/advice/information.py",
            "hessian[lens, lens] += by_lens.T @ by_lens - cross",
            "hessian[lens, lens] += by_lens.T @ by_lens + cross",
            "extensions/advice/test_advice",
        ),
        (
            "app/diagnosis/two_lenses.py",
            "own=split.own[::-1]",
            "own=split.own",
            "app/diagnosis/test_diagnosis",
        ),
        # The object.
        (
            "core/boards/types.py",
            "tag * (1 + self.spacing) + (index",
            "tag * (2 + self.spacing) + (index",
            "core/test_target",
        ),
        (
            "core/boards/board.py",
            "np.cross(self.x_axis, self.y_axis)",
            "np.cross(self.y_axis, self.x_axis)",
            "core/test_target",
        ),
        # Other tools' lenses.
        (
            "core/geometry.py",
            "p2 * (3 * xx + yy)",
            "p2 * (2 * xx + yy)",
            "extensions/formats/test_pinhole",
        ),
        (
            "extensions/formats/ocamcalib.py",
            "angle_from_axis(points) - np.pi / 2",
            "np.pi / 2 - angle_from_axis(points)",
            "extensions/formats/test_scaramuzza",
        ),
        # Views and maps.
        (
            "core/views/maps.py",
            "shift = (scale - 1) / 2",
            "shift = 0.0",
            "core/views/test_frames",
        ),
        (
            "core/views/view.py",
            "np.arctan2(x, z), np.nan), slope",
            "np.arctan2(z, x), np.nan), slope",
            "core/views/test_projections",
        ),
    )
)
