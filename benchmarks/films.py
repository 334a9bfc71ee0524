"""What frames of a film are worth: ``python benchmarks/films.py FOLDER [--seconds 120] ...``.

Films are rendered through lenses from outside the fitted family (tests/support), of a corner
of three checkerboards, a ChArUco board and an AprilGrid that a hand moves: blur by exposure time,
rolling shutter, H.264. `cubicfish frames` chooses; corners of all frames are found too, and cameras
are made of those of the chosen frames, of all, and of as many frames equally spaced as may be
chosen, the target as drawn. Each is compared with the true lens over the cone that all three know,
with the rotation between them taken out. Films in FOLDER stay there, and are not rendered again.

n          frames chosen, of all that show the target (of one of ``--every`` frames)
chosen     RMS over the field in px of the camera from the chosen frames
all, equal the same of the others' cameras; ``/`` chosen's over it
time       processor time of `cubicfish frames`, its start included, in times of that of decoding
           alone: all frames, one after the other, by PyAV as `frames` does it
1          the same, in times of decoding by one thread
camera     processor time of `cubicfish calibrate film.mp4` beyond that, likewise
"""

import argparse
import os
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
from synthetic_films import Film, FilmOptions, hand_path
from synthetic_lenses import SyntheticLens, synthetic_lens

from cubicfish import (
    Calibration,
    CubicfishError,
    Observations,
    Run,
    Target,
    aligned_difference,
    calibrate,
    detect,
    load_corners,
    save_corners,
)
from cubicfish.files import FrameName
from cubicfish.models import cone_rays
from cubicfish.photos import Photo, find_photos
from cubicfish.scene import Look
from cubicfish_cli.films.source import decode, opened

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


def decoding(film: Path, threads: int | None = None) -> float:
    """Processor time of decoding a film, seconds: the median of three."""
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        with opened(film) as (container, stream):
            if threads is not None:
                stream.thread_count = threads
            for _ in decode(film, container, stream):
                pass
        seconds.append(time.process_time() - begin)
    return float(np.median(seconds))


def photos_of(film: Path, every: int) -> list[Photo]:
    """Frames of a film, one of so many."""
    photos = []
    with opened(film) as (container, stream):
        for frame in islice(decode(film, container, stream), None, None, every):
            name = f"{FrameName(film.stem, float(frame.pts * stream.time_base))}.png"
            picture = frame.to_ndarray(format="gray")
            photos.append(Photo(name=name, path=Path(name), picture=picture))
    return photos


def rms_px(fit: Calibration | None, truth: object, angle: float) -> float:
    if fit is None:
        return float("nan")
    miss, _ = aligned_difference(fit.camera, truth, cone_rays(angle, _RAYS))
    miss = miss[np.isfinite(miss[:, 0])]
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=-1))))


def fitted(pairs: Observations, target: Target) -> Calibration | None:
    """The camera, the target as drawn; None where there is none."""
    try:
        return calibrate(pairs, target=target, refine_target="off", hold_out=False)
    except CubicfishError as problem:
        print(f"  {problem}", file=sys.stderr)
        return None


def corners_in(photos: Sequence[Photo], target: Target) -> Observations:
    """The corners that photos show at first sight."""
    return detect(photos, [target], Run(jobs=1), again=False).corners


def measured(
    folder: Path, target_file: Path, lens: SyntheticLens, most: int, every: int
) -> tuple[float, ...]:
    target = Target.load(target_file)
    film, out = folder / "film.mp4", folder / "chosen"
    options = ("-t", target_file, "--overwrite", "--no-cache", "-j", 1)
    seconds = cubicfish("frames", film, *options, "-o", out, "--most", most)
    whole = cubicfish("calibrate", film, *options, "-o", folder / "calibration", "--best", most)
    usual, one = decoding(film), decoding(film, threads=1)
    table = folder / ("all_corners.csv" if every == 1 else f"all_corners_{every}.csv")
    if not table.exists():
        save_corners(table, corners_in(photos_of(film, every), target))
    pairs = load_corners(table, target)
    chosen = find_photos([out])
    equal = [int(one) for one in np.linspace(0, len(pairs.images) - 1, most).round()]
    fits = [
        fitted(corners_in(chosen, target).with_target(target), target),
        fitted(pairs, target),
        fitted(pairs.of_photos(np.unique(equal)), target),
    ]
    angle = min(fit.camera.max_angle_deg for fit in fits if fit is not None)
    errors = [rms_px(fit, lens.far, np.deg2rad(angle)) for fit in fits]
    times = (seconds / usual, seconds / one, (whole - seconds) / usual)
    return len(chosen), len(pairs.images), *errors, *times


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lenses", nargs="+", default=LENSES)
    parser.add_argument("--targets", nargs="+", choices=TARGETS, default=list(TARGETS))
    parser.add_argument("--size", default="720x540")
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--rate", type=float, default=30)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--most", type=int, default=60)
    parser.add_argument("--seed", type=int, default=3)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    args.folder.mkdir(parents=True, exist_ok=True)
    print(
        f"{'lens':<14}{'target':<11}{'n':>10}{'chosen':>9}{'all':>8}{'/':>6}{'equal':>8}{'/':>6}"
        f"{'time':>7}{'1':>5}{'camera':>8}"
    )
    rows = []
    width, height = map(int, args.size.split("x"))
    size = width, height
    for lens in args.lenses:
        made = synthetic_lens(lens, size)
        for name in args.targets:
            target = args.folder / f"{name}.yaml"
            target.write_text(TARGETS[name], encoding="utf-8")
            folder = args.folder / f"b_{lens}_{name}"
            if not (folder / "film.mp4").exists():
                folder.mkdir(exist_ok=True)
                thing = Target.load(target)
                path = hand_path(thing, made, size, args.seconds, seed=args.seed)
                taken = FilmOptions(rate=args.rate)
                film = Film(target=thing, lens=made, image_size=size, path=path, taken=taken)
                look = Look(seed=args.seed)
                film.write(folder / "film.mp4", round(args.seconds * args.rate), look)
            number, of, chosen, all_of, equal, *times = measured(
                folder, target, made, args.most, args.every
            )
            rows.append((chosen / all_of, chosen / equal, *times))
            print(
                f"{lens:<14}{name:<11}{number:>4} /{of:>4}{chosen:>9.4f}{all_of:>8.4f}"
                f"{chosen / all_of:>6.2f}{equal:>8.4f}{chosen / equal:>6.2f}{times[0]:>7.1f}"
                f"{times[1]:>5.1f}{times[2]:>8.1f}",
                flush=True,
            )
    median = np.nanmedian(np.array(rows), axis=0)
    print(
        f"{'median':<25}{'':>27}{median[0]:>6.2f}{'':>8}{median[1]:>6.2f}"
        f"{median[2]:>7.1f}{median[3]:>5.1f}{median[4]:>8.1f}"
    )


if __name__ == "__main__":
    main()
