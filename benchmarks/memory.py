"""Peak memory: a photo of 108 million pixels, undistorted; maps; cameras from many corners.

    python benchmarks/memory.py [--photos 1000 3000] [--side 12000] [--map 7680x4320]

Each command runs in a process of its own, whose largest resident memory is printed. Corners are
those of the sample target in poses like the sample's, with 0.1 px of noise.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from cubicfish import Target, load_camera

SAMPLE = Path(__file__).resolve().parents[1] / "sample_data"
NOISE_PX = 0.1


def run(*arguments: object) -> tuple[float, float]:
    """Run a command; seconds, and its peak memory in MB."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", "cubicfish_cli", *map(str, arguments)]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    told = child.stderr.read().decode() if child.stderr else ""
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{' '.join(command)} ended with {child.returncode}: {told[-300:]}")
    return time.perf_counter() - begin, usage.ru_maxrss / 1024


def corners_of(folder: Path, camera: Path, count: int) -> Path:
    """A corners.csv of so many photos."""
    loaded, target = load_camera(camera), Target.load(SAMPLE / "target.yaml")
    poses = list(loaded.fit.poses.values())
    board, column, row, world = target.corners()
    names = [one.name for one in target.boards]
    rng = np.random.default_rng(0)
    width, height = loaded.camera.image_size
    lines = [f"# cubicfish corners 1, image_size {width}x{height}", "image,board,column,row,x,y"]
    for number in range(count):
        vector, shift = poses[number % len(poses)]
        turned = cv2.Rodrigues(vector + rng.normal(0, 0.05, 3))[0]
        moved = shift * (1 + rng.normal(0, 0.05, 3))
        pixel = loaded.camera.project(world @ turned.T + moved, near=True)
        pixel += rng.normal(0, NOISE_PX, pixel.shape)
        with np.errstate(invalid="ignore"):
            seen = ((pixel >= 0) & (pixel <= np.array([width, height]) - 1)).all(axis=1)
        lines += [
            f"{number:05}.png,{names[board[i]]},{column[i]},{row[i]},{pixel[i, 0]:.4f},"
            f"{pixel[i, 1]:.4f}"
            for i in np.flatnonzero(seen)
        ]
    path = folder / f"{count}.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def main() -> None:
    """Print a row a command."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--photos", type=int, nargs="*", default=[1000, 3000])
    options.add_argument("--side", type=int, default=12_000)
    options.add_argument("--map", default="7680x4320", help="the size of maps; 0 for none")
    given = options.parse_args()
    target = SAMPLE / "target.yaml"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        own = SAMPLE / "true_corners.csv"
        run("calibrate", own, "--target", target, "-o", folder / "camera", "--no-report")
        camera = folder / "camera" / "camera.yaml"
        # First: what this process holds when it starts another counts as that one's.
        for suffix in (".npz", ".exr", ".png", ".pgm") if given.map != "0" else ():
            out = folder / suffix[1:] / f"map{suffix}"
            seconds, peak = run("map", out, "-m", camera, "--size", given.map)
            print(f"map {given.map} {suffix}: {peak:,.0f} MB, {seconds:.0f} s", flush=True)
        if given.side:
            width, height = load_camera(camera).camera.image_size
            size = (given.side, given.side * height // width)
            photo = cv2.imread(str(SAMPLE / "photos" / "corner_01.jpg"))
            cv2.imwrite(str(folder / "large.jpg"), cv2.resize(photo, size))
            del photo
            seconds, peak = run(
                "undistort", folder / "large.jpg", folder / "flat.jpg", "-m", camera
            )
            print(f"undistort {size[0]}x{size[1]}: {peak:,.0f} MB, {seconds:.0f} s", flush=True)
        for count in given.photos:
            table = corners_of(folder, camera, count)
            out = folder / f"c{count}"
            seconds, peak = run("calibrate", table, "--target", target, "-o", out, "--no-report")
            print(f"calibrate from {count:,} photos' corners: {peak:,.0f} MB, {seconds:.0f} s")


if __name__ == "__main__":
    main()
