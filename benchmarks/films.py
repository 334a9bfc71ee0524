"""What frames of a film are worth: ``python benchmarks/films.py FOLDER [--seconds 18] ...``.

`cubicfish simulate --film` renders films through lenses from outside the fitted family, of a corner
of three checkerboards, a ChArUco board and an AprilGrid that a hand moves: blur by exposure time,
rolling shutter, H.264. `cubicfish frames` chooses; corners of all frames are found too, and cameras
are made of those of the chosen frames, of all, and of as many frames equally spaced as may be
chosen, the target as drawn. Each is compared with the true lens over the cone that all three know,
with the rotation between them taken out. Films in FOLDER stay there, and are not rendered again.

n          frames chosen, of all
chosen     RMS over the field in px of the camera from the chosen frames
all, equal the same of the others' cameras; ``/`` chosen's over it
time       processor time of `cubicfish frames`, in times of that of decoding alone
"""

import argparse
import csv
import os
import resource
import subprocess
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from cubicfish_cli.correspondences import load_corners, pair, save_corners
from cubicfish_cli.errors import CubicfishError
from cubicfish_cli.films.source import decode, opened
from cubicfish_cli.fitting.alignment import aligned_difference
from cubicfish_cli.fitting.calibrate import Calibration, calibrate
from cubicfish_cli.fitting.subset import select_photos
from cubicfish_cli.frame_names import frame_name
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.library.detect_corners import detect_corners
from cubicfish_cli.photos import Photo
from cubicfish_cli.rendering.lens_file import load_lens
from cubicfish_cli.target import load_target

SAMPLE = Path(__file__).resolve().parents[1] / "sample_data" / "target.yaml"
TARGETS = {
    "corner": SAMPLE.read_text(encoding="utf-8"),
    "charuco": "units: mm\nboards:\n  - {name: board, type: charuco, corners: [7, 4], square: 40, "
    "dictionary: DICT_4X4_50, marker: 31}\n",
    "aprilgrid": "units: mm\nboards:\n  - {name: board, type: aprilgrid, tags: [4, 3], tag: 60, "
    "spacing: 0.3, family: tag36h11}\n",
}
_RAYS = 4000
LENSES = ("moving-pupil", "equisolid", "orthographic")


def cubicfish(*words: object) -> float:
    """Run it; seconds of processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "cubicfish_cli", *map(str, words)], check=True, capture_output=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def photos_of(film: Path) -> tuple[list[Photo], float]:
    """All frames of a film, and the processor time of decoding alone."""
    begin = time.process_time()
    with opened(film) as (container, stream):
        for _ in decode(film, container, stream, sound=False):
            pass
    seconds = time.process_time() - begin
    photos = []
    with opened(film) as (container, stream):
        for frame in decode(film, container, stream, sound=False):
            name = frame_name(film.stem, float(frame.pts * stream.time_base)) + ".png"
            picture = frame.to_ndarray(format="gray")
            photos.append(Photo(name=name, path=Path(name), picture=picture))
    return photos, seconds


def rms_px(fit: Calibration | None, truth: object, angle: float) -> float:
    if fit is None:
        return float("nan")
    miss, _ = aligned_difference(fit.camera, truth, cone_rays(angle, _RAYS))
    miss = miss[np.isfinite(miss[:, 0])]
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=-1))))


def measured(folder: Path, target_file: Path, most: int) -> tuple[float, ...]:
    target = load_target(target_file)
    film, out = folder / "film.mp4", folder / "chosen"
    seconds = cubicfish(
        "frames", film, "-t", target_file, "-o", out, "--overwrite", "--no-cache", "-j", 1,
        "--most", most,
    )  # fmt: skip
    photos, decoding = photos_of(film)
    with (out / "frames.csv").open(encoding="utf-8") as file:
        next(file)
        chosen = {row["photo"] for row in csv.DictReader(file) if row["photo"]}
    table = folder / "all_corners.csv"
    if not table.exists():
        save_corners(table, detect_corners(photos, target, jobs=1).corners)
    pairs = pair(load_corners(table, target), target)
    equal = {
        photos[number].name
        for number in np.linspace(0, len(photos) - 1, min(most, len(photos))).round().astype(int)
    }
    fits = []
    for names in (chosen, None, equal):
        own = [n for n, name in enumerate(pairs.images) if names is None or name in names]
        try:
            fits.append(
                calibrate(
                    select_photos(pairs, np.array(own)),
                    target=target,
                    refine_target="off",
                    hold_out=False,
                )
            )
        except CubicfishError as problem:
            print(f"  {problem}", file=sys.stderr)
            fits.append(None)
    angle = min(fit.camera.max_angle_deg for fit in fits if fit is not None)
    truth = load_lens(folder / "true_camera.yaml")
    errors = [rms_px(fit, truth, np.deg2rad(angle)) for fit in fits]
    return len(chosen), len(photos), *errors, seconds / decoding


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lenses", nargs="+", default=LENSES)
    parser.add_argument("--targets", nargs="+", choices=TARGETS, default=list(TARGETS))
    parser.add_argument("--size", default="720x540")
    parser.add_argument("--seconds", type=float, default=18)
    parser.add_argument("--rate", type=float, default=20)
    parser.add_argument("--most", type=int, default=60)
    parser.add_argument("--seed", type=int, default=3)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    args.folder.mkdir(parents=True, exist_ok=True)
    print(
        f"{'lens':<14}{'target':<11}{'n':>9}{'chosen':>9}{'all':>8}{'/':>6}{'equal':>8}{'/':>6}"
        f"{'time':>7}"
    )
    rows = []
    for lens in args.lenses:
        for name in args.targets:
            target = args.folder / f"{name}.yaml"
            target.write_text(TARGETS[name], encoding="utf-8")
            folder = args.folder / f"b_{lens}_{name}"
            if not (folder / "film.mp4").exists():
                cubicfish(
                    "simulate", "-t", target, "--lens", lens, "--size", args.size, "--film",
                    args.seconds, "--rate", args.rate, "-o", folder, "--seed", args.seed,
                )  # fmt: skip
            number, of, chosen, every, equal, times = measured(folder, target, args.most)
            rows.append((chosen / every, chosen / equal, times))
            print(
                f"{lens:<14}{name:<11}{number:>4} /{of:>4}{chosen:>9.4f}{every:>8.4f}"
                f"{chosen / every:>6.2f}{equal:>8.4f}{chosen / equal:>6.2f}{times:>7.1f}",
                flush=True,
            )
    median = np.nanmedian(np.array(rows), axis=0)
    print(f"{'median':<25}{'':>26}{median[0]:>6.2f}{'':>8}{median[1]:>6.2f}{median[2]:>7.1f}")


if __name__ == "__main__":
    main()
