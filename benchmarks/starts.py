"""Does a fit end at its optimum? Its end beside those that other starts lead to.

    python benchmarks/starts.py [FOLDER ...] [--thrown 8]

A folder holds corners.csv and target.yaml of a camera, or folders that do. Rendered cameras come
first: a fisheye, an asymmetric one, a narrow one, and a mirror that is not centred on its camera.
Other starts are those that the fit might have chosen (the cubic nearest to its reference, safer
ones), and its own end with lens, poses and target thrown off by up to 20 px.

``worse`` and ``same`` count the starts that end more than 0.1 % above the fit's cost, and within
that. ``better`` ended more than 0.1 % below it: there the fit missed its optimum, at most by
``missed %``. Exit status 1 where there is one.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
import synthetic
from decentred_mirror import DecentredMirror
from lenses import cubic_camera, radial_camera
from other_starts import ends
from simulated import simulated_corners

from cubicfish import Observations, Target, load_corners

MISSED = 1e-3  # share of the cost
NOISE_PX = 0.1
LENSES = {
    "fisheye": radial_camera(95.0),
    "asymmetric": cubic_camera(80.0, bend=0.02),
    "narrow": replace(cubic_camera(60.0, bend=0.002), max_angle_deg=40.0),
}
MIRROR = DecentredMirror(shift_mm=(2.0, -1.0), tilt_deg=(-5.0, -3.0))


def cameras(folders: list[Path]) -> Iterator[tuple[str, Observations, Target]]:
    """Name, corners and target of each camera: rendered ones, then those of folders."""
    target = synthetic.corner_of_three()
    for name, lens in LENSES.items():
        yield name, simulated_corners(lens, target, 16, seed=1)[0].with_target(target), target
    # A mirror shows what is beside the camera.
    target = synthetic.flat_board()
    poses = synthetic.poses_around(target, 20, seed=1, off_axis_deg=95)
    pairs = synthetic.synthetic_correspondences(
        target, poses, lens=MIRROR, image_size=MIRROR.image_size, noise=NOISE_PX, seed=1
    )
    yield "mirror, not centred", pairs, target
    for folder in folders:
        tables = [folder, *sorted(folder.iterdir())]
        for own in (one for one in tables if (one / "corners.csv").exists()):
            target = Target.load(own / "target.yaml")
            yield own.name, load_corners(own / "corners.csv", target), target


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--thrown", type=int, default=8)
    options = parser.parse_args()
    print(
        "camera                    cost  starts  worse  same  better  missed %       s", flush=True
    )
    lost = 0
    for name, pairs, target in cameras(options.folders):
        begun = time.process_time()
        own, others = ends(pairs, target, options.thrown)
        over = np.array(others) / own - 1
        counts = [(over > MISSED).sum(), (np.abs(over) <= MISSED).sum(), (over < -MISSED).sum()]
        lost += counts[2]
        print(
            f"{name:20s}{own:10.4g}{len(over):8d}{counts[0]:7d}{counts[1]:6d}{counts[2]:8d}"
            f"{max(0.0, -100 * over.min()):10.4f}{time.process_time() - begun:8.1f}",
            flush=True,
        )
    sys.exit(bool(lost))


if __name__ == "__main__":
    main()
