"""Thousands of photos in one run: is memory flat, do descriptors stay few, is progress right?

    python benchmarks/long_runs.py [--undistort 5000] [--calibrate 50 100 200 300]

The photos are those of sample_data, many times over (undistort) or newly rendered (calibrate).
Memory and descriptors are those of the program and all its children, every half second; they are
printed for each tenth of the run. The progress bars are read from a terminal. What is installed
beside this Python is what runs.
"""

import argparse
import itertools
import os
import pty
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SAMPLE = Path(__file__).parents[1] / "sample_data"
PROGRAM = str(Path(sys.executable).with_name("cubicfish"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--undistort", type=int, default=5000, metavar="PHOTOS")
    parser.add_argument("--calibrate", type=int, nargs="*", default=[300], metavar="PHOTOS")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="cubicfish-long-") as name:
        folder = Path(name)
        model = folder / "calibration" / "camera.yaml"
        subprocess.run(
            [PROGRAM, "calibrate", SAMPLE / "true_corners.csv", "--target", SAMPLE / "target.yaml",
             "-o", model.parent, "-q"],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        if args.undistort:
            photos = folder / "photos"
            photos.mkdir()
            sources = sorted((SAMPLE / "photos").iterdir())
            for index in range(args.undistort):
                shutil.copy(sources[index % len(sources)], photos / f"{index:05}.jpg")
            watch(
                f"undistort {args.undistort} photos with -j 2",
                [PROGRAM, "undistort", photos, folder / "flat", "-m", model, "-j", "2"],
                args.undistort,
            )
            made = len(list((folder / "flat").iterdir()))
            print(f"  {made} pictures written")
        if any(args.calibrate):
            many = folder / "many"
            subprocess.run(
                [PROGRAM, "simulate", "--target", SAMPLE / "target.yaml", "--model", model, "-n",
                 str(max(args.calibrate)), "-o", many, "--seed", "1", "-q"],
                check=True, stdout=subprocess.DEVNULL,
            )  # fmt: skip
            rendered = sorted(many.glob("photo_*"))
            for count in args.calibrate:
                photos = folder / f"first_{count}"
                photos.mkdir()
                for photo in rendered[:count]:
                    os.link(photo, photos / photo.name)
                watch(
                    f"calibrate from {count} photos",
                    [PROGRAM, "calibrate", photos, "--target", SAMPLE / "target.yaml",
                     "-o", folder / f"from_{count}", "--no-cache"],
                    count,
                )  # fmt: skip


def watch(what: str, command: list[object], total: int) -> None:
    """Run a command at a terminal and follow it."""
    terminal, end = pty.openpty()
    begin = time.monotonic()
    process = subprocess.Popen(
        [str(part) for part in command],
        stdout=subprocess.DEVNULL,
        stderr=end,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "100"},
    )
    os.close(end)
    samples: list[tuple[float, float, int]] = []
    said = b""
    while process.poll() is None:
        if select.select([terminal], [], [], 0.5)[0]:
            try:
                said += os.read(terminal, 1 << 16)
            except OSError:
                break
        if not samples or time.monotonic() - begin - samples[-1][0] > 0.5:
            samples.append((time.monotonic() - begin, *held(process.pid)))
    code = process.wait()
    os.close(terminal)
    values = np.array(samples)
    print(
        f"{what}: exit code {code}, {samples[-1][0]:.0f} s, at most {values[:, 1].max():.0f} MB "
        f"and {values[:, 2].max():.0f} descriptors"
    )
    for label, counts in bars(said.decode(errors="replace")).items():
        falls = sum(after < before for before, after in itertools.pairwise(counts))
        print(
            f"  {label}: from {counts[0]} to {counts[-1]} of {total}, shown {len(counts)} times, "
            f"backwards {falls} times"
        )
    for part in np.array_split(values, min(10, len(values))):
        print(
            f"  {part[0, 0]:6.0f} s  memory {part[:, 1].mean():6.0f} MB, at most "
            f"{part[:, 1].max():6.0f}  descriptors {part[:, 2].max():4.0f}"
        )


def bars(said: str) -> dict[str, list[int]]:
    """What each progress bar counted, in order, from what a terminal was sent."""
    found: dict[str, list[int]] = {}
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", said)
    for line in re.split(r"[\r\n]+", plain):
        counted = re.search(r"([A-Za-z][A-Za-z ]*?)\s+[^\sA-Za-z0-9]+\s+([\d,]+)/[\d,]+\s", line)
        if counted:
            done = int(counted.group(2).replace(",", ""))
            found.setdefault(counted.group(1), []).append(done)
    return found


def held(pid: int) -> tuple[float, int]:
    """Resident megabytes (shared pages once per process) and open files, of a process tree."""
    memory, files = 0.0, 0
    for one in tree(pid):
        try:
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            memory += int(re.search(r"^Pss:\s+(\d+)", text, re.M).group(1)) / 1024
            files += len(os.listdir(f"/proc/{one}/fd"))
        except (OSError, AttributeError):
            continue  # ended meanwhile
    return memory, files


def tree(pid: int) -> list[int]:
    """A process and all that descend from it."""
    found = [pid]
    for one in found:
        try:
            for task in Path(f"/proc/{one}/task").iterdir():
                found += map(int, (task / "children").read_text().split())
        except OSError:
            continue
    return found


if __name__ == "__main__":
    main()
