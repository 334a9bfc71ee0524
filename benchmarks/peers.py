"""cubicfish beside mrcal and OpenCV: the same corners, one run, one definition of the error.

    python benchmarks/peers.py DATA [--corners CSV] [--mrcal PYTHON] [--opencv PYTHON]

DATA holds ``target.yaml`` (one checkerboard) and ``images``; corners come from the project's own
finder, or from ``--corners``. PYTHON is an interpreter that has the peer: Debian's
``/usr/bin/python3`` with ``python3-mrcal``, and one with ``opencv-contrib-python-headless`` 4.x.

Every RMS is sqrt(mean(dx² + dy²)) over all corners that everyone was given: those that
cubicfish's own fit did not drop. Held out: photo i is judged by a lens fitted without the photos
of its fold (i modulo 5), its own pose fitted. mrcal's own figure counts x and y apart and empty
places too, so it is computed anew here. Seconds are the processor's, and of cubicfish and mrcal the
least of five runs, so that other work on the machine counts for little.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from lens_models import compare_models

from cubicfish import Calibration, FitError, Observations, Run, Target, calibrate, load_corners
from cubicfish.fit.folds import FOLDS
from cubicfish.models import RadialCamera
from cubicfish.solve import Poses, rms_px
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.fit_lens import FitLens, FixedLens, FreeLens
from cubicfish.solve.statistics import huber_px
from cubicfish.solve.subset import select_photos
from cubicfish_cli.extensions.formats.lenses import UnifiedLens

FloatArray = npt.NDArray[np.float64]
HERE = Path(__file__).parent
RUNS = 5  # as in peer_mrcal.py


def corners_of(data: Path, corners: Path | None, target: Target) -> Observations:
    """The pairs, from a file or from the photos."""
    if corners is not None:
        return load_corners(corners, target)
    from cubicfish.observe import find_corners
    from cubicfish.photos import find_photos

    photos = find_photos([data / "images"])
    return find_corners(photos, [target], Run(), again=False).corners.with_target(target)


def grid_of(pairs: Observations, target: Target) -> FloatArray:
    """(M, rows, columns, 2) pixels, NaN where nothing was seen."""
    board = target.boards[0]
    grid = np.full((len(pairs.images), board.rows, board.columns, 2), np.nan)
    grid[pairs.image, pairs.row, pairs.column] = pairs.pixel
    return grid


def row(name: str, rms: float | None, held_out: float | None, seconds: float | None) -> None:
    """Print one row."""
    cells = [
        "-" if value is None or not np.isfinite(value) else f"{value:.4f}"
        for value in (rms, held_out)
    ]
    took = "-" if seconds is None else f"{seconds:.2f}"
    print(f"{name:<34}{cells[0]:>9}{cells[1]:>14}{took:>9}", flush=True)


def ours(pairs: Observations, target: Target) -> Calibration:
    """The cubic camera at each level of refinement, Kannala–Brandt beside the first."""
    first: Calibration | None = None
    for level in ("off", "shape", "points"):
        runs = []
        for _ in range(RUNS):
            begun = time.process_time()
            calibrate(pairs, target=target, refine_target=level, hold_out=False)
            runs.append(time.process_time() - begun)
        fit = calibrate(pairs, target=target, refine_target=level, hold_out=True)
        held_out = fit.held_out
        row(
            f"cubicfish, target {level}", fit.errors.rms_px, held_out and held_out.rms_px, min(runs)
        )
        row(
            f"  its radial reference, target {level}",
            fit.fit.companion_rms_px,
            held_out and held_out.companion_rms_px,
            None,
        )
        first = first or fit
    assert first is not None
    for figures in compare_models(first)[1:]:
        row(
            f"  {figures.model}, same solver",
            figures.rms_px,
            figures.held_out_rms_px,
            figures.seconds,
        )
    return first


def mrcal_rows(python: str, npz: Path) -> None:
    """mrcal's models; its seconds are for the solves alone, from a seed."""
    for name, found in run(python, "peer_mrcal.py", npz).items():
        if "problem" in found:
            print(f"{name:<34}  failed: {found['problem']}")
            continue
        fitted, left_out = np.array(found["residual"]), np.array(found["held_out"])
        row(name, rms_px(fitted), rms_px(left_out), found["seconds"])


def opencv_rows(python: str, npz: Path, pairs: Observations, fit: Calibration) -> None:
    """OpenCV's two fisheye models, judged by the solver here with the lens fixed."""
    found = run(python, "peer_opencv.py", npz)
    for name in ("fisheye", "omnidir"):
        title = f"OpenCV {found['version']} {name}"
        everyone, *folds = found[name]
        if "problem" in everyone:
            print(f"{title:<34}  failed: {everyone['problem']}")
            continue
        fitted = judged(opencv_lens(name, everyone, pairs.image_size), pairs, fit.poses)
        left_out = opencv_held_out(name, folds, pairs, fit)
        row(title, None if fitted is None else rms_px(fitted), left_out, everyone["seconds"])
        if everyone["share"] < 1 or everyone["photos"] < len(pairs.images):
            print(
                f"  (fitted to {everyone['photos']} photos, corners within {everyone['share']:.0%} "
                "of the largest radius)"
            )


def judged(lens: FitLens, pairs: Observations, poses: Poses) -> FloatArray | None:
    """Residuals (N, 2) of a fixed lens, poses refitted from a start; None where it has a hole."""
    frozen = FixedLens(camera=lens)
    try:
        fit = adjust(frozen, poses, pairs, huber_px=10.0)
        return adjust(frozen, fit.poses, pairs, huber_px=huber_px(fit.residual)).residual
    except FitError:
        return None


def opencv_lens(name: str, run: dict[str, Any], image_size: tuple[int, int]) -> FitLens:
    """OpenCV's parameters as a lens here."""
    values = np.array(run["values"])
    if name == "fisheye":
        return FreeLens.of(RadialCamera.from_parameters(values, image_size))
    fx, fy, cx, cy, skew, xi = values[:6].tolist()
    lens = UnifiedLens(
        image_size=image_size, fx=fx, fy=fy, cx=cx, cy=cy, skew=skew, xi=xi, d=values[6:]
    )
    return FreeLens.of(lens)


def opencv_held_out(
    name: str, folds: list[dict[str, Any]], pairs: Observations, fit: Calibration
) -> float | None:
    """Held-out RMS; poses start at those that the whole fit found."""
    misses = []
    photo = np.arange(len(pairs.images))
    for fold, run in enumerate(folds):
        if "problem" in run:
            return None
        test = photo[photo % len(folds) == fold]
        miss = judged(
            opencv_lens(name, run, pairs.image_size), select_photos(pairs, test), fit.poses[test]
        )
        if miss is None:
            return None
        misses.append(miss)
    return rms_px(np.vstack(misses))


def run(python: str, script: str, npz: Path) -> dict[str, Any]:
    """Run a peer's script; {} with its last words when it fails."""
    done = subprocess.run(
        [python, str(HERE / script), str(npz)], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        print(f"{script}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")
        return {}
    # Some solvers write to stdout too; the object is the last line.
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description="cubicfish beside mrcal and OpenCV")
    parser.add_argument("data", type=Path)
    parser.add_argument("--corners", type=Path)
    parser.add_argument("--mrcal", metavar="PYTHON")
    parser.add_argument("--opencv", metavar="PYTHON")
    options = parser.parse_args()
    target = Target.load(options.data / "target.yaml")
    if len(target.boards) != 1:
        parser.error("the peers take one flat board only")
    board = target.boards[0]
    pairs = corners_of(options.data, options.corners, target)
    clean = calibrate(pairs, target=target, refine_target="off", hold_out=False)
    kept = clean.pairs
    dropped = len(pairs.pixel) - len(kept.pixel)
    print(
        f"{len(kept.images)} photos, {len(kept.pixel)} corners, {dropped} left out by the first fit"
    )
    print(f"{'':<34}{'RMS px':>9}{'held-out px':>14}{'seconds':>9}")
    kept = replace(kept, world=board.world_points(kept.column, kept.row))
    fit = ours(kept, target)
    with tempfile.TemporaryDirectory() as folder:
        npz = Path(folder) / "corners.npz"
        np.savez(
            npz,
            grid=grid_of(kept, target),
            spacing=board.square,
            size=kept.image_size,
            folds=min(FOLDS, len(kept.images)),
            focal=round(fit.camera.radial.fx, -1),
            fov_deg=min(330, int(2 * fit.fit.covered_deg) + 10),
        )
        if options.mrcal:
            mrcal_rows(options.mrcal, npz)
        if options.opencv:
            opencv_rows(options.opencv, npz, kept, fit)


if __name__ == "__main__":
    main()
