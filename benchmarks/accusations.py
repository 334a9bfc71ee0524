"""Whether good photos are ever accused: calibrations of real corner tables, whole and in part.

    python benchmarks/accusations.py NAME=CORNERS.csv:TARGET.yaml ... [--subsets 30] [--jobs 2]

Each table is calibrated whole and in random subsets of 4 photos and more; where the object is one
board, also with its width and height exchanged, in the target and in the table, which is the same
board counted another way. Photos that people took and used are right set-ups: every finding of the
level ``bad`` is a false accusation. Printed are the findings of every level, the verdicts, and each
accusation in words. ``--seed`` draws other subsets.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from cubicfish import FitError, Observations, Target, calibrate, load_corners


@dataclass(frozen=True)
class Trial:
    """Some photos of a table."""

    name: str
    corners: Path
    target: Path
    photos: tuple[int, ...]
    exchanged: bool


def exchanged(pairs: Observations, target: Target) -> tuple[Observations, Target]:
    """The lone board with columns for rows; seen from the printed face as before, turned by 90°."""
    (board,) = target.boards
    turned = replace(board, columns=board.rows, rows=board.columns)
    column, row = pairs.row, board.columns - 1 - pairs.column
    target = replace(target, boards=(turned,))
    world = target.world_points(pairs.board, column, row)
    return replace(pairs, column=column, row=row, world=world), target


def outcome(trial: Trial) -> tuple[Trial, str, list[str], list[str]]:
    """The verdict, causes and levels of what was found, and the words of what is bad."""
    target = Target.load(trial.target)
    pairs = load_corners(trial.corners, target)
    pairs = pairs.of_photos(np.array(trial.photos))
    if trial.exchanged:
        pairs, target = exchanged(pairs, target)
    try:
        found = calibrate(pairs, target=target)
    except FitError as error:
        return trial, "stopped", [], [str(error)]
    judged = found.verdict
    words = [str(finding) for finding in found.findings if finding.severity == "bad"]
    if judged.level == "bad" and not words:
        words = [f"verdict: {judged}"]
    return (
        trial,
        judged.level,
        [f"{finding.code} ({finding.severity})" for finding in found.findings],
        words,
    )


def trials(name: str, corners: Path, target: Path, subsets: int, seed: int) -> list[Trial]:
    """All photos, and random ones."""
    drawing = Target.load(target)
    count = len(load_corners(corners, drawing).images)
    rng = np.random.default_rng([seed, *name.encode()])
    lone = len(drawing.boards) == 1 and drawing.boards[0].kind == "checkerboard"
    whole = tuple(range(count))
    chosen = [Trial(name, corners, target, whole, exchanged=False)]
    if lone:
        chosen.append(Trial(name, corners, target, whole, exchanged=True))
    for _ in range(subsets):
        size = int(rng.integers(min(4, count), count + 1))
        photos = tuple(sorted(rng.choice(count, size, replace=False).tolist()))
        turned = lone and bool(rng.random() < 0.5)
        chosen.append(Trial(name, corners, target, photos, exchanged=turned))
    return chosen


def main() -> None:
    """Print what was said."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="+", metavar="NAME=CORNERS:TARGET")
    parser.add_argument("--subsets", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    accused = stopped = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for table in options.tables:
            name, _, files = table.partition("=")
            corners, _, target = files.partition(":")
            found = trials(name, Path(corners), Path(target), options.subsets, options.seed)
            ends = list(pool.map(outcome, found))
            levels = Counter(level for _, level, _, _ in ends)
            causes = Counter(cause for *_, causes, _ in ends for cause in causes)
            loud = [end for end in ends if any("(bad)" in cause for cause in end[2])]
            accused += len(loud)
            stopped += levels["stopped"]
            print(f"{name}: {len(ends)} trials, {len(loud)} accused; {dict(levels)}")
            print(f"  {dict(causes)}")
            for trial, level, _, words in ends:
                for line in words:
                    turned = ", exchanged" if trial.exchanged else ""
                    print(f"  {level}, {len(trial.photos)} photos{turned}: {line}", flush=True)
    print(f"{accused} accused, {stopped} stopped")


if __name__ == "__main__":
    main()
