"""Simulated rigs: do they converge without a guess, how far off are they, and do they know it?

    python benchmarks/rigs.py                    # all set-ups, three seeds each
    python benchmarks/rigs.py --only six --seeds 1
    python benchmarks/rigs.py --growth           # 3, 6, 11 cameras x 50, 200, 850 shots
    python benchmarks/rigs.py --growth --cameras 11 --shots 850 --field 90
    python benchmarks/rigs.py --halves 30 --of free       # or triggered, or free with --times
    python benchmarks/rigs.py --halves 30 --of FOLDER     # its cam_*.csv, target.yaml and, with
                                                          # --times, timestamps.csv

Lenses are of no family that is fitted (equisolid of 190 to 220 degrees, with a bump and a turned
rear group); noise is 0.1 px on each coordinate. A pose's error is that of the rays of a camera's
pixels on the body: what the lens turns, its place turns back. Halves of one rig's shots, drawn at
random, make two rigs, which should be as far apart as both say: a ratio of about 1.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from hand_held import hand_held
from looking import look_at
from simulated import CornerErrors
from simulated_rig import RigTruth, combined, simulated_rig
from synthetic_lenses import SyntheticLens, synthetic_lens

from cubicfish import (
    CubicfishError,
    Listener,
    Observations,
    Rig,
    Target,
    aligned_difference,
    calibrate_rig,
    compare_rigs,
    load_corners,
)
from cubicfish.models import cone_rays
from cubicfish_cli.extensions.rigs.tables import load_times

Pose = tuple[np.ndarray, np.ndarray]
NOISE = CornerErrors(noise=0.1, shared=0.0, spread=0.0)


def board(name: str, counts: tuple[int, int], square: float, origin, x_axis, y_axis) -> dict:
    return {
        "name": name,
        "type": "checkerboard",
        "corners": list(counts),
        "square": square,
        "origin": list(origin),
        "x_axis": list(x_axis),
        "y_axis": list(y_axis),
    }


def corner_target() -> Target:
    """Three boards in a corner, seen from where x, y and z are positive."""
    boards = [
        board("floor", (9, 6), 60, (90, 390, 0), (1, 0, 0), (0, -1, 0)),
        board("left", (8, 7), 60, (0, 90, 450), (0, 1, 0), (0, 0, -1)),
        board("right", (7, 5), 60, (450, 0, 330), (-1, 0, 0), (0, 0, -1)),
    ]
    return Target.from_data({"units": "mm", "boards": boards})


def box_target() -> Target:
    """Four walls about a rig, and a floor, 1.6 m wide, boards facing inwards."""
    boards = []
    for number, angle in enumerate(np.deg2rad([0, 90, 180, 270])):
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])  # as seen from the middle
        down = np.array([0.0, 0.0, -1.0])
        right = np.cross(down, outward)
        counts = (9 + number % 2, 6)
        middle = 800 * outward + np.array([0, 0, 50.0 * (number - 1)])
        first = middle - right * 100 * (counts[0] - 1) / 2 - down * 100 * (counts[1] - 1) / 2
        boards.append(board(f"wall{number}", counts, 100.0, first, right, down))
    boards.append(board("floor", (7, 7), 100.0, (-300, 300, -600), (1, 0, 0), (0, -1, 0)))
    return Target.from_data({"units": "mm", "boards": boards})


def placed(yaw_deg: float, radius: float = 100.0) -> Pose:
    """camera_from_body of a camera that looks out from a ring about the body's y axis."""
    yaw = np.deg2rad(yaw_deg)
    forward = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
    return look_at(radius * forward, (radius + 1) * forward, up=(0, -1, 0))


def ring(yaws: list[float], radius: float = 100.0) -> list[Pose]:
    """camera_from_rig: the first camera's frame is the rig's."""
    bodies = [placed(yaw, radius) for yaw in yaws]
    vector, shift = bodies[0]
    back = -vector, -cv2.Rodrigues(vector)[0].T @ shift
    return [combined(one, back) for one in bodies]


def stereo() -> list[Pose]:
    return [(np.zeros(3), np.zeros(3)), (np.array([0.01, 0.03, -0.02]), np.array([-120.0, 1, 2]))]


@dataclass(frozen=True)
class Setup:
    places: list[Pose]
    fields: list[float]
    target: Target
    distances: tuple[float, float]
    middle: tuple[float, float, float]
    shots: int


CORNER_MIDDLE = (330.0, 330.0, 300.0)
BOX_MIDDLE = (0.0, 0.0, 0.0)
SETUPS = {
    "stereo": Setup(stereo(), [190, 200], corner_target(), (50, 350), CORNER_MIDDLE, 15),
    "barely": Setup(ring([0, 160]), [200, 190], box_target(), (0, 250), BOX_MIDDLE, 15),
    "back": Setup(ring([0, 180]), [190, 190], box_target(), (0, 250), BOX_MIDDLE, 12),
    "four": Setup(ring([0, 90, 180, 270]), [190, 200, 210, 220], box_target(), (0, 250),
                  BOX_MIDDLE, 20),
    "four-corner": Setup(ring([0, 90, 180, 270]), [190, 200, 210, 220], corner_target(),
                         (50, 350), CORNER_MIDDLE, 30),
    "six": Setup(ring([0, 60, 120, 180, 240, 300]), [190, 200, 195, 210, 190, 220], box_target(),
                 (0, 250), BOX_MIDDLE, 20),
}  # fmt: skip


def lens_of(field_deg: float, number: int) -> SyntheticLens:
    lens = synthetic_lens("equisolid", (1280, 960) if number % 2 else (1200, 1000))
    half = field_deg / 2
    focal = 0.49 * min(lens.image_size) / (2 * np.sin(np.deg2rad(half) / 2))
    return replace(lens, focal=(focal, 0.999 * focal), max_angle_deg=half)


def simulated(setup: Setup, seed: int) -> tuple[list[Observations], RigTruth, list[SyntheticLens]]:
    lenses = [lens_of(field, number) for number, field in enumerate(setup.fields)]
    corners, truth = simulated_rig(
        lenses,
        setup.places,
        setup.target,
        setup.shots,
        distances=setup.distances,
        middle=setup.middle,
        seed=seed,
        errors=NOISE,
    )
    return [one.with_target(setup.target) for one in corners], truth, lenses


def fitted(pairs: list[Observations], target: Target, **options: object) -> Rig:
    cameras = {f"camera{number}": one for number, one in enumerate(pairs)}
    return calibrate_rig(cameras, target, **options)  # type: ignore[arg-type]


def place_errors(rig: Rig, truth: RigTruth) -> list[np.ndarray]:
    """(6,) of each camera but the first: turn in radians, shift in the target's unit."""
    turns = []
    for one, true in zip(rig.cameras, truth.cameras, strict=True):
        covered = np.deg2rad(float(one.fit.covered_deg))
        rays = cone_rays(covered, 2000)
        # What the fitted camera sees along d, the true one sees along turn d.
        turns.append(aligned_difference(true.lens, one.camera, rays)[1])
    errors = []
    for number in range(1, len(turns)):
        one, (vector, shift) = rig.cameras[number], truth.camera_from_rig[number]
        rotation = turns[number] @ one.rotation @ turns[0].T
        off = rotation @ cv2.Rodrigues(vector)[0].T
        turn = np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]) / 2
        errors.append(np.concatenate([turn, turns[number] @ one.translation - shift]))
    return errors


def measure(name: str, seeds: range) -> None:
    setup = SETUPS[name]
    over, turns, shifts, failed, seconds = [], [], [], 0, []
    for seed in seeds:
        pairs, truth, _ = simulated(setup, seed)
        began = time.process_time()
        try:
            rig = fitted(pairs, setup.target)
        except CubicfishError as error:
            print(f"  {name} seed {seed}: {error}")
            failed += 1
            continue
        seconds.append(time.process_time() - began)
        for one, error in zip(rig.cameras[1:], place_errors(rig, truth), strict=True):
            over.append(error / np.sqrt(np.diagonal(one.covariance)))
            turns.append(np.rad2deg(np.linalg.norm(error[:3])))
            shifts.append(np.linalg.norm(error[3:]))
    if not over:
        return
    ratio = np.array(over)
    print(
        f"{name:<12} {len(seeds) - failed}/{len(seeds)} converged; turn "
        f"{np.median(turns):.4f}° (max {max(turns):.4f}), shift {np.median(shifts):.3f} mm "
        f"(max {max(shifts):.3f}); error/sigma turn {np.sqrt(np.mean(ratio[:, :3] ** 2)):.2f}, "
        f"shift {np.sqrt(np.mean(ratio[:, 3:] ** 2)):.2f}; RMS {rig.fit.rms_px:.3f} px, "
        f"held out {rig.fit.held_out_rms_px:.3f}; {np.mean(seconds):.0f} s CPU",
        flush=True,
    )


def on_ring(cameras: int, shots: int, field_deg: float) -> Setup:
    """Cameras that look out from a ring at a target that is carried about them."""
    yaws = [360 * number / cameras for number in range(cameras)]
    fields = [field_deg + 10 * (number % 3) for number in range(cameras)]
    return Setup(ring(yaws), fields, corner_target(), (250, 900), CORNER_MIDDLE, shots)


class Stages(Listener):
    """CPU seconds of each camera alone, on average, and of what comes after."""

    def __init__(self) -> None:
        self.began: list[tuple[str, float]] = []

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        if now:
            self.began.append((now, time.process_time()))

    def __str__(self) -> str:
        ends = [*(at for _, at in self.began[1:]), time.process_time()]
        took = [(what, end - at) for (what, at), end in zip(self.began, ends, strict=True)]
        alone = [spent for what, spent in took if what.endswith(" alone")]
        rest = ", ".join(f"{what} {spent:.1f}" for what, spent in took[len(alone) :])
        return f"a camera alone {np.mean(alone):.1f}, {rest}"


def measure_growth(cameras: list[int], shots: list[int], field_deg: float) -> None:
    for count in cameras:
        for many in shots:
            setup = on_ring(count, many, field_deg)
            pairs, truth, _ = simulated(setup, 0)
            stages = Stages()
            began, wall = time.process_time(), time.perf_counter()
            rig = fitted(pairs, setup.target, listener=stages)
            spent, wall = time.process_time() - began, time.perf_counter() - wall
            errors = np.array(place_errors(rig, truth))
            sigma = np.sqrt([np.diagonal(one.covariance) for one in rig.cameras[1:]])
            ratio = errors / sigma
            photos = sum(len(one.images) for one in pairs)
            print(
                f"{count} cameras x {many} shots, {photos:,} photos: {spent:.0f} s CPU, "
                f"{wall:.0f} s, {1000 * spent / photos:.0f} ms a photo ({stages}); turn "
                f"{np.rad2deg(np.median(np.linalg.norm(errors[:, :3], axis=1))):.5f}°, shift "
                f"{np.median(np.linalg.norm(errors[:, 3:], axis=1)):.4f} mm; error/sigma "
                f"{np.sqrt(np.mean(ratio[:, :3] ** 2)):.2f}, "
                f"{np.sqrt(np.mean(ratio[:, 3:] ** 2)):.2f}; RMS {rig.fit.rms_px:.4f} px, held "
                f"out {rig.fit.held_out_rms_px:.4f}",
                flush=True,
            )


def halved(
    of: str, timed: bool
) -> tuple[dict[str, Observations], Target, Mapping[str, Mapping[str, float]] | None]:
    """Corners of a rig's cameras by name, their target, and when photos were taken."""
    if of == "triggered":
        setup = replace(SETUPS["stereo"], shots=40)
        pairs = simulated(setup, 0)[0]
        return {f"camera{n}": one for n, one in enumerate(pairs)}, setup.target, None
    if of == "free":
        made = hand_held(2, moments=80)
        names = [f"camera{n}" for n in range(len(made.corners))]
        times = dict(zip(names, made.times, strict=True)) if timed else None
        return dict(zip(names, made.corners, strict=True)), made.target, times
    folder = Path(of)
    target = Target.load(folder / "target.yaml")
    cameras = {one.stem: load_corners(one, target) for one in sorted(folder.glob("cam_*.csv"))}
    return cameras, target, load_times(folder / "timestamps.csv", [*cameras]) if timed else None


def measure_halves(of: str, timed: bool, seeds: range) -> None:
    """How far rigs from halves of the shots are apart, over what both state."""
    cameras, target, times = halved(of, timed)
    shots = sorted({image for one in cameras.values() for image in one.images})
    ratios, failed = [], 0
    for seed in seeds:
        mixed = np.random.default_rng(seed).permutation(shots)
        rigs = []
        try:
            for half in (mixed[::2], mixed[1::2]):
                own = {
                    name: one.of_photos(np.flatnonzero(np.isin(one.images, half)))
                    for name, one in cameras.items()
                }
                rigs.append(calibrate_rig(own, target, times=times))
            found = compare_rigs(*rigs)[1:]
        except CubicfishError as error:
            print(f"  {seed}: {error}")
            failed += 1
            continue
        ratios.append([one.sigmas for one in found])
        print(
            f"  {seed}: "
            + "; ".join(
                f"{one.name} {one.turn_deg:.3f} ± {one.turn_sigma_deg:.3f}°, "
                f"{np.linalg.norm(one.shift):.3f} ± {one.shift_sigma:.3f}, {one.sigmas:.2f}"
                for one in found
            ),
            flush=True,
        )
    ratio = np.array(ratios)
    print(
        f"{of}: {len(ratios)}/{len(seeds)} halvings; distance/sigma, median "
        f"{np.median(ratio):.2f} (of each camera {np.round(np.median(ratio, axis=0), 2)}), root "
        f"of the mean square {np.sqrt(np.mean(ratio**2)):.2f}, below 2 {np.mean(ratio < 2):.0%}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=SETUPS, action="append")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--cameras", type=int, nargs="+", default=[3, 6, 11])
    parser.add_argument("--shots", type=int, nargs="+", default=[50, 200, 850])
    parser.add_argument("--field", type=float, default=190.0, help="degrees")
    parser.add_argument("--halves", type=int, default=0, metavar="COUNT")
    parser.add_argument("--of", default="triggered", help="triggered, free, or a folder of tables")
    parser.add_argument("--times", action="store_true", help="say when the photos were taken")
    given = parser.parse_args()
    if given.halves:
        measure_halves(given.of, given.times, range(given.first, given.first + given.halves))
        return 0
    if given.growth:
        measure_growth(given.cameras, given.shots, given.field)
        return 0
    for name in given.only or SETUPS:
        measure(name, range(given.first, given.first + given.seeds))
    return 0


if __name__ == "__main__":
    sys.exit(main())
