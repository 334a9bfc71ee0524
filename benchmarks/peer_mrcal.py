"""mrcal's part of peers.py, run by the Python that has mrcal (Debian: python3-mrcal).

``python3 peer_mrcal.py CORNERS.npz`` prints one JSON object: by model, residuals and seconds.
Seeds and stages are those of mrcal-calibrate-cameras.
"""

import json
import sys
import time

import mrcal
import numpy as np

# Stereographic focal lengths to try, as shares of the photo's width; mrcal needs one that is
# about right.
FOCALS = np.geomspace(0.12, 1.2, 14)
RUNS = 5  # of each model, of which the quickest counts


def observations_of(grid):
    """(M, H, W, 2) with NaN where nothing was seen -> (M, H, W, 3) with weights."""
    seen = np.isfinite(grid[..., :1])
    return np.concatenate([np.nan_to_num(grid), np.where(seen, 1.0, -1.0)], axis=-1)


def frames_of(count):
    """One camera that sees each board once."""
    index = np.arange(count)
    camera, moved = np.zeros(count, int), np.full(count, -1)
    return np.stack([index, camera, moved], axis=-1).astype(np.int32)


def inputs(lensmodel, intrinsics, frames, observations, size, spacing, **options):
    """What mrcal.optimize takes."""
    return {
        "intrinsics": intrinsics,
        "extrinsics_rt_fromref": np.zeros((0, 6)),
        "frames_rt_toref": frames,
        "points": None,
        "observations_board": observations.copy(),
        "indices_frame_camintrinsics_camextrinsics": frames_of(len(observations)),
        "observations_point": None,
        "indices_point_camintrinsics_camextrinsics": None,
        "lensmodel": lensmodel,
        "imagersizes": size,
        "calibration_object_spacing": spacing,
        "do_optimize_intrinsics_core": False,
        "do_optimize_intrinsics_distortions": False,
        "do_optimize_extrinsics": False,
        "do_optimize_frames": True,
        "do_optimize_calobject_warp": False,
        "do_apply_outlier_rejection": False,
        "do_apply_regularization": False,
        "verbose": False,
        **options,
    }


def stereographic(focal, observations, size, spacing):
    """Seed and two solves of the stereographic model; RMS, intrinsics, frames."""
    index = frames_of(len(observations))[:, :2].copy()
    intrinsics, _, frames = mrcal.seed_stereographic(
        imagersizes=size,
        focal_estimate=focal,
        indices_frame_camera=index,
        observations=observations.copy(),
        object_spacing=spacing,
    )
    stats = None
    for core in (False, True):
        problem = inputs(
            "LENSMODEL_STEREOGRAPHIC", intrinsics, frames, observations, size, spacing,
            do_optimize_intrinsics_core=core,
        )  # fmt: skip
        stats = mrcal.optimize(**problem)
        intrinsics, frames = problem["intrinsics"], problem["frames_rt_toref"]
    return stats["rms_reproj_error__pixels"], intrinsics, frames


def seed(observations, size, spacing, focals):
    """The best stereographic solution over focal lengths."""
    best = None
    for focal in focals:
        try:
            found = stereographic(focal, observations, size, spacing)
        except Exception:  # mrcal raises bare exceptions where a guess is bad
            continue
        if np.isfinite(found[0]) and (best is None or found[0] < best[0]):
            best = found
    return best


def calibrate(lensmodel, start, observations, size, spacing, warp):
    """All stages; intrinsics, frames, warp."""
    _, intrinsics, frames = start
    more = mrcal.lensmodel_num_params(lensmodel) - intrinsics.shape[-1]
    noise = (np.random.default_rng(0).random((1, more)) - 0.5) * 2e-6
    splined = "SPLINED" in lensmodel
    problem = inputs(
        lensmodel, np.concatenate([intrinsics, noise], axis=-1), frames.copy(), observations,
        size, spacing,
        do_optimize_intrinsics_core=not splined,
        do_optimize_intrinsics_distortions=True,
        do_apply_outlier_rejection=True,
        do_apply_regularization=True,
    )  # fmt: skip
    mrcal.optimize(**problem)
    if warp:
        problem["calobject_warp"] = np.zeros(2)
        problem["do_optimize_calobject_warp"] = True
    mrcal.optimize(**problem)
    return problem["intrinsics"], problem["frames_rt_toref"], problem.get("calobject_warp")


def residual(lensmodel, intrinsics, frames, warp, grid, spacing):
    """Projection less pixel of every corner that was seen, outliers too: (N, 2)."""
    rows, columns = grid.shape[1:3]
    board = mrcal.ref_calibration_object(columns, rows, spacing, calobject_warp=warp)
    points = np.stack([mrcal.transform_point_rt(frame, board) for frame in frames])
    miss = mrcal.project(points, lensmodel, intrinsics[0]) - grid
    return miss[np.isfinite(grid[..., 0])]


def judge(lensmodel, intrinsics, warp, start, grid, size, spacing):
    """Residuals of photos that took no part, their poses fitted alone."""
    observations = observations_of(grid)
    frames = start.copy()
    problem = inputs(
        lensmodel, intrinsics, frames, observations, size, spacing, calobject_warp=warp
    )
    mrcal.optimize(**problem)
    return residual(lensmodel, intrinsics, problem["frames_rt_toref"], warp, grid, spacing)


def main():
    """Fit every model to all photos, and in folds."""
    data = np.load(sys.argv[1])
    grid, spacing, folds = data["grid"], float(data["spacing"]), int(data["folds"])
    size = data["size"].astype(np.int32)[None, :]
    fov = int(data["fov_deg"])
    observations = observations_of(grid)
    start = seed(observations, size, spacing, FOCALS * size[0, 0])
    if start is None:
        print(json.dumps({}))
        return
    spline = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx={}_Ny={}_fov_x_deg={}"
    models = {
        "mrcal OPENCV8, warp": ("LENSMODEL_OPENCV8", True),
        "mrcal splined 10x8": (spline.format(10, 8, fov), False),
        "mrcal splined 10x8, warp": (spline.format(10, 8, fov), True),
        "mrcal splined 20x14, warp": (spline.format(20, 14, fov), True),
    }
    photo = np.arange(len(grid))
    result = {}
    for name, (lensmodel, warp) in models.items():
        runs = []
        try:
            for _ in range(RUNS):
                begun = time.process_time()
                intrinsics, frames, bend = calibrate(
                    lensmodel, start, observations, size, spacing, warp
                )
                runs.append(time.process_time() - begun)
        except Exception as error:
            result[name] = {"problem": str(error)[:100]}
            continue
        fitted = residual(lensmodel, intrinsics, frames, bend, grid, spacing)
        left_out = []
        for fold in range(folds):
            train, test = photo % folds != fold, photo % folds == fold
            own = (start[0], start[1].copy(), start[2][train])
            try:
                one = calibrate(lensmodel, own, observations[train], size, spacing, warp)
                left_out.append(
                    judge(lensmodel, one[0], one[2], frames[test], grid[test], size, spacing)
                )
            except Exception:
                left_out.append(np.full((1, 2), np.inf))
        result[name] = {
            "residual": fitted.tolist(),
            "held_out": np.vstack(left_out).tolist(),
            "seconds": min(runs),
        }
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
