"""mrcal of Debian, staged as mrcal-calibrate-cameras does it."""

import contextlib

import mrcal
import numpy as np

PYTHON = "/usr/bin/python3"
NEEDS = ("mrcal", "apt-get install python3-mrcal python3-scipy")
VERSION = ["dpkg-query", "-W", "python3-mrcal"]
VARIANTS = {"mrcal OPENCV8": 1, "mrcal splined": 1}
EXPORT = "its own .cameramodel, without loss"
SPLINES = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=10_Ny=8_fov_x_deg={:.0f}"
FOCALS = np.geomspace(0.15, 1.2, 6)  # to try for the seed, as shares of the width
STILL = {"intrinsics_distortions": False, "extrinsics": False, "calobject_warp": False}


def solved(problem, **changes):
    """The problem solved in place, with other switches; its RMS as mrcal counts it."""
    problem |= {f"do_optimize_{name}": value for name, value in changes.items()}
    return mrcal.optimize(**problem)["rms_reproj_error__pixels"]


def seeded(problem, focal):
    """The stereographic solution from a focal length: (RMS, problem)."""
    problem = problem | {"observations_board": problem["observations_board"].copy()}
    problem["intrinsics"], _, problem["frames_rt_toref"] = mrcal.seed_stereographic(
        imagersizes=problem["imagersizes"], focal_estimate=focal,
        indices_frame_camera=problem["indices_frame_camintrinsics_camextrinsics"][:, :2].copy(),
        observations=problem["observations_board"].copy(),
        object_spacing=problem["calibration_object_spacing"],
    )  # fmt: skip
    solved(problem, intrinsics_core=False, frames=True, **STILL)
    return solved(problem, intrinsics_core=True), problem


def fit(job, variant, start):
    """A stereographic seed, then the model, then the board's warp too."""
    views, (columns, rows, side) = list(job.views()), job.one_shape()
    grid = np.full((len(views), rows, columns, 3), -1.0)  # weight -1: not seen
    for one, (_, point, pixel) in zip(grid, views, strict=True):
        one[job.row[point], job.column[point]] = np.column_stack([pixel, np.ones(len(pixel))])
    problem = {
        "extrinsics_rt_fromref": np.zeros((0, 6)), "points": None, "observations_board": grid,
        "indices_frame_camintrinsics_camextrinsics":
            np.array([[k, 0, -1] for k in range(len(views))], np.int32),
        "observations_point": None, "indices_point_camintrinsics_camextrinsics": None,
        "lensmodel": "LENSMODEL_STEREOGRAPHIC", "imagersizes": np.array([job.size], np.int32),
        "calibration_object_spacing": side, "do_apply_outlier_rejection": False,
        "do_apply_regularization": False, "verbose": False,
    }  # fmt: skip
    seeds = []
    for focal in FOCALS * job.size[0]:
        with contextlib.suppress(Exception):  # bare ones, where a guess is bad
            seeds.append(seeded(problem, focal))
    _, problem = min((one for one in seeds if np.isfinite(one[0])), key=lambda one: one[0])
    model = "LENSMODEL_OPENCV8"
    if "splined" in variant:
        pixel = np.concatenate([pixel for _, _, pixel in views])
        rays = mrcal.unproject(
            pixel, problem["lensmodel"], problem["intrinsics"][0], normalize=True
        )
        wide = 2 * np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1)).max()) + 10
        model = SPLINES.format(min(wide, 330))
    more = mrcal.lensmodel_num_params(model) - problem["intrinsics"].shape[-1]
    noise = (np.random.default_rng(0).random((1, more)) - 0.5) * 2e-6
    problem["intrinsics"] = np.concatenate([problem["intrinsics"], noise], axis=-1)
    problem |= dict.fromkeys(("do_apply_outlier_rejection", "do_apply_regularization"), True)
    problem["lensmodel"] = model
    solved(problem, intrinsics_core="splined" not in variant, intrinsics_distortions=True)
    warp = problem["calobject_warp"] = np.zeros(2)
    rms = solved(problem, calobject_warp=True)
    bent = mrcal.ref_calibration_object(columns, rows, side, calobject_warp=warp)[..., 2]
    return {
        "lens": (model, problem["intrinsics"][0]),
        "world": job.lifted(bent[job.row, job.column]),
        "claimed": {"rms_px": rms},
    }


def project(model, points):
    return mrcal.project(np.ascontiguousarray(points), *model["lens"])
