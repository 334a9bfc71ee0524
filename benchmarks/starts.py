"""Whether the fit ends at its optimum: the cost from five starts, camera by camera.

    python benchmarks/starts.py CORNERS.csv TARGET.yaml [CORNERS.csv TARGET.yaml ...]

Each camera is calibrated as ``calibrate`` does it unasked. At the prior that it chose, with the
target as it refined it, P and all poses are then fitted from five starts: the end itself, the cubic
nearest to the radial reference, and three linear solutions whose P3Φ is pulled to a constant more
and more, each followed to where no step leads further down. Prints RMS and radial RMS (pixels, held
out), how near a cubic comes to the reference among the corners, and by which share each cost is
above the least. Exit status 1 where the five do not agree to 0.1 %.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from cubicfish import load_corners
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.cubic_fit import starts, with_prior
from cubicfish.solve.adjustment import WARM_DAMPING, adjust
from cubicfish.solve.statistics import huber_px, rms_px
from cubicfish.target.target import load_target

STARTS = 5
AGREES = 1e-3
LOOSER = (0.1, 1.0, 10.0)
STEPS = 1000  # starts from far away go down a narrow valley that bends


def costs(fit) -> list[float]:
    """From each start; where P is held firmly, by way of looser priors.

    From far away, what a firm prior leaves P is a narrow valley that bends.
    """
    reference, cubic, prior = fit.reference, fit, fit.prior
    limit, found = huber_px(cubic.errors), []
    for lens, poses in islice(starts(reference, prior, cubic, cubic.errors), STARTS):
        world = cubic.world
        looser = [weight for weight in LOOSER if weight < prior.weight]
        for tried in (*(replace(prior, weight=weight) for weight in looser), prior):
            lens = with_prior(lens, reference, tried, cubic.errors)
            end = adjust(
                lens,
                poses,
                reference.pairs,
                huber_px=limit,
                world=world,
                damping=WARM_DAMPING,
                max_iterations=STEPS,
            )
            lens, poses, world = end.lens, end.poses, end.world
        found.append(end.cost)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+", metavar="CORNERS.csv TARGET.yaml")
    files = parser.parse_args().files
    worst = 0.0
    print(f"{'camera':<22}{'held':>8}{'radial':>8}{'nearest':>9}  prior, and costs over the least")
    for corners, drawing in zip(files[::2], files[1::2], strict=True):
        target = load_target(drawing)
        kept = []
        result = calibrate(
            load_corners(corners, target),
            target=target,
            diagnose=lambda evidence, kept=kept: kept.append(evidence) or (),
        )
        fit = kept[-1].fit
        found = np.array(costs(fit))
        share = found / found.min() - 1
        worst = max(worst, float(share.max()))
        held_out, prior, cubic = result.held_out, result.prior, fit.reference.cubic
        nearest = rms_px(cubic.miss[cubic.within])
        print(
            f"{drawing.parent.name + '/' + corners.stem:<22.22}{held_out.rms_px:>8.4f}"
            f"{held_out.companion_rms_px:>8.4f}{nearest:>9.4f}"
            f"  {prior.spread:g}, {prior.weight:.3g}{', central' if prior.central else ''}: "
            + " ".join(f"{one:.1e}" for one in share),
            flush=True,
        )
    print(f"farthest of the five above the least cost: {100 * worst:.3f} %")
    return 1 if worst > AGREES else 0


if __name__ == "__main__":
    sys.exit(main())
