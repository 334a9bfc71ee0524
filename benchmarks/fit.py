"""How the fit's time grows with the photos: 10, 100 and 1,000 photos of about 300 corners.

    python benchmarks/fit.py [--photos 10 100 1000]

Synthetic corners of a box of four boards seen by a lens that is no cubic, with 0.1 px noise.
Prints the processor's seconds for the fit of camera and poses (object as drawn), with the boards'
shapes free, and as ``calibrate`` does it unasked (``auto``, photos held out), how the time per
photo compares with that of the smallest set, and which share of it goes into the last stage: how
uncertain the camera is, and what is wrong with the set-up (nothing is).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
import synthetic

from cubicfish import Listener, calibrate

CORNERS = 300


def photos_of(count: int):
    target = synthetic.box_of_four()
    poses = synthetic.poses_around(target, count, seed=1)
    pairs = synthetic.synthetic_correspondences(target, poses, noise=0.1, seed=2)
    # About CORNERS of each photo, chosen at random.
    rng = np.random.default_rng(3)
    share = CORNERS / np.bincount(pairs.image, minlength=count)[pairs.image]
    return target, pairs.select(rng.random(len(pairs.image)) < share).only_seen()[0]


class LastStage(Listener):
    """Hears when the last stage of a fit begins."""

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        """Note the processor's time at every stage; the last one stays."""
        self.begun = time.process_time()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--photos", type=int, nargs="+", default=[10, 100, 1000])
    first: dict[str, float] = {}
    heard = LastStage()
    print("photos  corners  level  seconds  per photo, times that of the first  checks %  RMS px")
    for count in parser.parse_args().photos:
        target, pairs = photos_of(count)
        for level in ("off", "shape", "auto"):
            start = time.process_time()
            result = calibrate(
                pairs,
                target=target,
                refine_target=level,
                hold_out=level == "auto",
                listener=heard,
            )
            end = time.process_time()
            seconds = end - start
            each = seconds / count
            ratio = each / first.setdefault(level, each)
            print(
                f"{count:6d}  {len(pairs.pixel):7d}  {level:5s}  {seconds:7.2f}  {ratio:35.2f}  "
                f"{100 * (end - heard.begun) / seconds:8.1f}  {result.errors.rms_px:.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
