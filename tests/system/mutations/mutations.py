"""Lines of the maths, each with a fault that someone could make, and the tests that must see it."""

from __future__ import annotations

from typing import NamedTuple


class Mutation(NamedTuple):
    """A line that is right and one that is wrong.

    Attributes:
        module: path below the project.
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
            "cubicfish/models/lift.py",
            "XXY XXZ YYX",
            "XXY YYX XXZ",
            "cubicfish/models/test_lift cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/models/lift.py",
            "index[lower]] = power",
            "index[lower]] = 1",
            "cubicfish/models/test_lift",
        ),
        (
            "cubicfish/models/lift.py",
            "(factor.tolist())], column] -= 1",
            "(factor.tolist())], column] += 1",
            "cubicfish/models/test_lift",
        ),
        (
            "cubicfish/models/lift.py",
            "np.asarray(rotation, float).T)",
            "np.asarray(rotation, float))",
            "cubicfish/models/test_lift",
        ),
        (
            "cubicfish/models/cubic.py",
            "rays = unit_rays(points)\n        with",
            "rays = points\n        with",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/models/cubic.py",
            "<= np.deg2rad(self.max_angle_deg) + _EDGE_SLACK_RAD",
            "<= np.pi",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/models/sphere.py",
            "error <= tolerance_px",
            "error <= 1e3",
            "cubicfish/models/test_cameras system/test_numerical_truth",
        ),
        (
            "cubicfish/models/sphere.py",
            "d * miss[:, 0] - b * miss[:, 1]",
            "d * miss[:, 0] + b * miss[:, 1]",
            "cubicfish/models/test_cameras system/test_numerical_truth",
        ),
        (
            "cubicfish/geometry.py",
            "return 1 + s * (3 * k1 + s * (5",
            "return 1 + s * (3 * k1 + s * (4",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/models/radial.py",
            "slope * z / norm_squared - g",
            "slope * z / norm_squared + g",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/models/cubic.py",
            "good = (denominator > 0) & (determinant > 0)",
            "good = denominator > 0",
            "cubicfish/models/test_validity",
        ),
        # Start poses and the linear solution.
        (
            "cubicfish/fit/radial_pose.py",
            "b = -b if product < 0 else b",
            "b = b",
            "cubicfish/fit/test_start",
        ),
        (
            "cubicfish/fit/radial_pose.py",
            "for sign in (1.0, -1.0)",
            "for sign in (1.0, 1.0)",
            "cubicfish/fit/test_start",
        ),
        (
            "cubicfish/fit/nearest_cubic.py",
            "rows = values * (weight / denominator)[:, None]",
            "rows = values * weight[:, None]",
            "cubicfish/fit/test_linear",
        ),
        # The adjustment and its priors.
        (
            "cubicfish/solve/adjustment.py",
            "[cross(rotated, by_point), by_point]",
            "[-cross(rotated, by_point), by_point]",
            "cubicfish/solve/test_adjustment",
        ),
        (
            "cubicfish/solve/adjustment.py",
            "scale * (distance - 0.5 * scale)",
            "scale * distance",
            "cubicfish/solve/test_adjustment",
        ),
        (
            "cubicfish/solve/normal_equations.py",
            "shared[first:stop, -1] += prior[:-1, -1]",
            "shared[first:stop, -1] += 0",
            "cubicfish/solve/test_adjustment",
        ),
        (
            "cubicfish/fit/lenses.py",
            "slope - radial[:, None] * rays",
            "slope",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/fit/lenses.py",
            "whole[:, kept[:, None], kept] - cross.transpose(0, 2, 1) @ followed",
            "whole[:, kept[:, None], kept]",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/fit/lenses.py",
            "third + self.denominator_basis @ moved",
            "third - self.denominator_basis @ moved",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/geometry.py",
            "return 2 * p1 * y + 6 * p2 * x",
            "return 2 * p1 * x + 6 * p2 * y",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/fit/decentred.py",
            "= -focal * tilted[:, None]",
            "= focal * tilted[:, None]",
            "cubicfish/models/test_cameras",
        ),
        (
            "cubicfish/fit/alignment.py",
            "rotation.T @ poses.rotation",
            "rotation @ poses.rotation",
            "cubicfish/fit/test_frame",
        ),
        (
            "cubicfish/fit/cubic_fit.py",
            "if fault_deg is None:",
            "if True:",
            "cubicfish/fit/test_calibrate",
        ),
        # What the fit says of itself.
        (
            "cubicfish/solve/statistics.py",
            "np.mean(np.sum(residual * residual, axis=-1))",
            "np.mean(residual * residual)",
            "cubicfish/fit/test_calibrate",
        ),
        (
            "cubicfish/fit/held_out.py",
            "np.setdiff1d(np.arange(len(pairs.images)), test)",
            "np.arange(len(pairs.images))",
            "cubicfish/fit/test_calibrate cubicfish/fit/test_refinement",
        ),
        (
            "cubicfish/fit/uncertainty.py",
            "slopes.by_lens - slopes.by_turn @ self.turn",
            "slopes.by_lens + slopes.by_turn @ self.turn",
            "cubicfish/fit/test_uncertainty",
        ),
        (
            "cubicfish/sufficiency/knowledge.py",
            "by_lens.T @ by_lens - eliminated",
            "by_lens.T @ by_lens + eliminated",
            "cubicfish_cli/extensions/advice/test_advice",
        ),
        (
            "cubicfish/diagnosis/two_lenses.py",
            "own=split.own[::-1]",
            "own=split.own",
            "cubicfish_cli/diagnosis/test_diagnosis",
        ),
        # The object.
        (
            "cubicfish/target/boards/types.py",
            "tag * (1 + self.spacing) + (index",
            "tag * (2 + self.spacing) + (index",
            "cubicfish/target/test_target",
        ),
        (
            "cubicfish/target/boards/board.py",
            "np.cross(self.x_axis, self.y_axis)",
            "np.cross(self.y_axis, self.x_axis)",
            "cubicfish/target/test_target",
        ),
        # Other tools' lenses.
        (
            "cubicfish/geometry.py",
            "p2 * (3 * xx + yy)",
            "p2 * (2 * xx + yy)",
            "cubicfish_cli/extensions/formats/test_pinhole",
        ),
        (
            "cubicfish_cli/extensions/formats/ocamcalib.py",
            "angle_from_axis(points) - np.pi / 2",
            "np.pi / 2 - angle_from_axis(points)",
            "cubicfish_cli/extensions/formats/test_scaramuzza",
        ),
        # Views and maps.
        (
            "cubicfish/models/cubic.py",
            "shift = (scale - 1) / 2",
            "shift = 0.0",
            "cubicfish/views/test_frames",
        ),
        (
            "cubicfish/views/view.py",
            "np.arctan2(x, z), np.nan), slope",
            "np.arctan2(z, x), np.nan), slope",
            "cubicfish/views/test_projections",
        ),
    )
)
