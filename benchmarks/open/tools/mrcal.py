"""mrcal of Debian (apt-get install python3-mrcal), staged as mrcal-calibrate-cameras does it."""

import contextlib
import subprocess

import mrcal
import numpy as np

PYTHON = "/usr/bin/python3"
NEEDS = ("mrcal", "apt-get install python3-mrcal mrcal")
SPLINES = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=10_Ny=8_fov_x_deg={}"
VARIANTS = {"mrcal OPENCV8": 1, "mrcal splined": 1}
EXPORT = "LENSMODEL_OPENCV8, by `mrcal-convert-lensmodel` (OPENCV8 itself: without loss)"
FOCALS = np.geomspace(
    0.12, 1.2, 10
)  # of the seed, as shares of the width: it needs one about right


def solved(problem, **changes):
    """The problem with changes, solved in place; RMS as mrcal counts it."""
    problem |= {f"do_optimize_{name}": value for name, value in changes.items()}
    return mrcal.optimize(**problem)["rms_reproj_error__pixels"]


def fit(job, variant, start):
    """A stereographic seed, then the model, then the board's warp too."""
    views = list(job.views())
    columns, rows = job.one_shape()
    spacing = float(np.ptp(job.local[:, 0])) / (columns - 1)
    grid = np.full((len(views), rows, columns, 3), -1.0)  # weight -1: not seen
    for one, (_, local, _, pixel) in zip(grid, views, strict=True):
        column, row = np.rint(local / spacing).astype(int).T
        one[row, column] = np.column_stack([pixel, np.ones(len(pixel))])
    size = np.array([job.size], np.int32)
    index = np.array([[k, 0, -1] for k in range(len(views))], np.int32)
    seed = None
    for focal in FOCALS * job.size[0]:
        with contextlib.suppress(Exception):  # bare ones, where a guess is bad
            intrinsics, _, frames = mrcal.seed_stereographic(
                imagersizes=size, focal_estimate=focal, observations=grid.copy(),
                indices_frame_camera=index[:, :2].copy(), object_spacing=spacing,
            )  # fmt: skip
            problem = {
                "intrinsics": intrinsics, "extrinsics_rt_fromref": np.zeros((0, 6)),
                "frames_rt_toref": frames, "points": None, "observations_board": grid.copy(),
                "indices_frame_camintrinsics_camextrinsics": index, "observations_point": None,
                "indices_point_camintrinsics_camextrinsics": None,
                "lensmodel": "LENSMODEL_STEREOGRAPHIC", "imagersizes": size,
                "calibration_object_spacing": spacing, "do_apply_outlier_rejection": False,
                "do_apply_regularization": False, "verbose": False,
            }  # fmt: skip
            still = {"intrinsics_distortions": False, "extrinsics": False, "calobject_warp": False}
            solved(problem, intrinsics_core=False, frames=True, **still)
            rms = solved(problem, intrinsics_core=True)
            if np.isfinite(rms) and (seed is None or rms < seed[0]):
                seed = rms, problem
    if seed is None:
        raise ValueError("no focal length gives a seed")
    problem, model = seed[1], "LENSMODEL_OPENCV8"
    if "splined" in variant:
        pixel = np.concatenate([one[3] for one in views])
        rays = mrcal.unproject(
            pixel, problem["lensmodel"], problem["intrinsics"][0], normalize=True
        )
        wide = 2 * np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1)).max()) + 10
        model = SPLINES.format(int(min(wide, 330)))
    more = mrcal.lensmodel_num_params(model) - problem["intrinsics"].shape[-1]
    noise = (np.random.default_rng(0).random((1, more)) - 0.5) * 2e-6
    problem["intrinsics"] = np.concatenate([problem["intrinsics"], noise], axis=-1)
    problem |= {
        "lensmodel": model,
        "do_apply_outlier_rejection": True,
        "do_apply_regularization": True,
    }
    solved(problem, intrinsics_core="splined" not in variant, intrinsics_distortions=True)
    problem["calobject_warp"] = np.zeros(2)
    rms = solved(problem, calobject_warp=True)
    board = mrcal.ref_calibration_object(
        columns, rows, spacing, calobject_warp=problem["calobject_warp"]
    )
    column, row = np.rint(job.local / spacing).astype(int).T
    return {
        "problem": problem,
        "world": job.lifted(board[row, column, 2]),
        "claimed": {"rms_px": rms},
    }


def project(model, points):
    return mrcal.project(points, model["problem"]["lensmodel"], model["problem"]["intrinsics"][0])


def export(model, folder):
    """What OpenCV reads: the nearest OPENCV8."""
    if "OPENCV" in model["problem"]["lensmodel"]:
        return None
    file = folder / "lens.cameramodel"
    mrcal.cameramodel(optimization_inputs=model["problem"], icam_intrinsics=0).write(str(file))
    command = ["mrcal-convert-lensmodel", "--sampled", "--intrinsics-only", "LENSMODEL_OPENCV8", "-"]
    told = subprocess.run(command, input=file.read_bytes(), capture_output=True, timeout=300)
    if told.returncode:
        raise ValueError(told.stderr.decode().strip().splitlines()[-1])
    file.write_bytes(told.stdout)
    lens = mrcal.cameramodel(str(file)).intrinsics()
    return lambda points: np.where(points[:, 2:] > 0, mrcal.project(points, *lens), np.nan)
