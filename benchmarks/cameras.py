"""From photos to a camera, over cameras and objects drawn at random: how far from the truth?

    python benchmarks/cameras.py [--number 20] [--first 0] [--keep FOLDER]

Each case is a lens of 60° to 200° with decentring and tilt, a sensor of 0.3 to 5 megapixels, an
object, and photos with noise, blur and vignetting, all through the command line: ``simulate``,
``calibrate`` and ``compare``. ``found`` is the share of the true corners that were used,
``held out`` the error on photos left out, ``true`` the camera's distance from the truth over its
field, both RMS in pixels, and ``stated`` the uncertainty that the camera states of itself (median).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

os.environ.setdefault("OMP_NUM_THREADS", "1")
PROGRAM = [sys.executable, "-m", "cubicfish_cli"]
SENSORS = ((640, 480), (752, 480), (960, 720), (1280, 1024), (1920, 1080), (2592, 1944))
AXES = {
    "xy": ([1, 0, 0], [0, 1, 0]),
    "xz": ([0, 0, 1], [1, 0, 0]),
    "yz": ([0, 1, 0], [0, 0, 1]),
}


def board(kind: str, name: str, size: tuple[int, int], plane: str, first: int) -> dict[str, Any]:
    """A board of half a metre beside the planes' common corner."""
    square = 480.0 / (max(size) + 1)
    x_axis, y_axis = AXES[plane]
    origin = (np.add(x_axis, y_axis) * (square + 20)).tolist()
    record = {"name": name, "origin": origin, "x_axis": x_axis, "y_axis": y_axis}
    if kind == "aprilgrid":
        tags = [size[0] // 2, size[1] // 2]
        return record | {
            "type": kind, "tags": tags, "tag": 1.6 * square, "spacing": 0.3,
            "first_marker": first,
        }  # fmt: skip
    if kind == "charuco":
        return record | {
            "type": kind, "corners": list(size), "square": square, "marker": 0.75 * square,
            "dictionary": "DICT_5X5_1000", "first_marker": first,
        }  # fmt: skip
    return record | {"type": kind, "corners": list(size), "square": square}


def drawn(rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """An object: its name and its target file."""
    kind = str(rng.choice(["checkerboard", "checkerboard", "charuco", "aprilgrid"]))
    flat = bool(rng.random() < 0.5)
    boards, first = [], 0
    for number, plane in enumerate(list(AXES)[: 1 if flat else 3]):
        columns = int(rng.integers(5, 12)) + number
        size = (columns, int(rng.integers(4, columns)))
        if kind == "aprilgrid":
            size = (12, 10)
        boards.append(board(kind, f"board{number}", size, plane, first))
        first += size[0] * size[1]
    return f"{kind} {'flat' if flat else 'corner'}", {"units": "mm", "boards": boards}


def lens(rng: np.random.Generator, sensor: tuple[int, int]) -> dict[str, Any]:
    """A lens whose field fills the sensor's width to its diagonal."""
    half_deg = float(rng.uniform(30, 100))
    k = [float(rng.normal(0, s)) for s in (0.03, 0.005, 0.0006, 0.0)]
    theta = np.deg2rad(half_deg)
    radius = theta * (1 + sum(c * theta ** (2 * n + 2) for n, c in enumerate(k)))
    reach = rng.uniform(min(sensor), np.hypot(*sensor)) / 2
    focal = float(reach / radius)
    return {
        "image_size": list(sensor), "fx": focal, "fy": focal * (1 + float(rng.normal(0, 0.002))),
        "cx": sensor[0] / 2 + float(rng.normal(0, 0.01 * sensor[0])),
        "cy": sensor[1] / 2 + float(rng.normal(0, 0.01 * sensor[0])),
        "k": k, "p": rng.normal(0, 4e-4, 2).tolist(), "tilt": rng.normal(0, 1e-3, 2).tolist(),
        "max_angle_deg": half_deg,
    }  # fmt: skip


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """A command, its output kept."""
    command = [*PROGRAM, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def outcome(seed: int, folder: Path) -> str:
    """One line of the table."""
    rng = np.random.default_rng([2010, seed])
    sensor = SENSORS[int(rng.integers(len(SENSORS)))]
    name, target = drawn(rng)
    camera = lens(rng, sensor)
    for file, record in (("target.yaml", target), ("lens.yaml", camera)):
        (folder / file).write_text(yaml.safe_dump(record))
    photos = int(rng.integers(8, 25))
    noise, blur = float(rng.uniform(1, 6)), float(rng.uniform(0.4, 1.4))
    head = (
        f"{seed:>4}  {name:<20}{sensor[0]:>5}x{sensor[1]:<5}{2 * camera['max_angle_deg']:>4.0f}°"
        f"{photos:>4}{noise:>6.1f}{blur:>6.2f}"
    )
    given = ["--target", folder / "target.yaml", "--model", folder / "lens.yaml", "--json"]
    shape = ["--noise", f"{noise:.2f}", "--blur", f"{blur:.2f}", "--seed", seed]
    made = run("simulate", *given, *shape, "-n", photos, "-o", folder / "photos")
    if made.returncode:
        return f"{head}  not simulated: {made.stderr.strip().splitlines()[-1]}"
    fit = run(
        "calibrate", folder / "photos", "--target", folder / "target.yaml", "-o", folder / "fit",
        "--no-cache", "--no-report", "--json",
    )  # fmt: skip
    if fit.returncode:
        return f"{head}  refused: {fit.stderr.strip().splitlines()[-1]}"
    record = json.loads(fit.stdout)
    truth = run(
        "compare", folder / "photos" / "true_camera.yaml", folder / "fit" / "camera.yaml", "--json"
    )
    true = json.loads(truth.stdout)["rms_px"] if truth.returncode == 0 else np.nan
    share = record["corners"] / json.loads(made.stdout)["corners"]
    held_out = record["held_out_rms_px"] or np.nan
    said = "; ".join(reason["why"] for reason in record["verdict"]["reasons"])
    return (
        f"{head}{share:>8.3f}{held_out:>10.3f}{true:>8.3f}"
        f"{record['uncertainty']['median_px']:>8.3f}  {record['verdict']['level']}  {said}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="keep the files of each case here")
    options = parser.parse_args()
    print(
        f"case  {'object':<20}{'sensor':^11}{'field':>5}{'n':>4}{'noise':>6}{'blur':>6}"
        f"{'found':>8}{'held out':>10}{'true':>8}{'stated':>8}  verdict"
    )
    for seed in range(options.first, options.first + options.number):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) if options.keep is None else options.keep / str(seed)
            folder.mkdir(parents=True, exist_ok=True)
            print(outcome(seed, folder), flush=True)


if __name__ == "__main__":
    main()
