"""One table of corners for all tools: ``prepare.py CAMERA JOB``, run by cubicfish's Python.

CAMERA holds ``target.yaml`` and a table (``corners.csv``, or ``reference_corners.csv`` of another
detector, or Deltille's ``corners/*.orpc``), or ``images``, or a film, and perhaps ``source.json``
and ``LICENSE``. A published table comes before what cubicfish finds.
"""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import yaml
from job import LEAST, grids_of, read_table

from cubicfish import Target, detect, save_corners
from cubicfish_cli import FramesOptions, choose_frames

MOST = 30  # frames of a film


def in_order(name):
    """Numbers in names by their value."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", f"_{name}")]


def photos_of(camera, target, folder):
    """The photos, or the frames of a film that are worth calibrating from, by name."""
    found = sorted((camera / "images").iterdir()) if (camera / "images").is_dir() else []
    for film in camera.glob("film.*"):
        shutil.rmtree(folder / "frames", ignore_errors=True)
        options = FramesOptions(
            films=str(film), folder=str(folder / "frames"), target=target, most=MOST
        )
        found += map(Path, choose_frames(options).photos)
    return {file.name: str(file) for file in found}


def first_lines(licence):
    """What it is called and whose it is, in most licences; "none stated" if there is none."""
    text = licence.read_text("utf-8", "replace") if licence.exists() else "none stated"
    lines = text.splitlines()
    return " ".join([line.strip(" #") for line in lines if line.strip(" #")][:2])


def deltille(tables, photos, boards, grids):
    """What read_table gives, of a file a photo: board (board<number>, if there are several),
    number along the rows, 1, x, y."""
    found = {}
    for file in tables:
        points, pixels = [], []
        for board, number, _, x, y in np.loadtxt(file, delimiter=",", skiprows=5, ndmin=2):
            name = f"board{board:.0f}" if len(boards) > 1 else boards[0]
            if name in boards:
                points.append(grids[boards.index(name)].flat[int(number)])
                pixels.append((x, y))
        found[photos[file.stem]] = np.array(points, int), np.reshape(pixels, (-1, 2))
    head = file.read_text(encoding="utf-8").split()
    return [int(head[3]), int(head[5])], found


def main():
    """Write target.yaml, table.csv, job.npz and about.json into the job's folder."""
    camera, folder = map(Path, sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(camera / "target.yaml", folder / "target.yaml")
    target = Target.load(camera / "target.yaml")
    boards = yaml.safe_load((camera / "target.yaml").read_text(encoding="utf-8"))["boards"]
    board, column, row, world = target.corners()
    grids, local = grids_of(board, column, row), np.zeros((len(world), 2))
    for k, grid in enumerate(grids):
        own = board == k
        # Lengths along the rows and the columns: what a tool of flat boards is told.
        for axis, first in enumerate((grid[0, column[own]], grid[row[own], 0])):
            local[own, axis] = np.linalg.norm(world[first] - world[grid[0, 0]], axis=1)
    files = photos_of(camera, target, folder)
    known = [file for n in ("", "reference_") if (file := camera / f"{n}corners.csv").exists()]
    names, by = [one["name"] for one in boards], known[0].name if known else "cubicfish detect"
    if orpc := sorted(camera.glob("corners/*.orpc")):
        photos, by = {Path(name).stem: name for name in files}, "Deltille"
        size, found = deltille(orpc, photos, names, grids)
    else:
        table = known[0] if known else folder / "table.csv"
        if not known:
            save_corners(table, detect(list(files.values()), target).corners, overwrite=True)
        size, found = read_table(table, names, grids)
    kept = [n for n in sorted(found, key=in_order) if len(found[n][0]) >= LEAST]
    source = camera / "source.json"
    source = json.loads(source.read_text(encoding="utf-8")) if source.exists() else {}
    source["licence"] = first_lines(camera / "LICENSE")
    points, pixels = zip(*(found[name] for name in kept), strict=True)
    np.savez(
        folder / "job.npz", world=world, local=local, board=board, column=column, row=row,
        size=size, boards=json.dumps(boards), names=kept,
        files=[files.get(name, "") for name in kept],
        image=np.repeat(np.arange(len(kept)), [len(part) for part in points]),
        point=np.concatenate(points), pixel=np.concatenate(pixels),
        test=[name in source.get("test", []) for name in kept],
    )  # fmt: skip
    about = {
        "corners_by": by, "photos": len(kept),
        "corners": sum(map(len, points)), "size": size, "files": len(files) or len(found), **source,
    }  # fmt: skip
    (folder / "about.json").write_text(json.dumps(about, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
