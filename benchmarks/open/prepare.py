"""One table of corners for all tools: ``prepare.py CAMERA JOB``, run by cubicfish's Python.

CAMERA holds ``target.yaml`` and a table (``corners.csv``, or ``reference_corners.csv`` of another
detector), or ``images``, or a film, and perhaps ``source.json``. A published table is taken before
cubicfish finds one.
"""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import yaml
from trial import LEAST, read_table

from cubicfish import FramesOptions, Target, choose_frames, detect, save_corners

TABLES = ("corners.csv", "reference_corners.csv")
MOST = 30  # frames of a film


def in_order(name):
    """Numbers in names by their value."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def photos_of(camera, target, folder):
    """The photos, or the frames of a film that are worth calibrating from."""
    if (camera / "images").is_dir():
        return sorted((camera / "images").iterdir(), key=lambda file: in_order(file.name))
    films = sorted(camera.glob("film.*"))
    if not films:
        return []
    frames = folder / "frames"
    shutil.rmtree(frames, ignore_errors=True)
    options = FramesOptions(films=str(films[0]), folder=str(frames), target=target, most=MOST)
    return sorted(Path(photo) for photo in choose_frames(options).photos)


def main():
    """Write target.yaml, job.npz and table.csv into the job's folder."""
    camera, folder = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(camera / "target.yaml", folder / "target.yaml")
    target = Target.load(camera / "target.yaml")
    record = yaml.safe_load((camera / "target.yaml").read_text(encoding="utf-8"))
    boards = record["boards"]
    board, column, row, world = target.corners()
    grids, local = [], np.zeros((len(world), 2))
    for k in range(len(boards)):
        own = np.flatnonzero(board == k)
        grids.append(np.full((row[own].max() + 1, column[own].max() + 1), -1))
        grids[-1][row[own], column[own]] = own
        # Lengths along the rows and the columns: what a tool of flat boards is told.
        zero = world[grids[-1][0, 0]]
        local[own, 0] = np.linalg.norm(world[grids[-1][0, column[own]]] - zero, axis=1)
        local[own, 1] = np.linalg.norm(world[grids[-1][row[own], 0]] - zero, axis=1)
    files = {file.name: file for file in photos_of(camera, target, folder)}
    known = [camera / name for name in TABLES if (camera / name).exists()]
    table = folder / "table.csv"
    if known:
        shutil.copy(known[0], table)
    else:
        save_corners(table, detect([str(file) for file in files.values()], target).corners)
    size, found = read_table(table, [one["name"] for one in boards], grids)
    kept = [n for n in sorted(found, key=in_order) if len(found[n][0]) >= LEAST]
    source = camera / "source.json"
    source = json.loads(source.read_text(encoding="utf-8")) if source.exists() else {}
    points, pixels = zip(*(found[name] for name in kept), strict=True)
    np.savez(
        folder / "job.npz", size=size, world=world, local=local, board=board, column=column, row=row,
        boards=json.dumps(boards), names=kept, files=[str(files.get(name, "")) for name in kept],
        image=np.repeat(np.arange(len(kept)), [len(part) for part in points]),
        point=np.concatenate(points), pixel=np.concatenate(pixels),
        test=[name in source.get("test", []) for name in kept],
    )  # fmt: skip
    about = {
        "corners_by": known[0].name if known else "cubicfish detect", "photos": len(kept),
        "corners": sum(map(len, points)), "size": size, "files": len(files) or len(found), **source,
    }  # fmt: skip
    (folder / "about.json").write_text(json.dumps(about, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
