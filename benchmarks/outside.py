"""How near cameras come to lenses that no fitted family holds: ``python benchmarks/outside.py``.

Corners of photos through the lenses of tests/support/synthetic_lenses.py, and through one of the
family that P is held to, with errors of two kinds: independent ones of 0.1 px, and ones of the same
size of which half is shared by neighbouring corners and whose size differs from photo to photo, as
in real photos. Each set is calibrated as ever, the target as drawn, and the camera is compared with
the true lens over the cone that corners reach, with the rotation between them taken out.

cubic, radial   RMS over the field in px of the camera, and of the radial reference beside it;
                median over the seeds
worst           the worst seed's cubic
95 %, largest   of the cubic's differences over the field, median over the seeds
error/stated    the cubic's RMS over the stated uncertainty's; about 1 where that is honest
"""

import argparse
import os
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
from simulated import CornerErrors, simulated_corners
from synthetic import TRUE_LENS, checkerboard
from synthetic_lenses import SYNTHETIC_LENSES, synthetic_lens

from cubicfish import CubicfishError, Target, aligned_difference, calibrate
from cubicfish.models import cone_rays
from cubicfish.scene import Scene

SIZE = TRUE_LENS.image_size
INSIDE = replace(TRUE_LENS, fx=224.0, fy=224.3)
LENSES = {"inside": INSIDE, **{name: synthetic_lens(name, SIZE) for name in SYNTHETIC_LENSES}}
ERRORS = {
    "exact": CornerErrors(noise=0, shared=0, spread=0),
    "independent": CornerErrors(noise=0.1, shared=0, spread=0),
    "as in photos": CornerErrors(noise=0.07, shared=0.07, spread=0.5),
}
# Photos of one 9x6 board, 54 corners each.
PHOTOS = (5, 10, 30)


def board() -> Target:
    return Target(units="mm", boards=(checkerboard("board", 9, 6, 30.0),))


def rms(miss: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=-1))))


def missed(camera, truth, rays: np.ndarray) -> np.ndarray:
    """Differences (N, 2) in pixels where both see something."""
    miss, _ = aligned_difference(camera, truth, rays)
    return miss[np.isfinite(miss[:, 0])]


def measured(lens, errors: CornerErrors, poses, target: Target, seed: int) -> tuple[float, ...]:
    """(cubic, radial, 95 %, largest, stated, corners, seconds) of one calibration."""
    corners, truth = simulated_corners(
        lens, target, len(poses), seed=seed, errors=errors, poses=poses
    )
    start = time.process_time()
    fit = calibrate(corners, target, refine_target="off")
    seconds = time.process_time() - start
    angle = min(fit.fit.covered_deg, lens.max_angle_deg - 0.5, fit.camera.max_angle_deg)
    rays = cone_rays(np.radians(angle), 3000)
    pixel = truth.lens.project(rays)
    with np.errstate(invalid="ignore"):
        rays = rays[((pixel > 0) & (pixel < np.array(SIZE) - 1)).all(axis=1)]
    cubic = missed(fit.camera, truth.lens, rays)
    radial = missed(fit.camera.radial, truth.lens, rays)
    length = np.linalg.norm(cubic, axis=1)
    return (
        rms(cubic),
        rms(radial),
        float(np.percentile(length, 95)),
        float(length.max()),
        float(fit.fit.uncertainty.median_px),
        len(corners.pixel),
        seconds,
    )


def main() -> None:
    """Simulate, calibrate, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--photos", type=int, nargs="+", default=PHOTOS)
    parser.add_argument(
        "--errors", nargs="+", choices=ERRORS, default=["independent", "as in photos"]
    )
    parser.add_argument("--lens", nargs="+", choices=LENSES, default=list(LENSES))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    target = board()
    print(
        f"{'errors':13} {'lens':13} photos corners  cubic radial  worst   95 % largest "
        "stated error/stated  CPU s"
    )
    for name in arguments.lens:
        lens = LENSES[name]
        most = max(arguments.photos)
        scene = Scene(target=target, lens=lens, image_size=SIZE)
        poses = [tuple(scene.choose_poses(most, seed=seed)) for seed in range(arguments.seeds)]
        for kind in arguments.errors:
            for count in arguments.photos:
                rows = []
                for seed in range(arguments.seeds):
                    # Any photos but the first ones, which were chosen to fill the field best.
                    own = poses[seed][::-1][:count]
                    try:
                        rows.append(measured(lens, ERRORS[kind], own, target, seed))
                    except CubicfishError as error:
                        print(f"{kind:13} {name:13} {count:6d} seed {seed}: {error}")
                if not rows:
                    continue
                all_rows = np.array(rows)
                cubic, radial, most_px, largest, stated, corners, spent = np.median(
                    all_rows, axis=0
                )
                print(
                    f"{kind:13} {name:13} {count:6d} {corners:7.0f} {cubic:6.3f} {radial:6.3f} "
                    f"{all_rows[:, 0].max():6.3f} {most_px:6.3f} {largest:7.3f} {stated:6.3f} "
                    f"{cubic / max(stated, 1e-9):12.1f} {spent:6.1f}"
                )
                sys.stdout.flush()


if __name__ == "__main__":
    main()
