"""One tool on one camera, run by the tool's own Python: ``trial.py ADAPTER VARIANT JOB FOLDER``.

Each piece of work leaves FOLDER/<piece>.npz, so that what is there is not done again. A piece that
ends the process (a crash, too much processor time) is found by FOLDER/<piece>.begun afterwards.
"""

import ast
import csv
import importlib.util
import json
import os
import resource
import sys
import traceback
from functools import partial
from pathlib import Path

import numpy as np
from measure import apart, evaluated

FOLDS = 5
LEAST = 6  # corners that make a photo worth fitting
RECALL_PX = 2.0  # a detector's corner this near to one of the table is that corner
CELLS = (16, 12)  # of the photo, of which each gives one ray to the halves


class Job:
    """A camera: its target, its photos and their corners. All arrays; ``boards`` as in target.yaml.

    ``world`` (K, 3) and ``local`` (K, 2) are the target's corners, in the target's frame and in that
    of its ``board`` (K,). A photo has ``point`` (numbers of corners) and ``pixel`` (N, 2).
    """

    def __init__(self, path, data=None, photos=None):
        self.path = Path(path)
        data = data or dict(np.load(path))
        self.data, self.size = data, tuple(int(side) for side in data["size"])
        self.world, self.local, self.board = data["world"], data["local"], data["board"]
        self.boards = json.loads(str(data["boards"]))
        self.target = self.path.parent / "target.yaml"
        names = [str(name) for name in data["names"]]
        files = [str(file) for file in data["files"]]
        if photos is None:
            parts = [np.flatnonzero(data["image"] == k) for k in range(len(names))]
            photos = [
                (name, file, data["point"][part], data["pixel"][part])
                for name, file, part in zip(names, files, parts, strict=True)
            ]
        self.photos = photos

    def grid(self, board):
        """(rows, columns) numbers of a board's corners; -1 where it has none."""
        own = np.flatnonzero(self.board == board)
        column, row = self.data["column"][own], self.data["row"][own]
        numbers = np.full((row.max() + 1, column.max() + 1), -1)
        numbers[row, column] = own
        return numbers

    def one_board(self):
        """The board, for finders of one."""
        if len(self.boards) > 1:
            raise NotImplementedError("its finder takes one board")
        if self.boards[0]["type"] == "aprilgrid":
            raise NotImplementedError("its finder of AprilGrids is not run here")
        return self.boards[0]

    def one_shape(self):
        """(columns, rows) of all boards, for tools that take boards of one kind."""
        shapes = {self.grid(board).shape[::-1] for board in range(len(self.boards))}
        if len(shapes) > 1 or (self.grid(0) < 0).any():
            raise NotImplementedError("it takes full grids of one size")
        steps = np.diff(np.unique(self.local[:, 0]))
        if np.ptp(steps) > 1e-6 * steps.max():
            raise NotImplementedError("it takes corners at even distances")
        return shapes.pop()

    def lifted(self, height):
        """World points (K, 3) of boards whose corners stand so high (K,), along x cross y."""
        world = self.world.copy()
        for board in np.unique(self.board):
            own = self.board == board
            places = np.column_stack([self.local[own], np.ones(own.sum())])
            x, y = np.linalg.lstsq(places, self.world[own], rcond=None)[0][:2]
            world[own] += np.outer(height[own], np.cross(x, y))
        return world

    def table(self):
        """A corners.csv of these photos."""
        file = self.path.parent / f"corners_{os.getpid()}.csv"
        rows = [f"# cubicfish corners 1, image_size {self.size[0]}x{self.size[1]}"]
        rows.append("image,board,column,row,x,y")
        column, row = self.data["column"], self.data["row"]
        for name, _, point, pixel in self.photos:
            for k, (x, y) in zip(point, pixel, strict=True):
                board = self.boards[self.board[k]]["name"]
                rows.append(f"{name},{board},{column[k]},{row[k]},{x:.6f},{y:.6f}")
        file.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return file

    def read(self, file):
        """A corners.csv: by photo, corners' numbers and pixels."""
        boards = [board["name"] for board in self.boards]
        return read_table(file, boards, [self.grid(k) for k in range(len(boards))])[1]

    def of(self, photos):
        """The same camera with other photos, of which those with too few corners are left out."""
        return Job(self.path, self.data, [one for one in photos if len(one[2]) >= LEAST])

    def views(self):
        """For tools of one flat board: (name, local (N, 2), points' numbers, pixel) a board seen."""
        for name, _, point, pixel in self.photos:
            for board in np.unique(self.board[point]):
                own = self.board[point] == board
                if own.sum() >= LEAST:
                    yield name, self.local[point[own]], point[own], pixel[own]

    def lists(self):
        """The views as OpenCV takes them: object points (N, 1, 3), image points (N, 1, 2)."""
        views = [(local, pixel) for _, local, _, pixel in self.views()]
        objects = [np.column_stack([xy, np.zeros(len(xy))])[:, None] for xy, _ in views]
        return objects, [np.ascontiguousarray(pixel[:, None]) for _, pixel in views]

    def judged(self):
        """The photos as measure.evaluated takes them."""
        return [(point, pixel, self.board[point]) for _, _, point, pixel in self.photos]


def read_table(file, boards, grids):
    """A corners.csv: size, and by photo (corners' numbers, pixels (N, 2))."""
    with open(file, encoding="utf-8", newline="") as stream:
        size = tuple(int(side) for side in stream.readline().split()[-1].split("x"))
        found = {}
        for row in csv.DictReader(stream):
            number = grids[boards.index(row["board"])][int(row["row"]), int(row["column"])]
            found.setdefault(row["image"], []).append((number, float(row["x"]), float(row["y"])))
    parts = {name: np.array(rows) for name, rows in found.items()}
    return size, {name: (part[:, 0].astype(int), part[:, 1:]) for name, part in parts.items()}


def lines_of(adapter):
    """Lines of code of ``fit``: what a user of the tool would write."""
    tree = ast.parse(Path(adapter).read_text(encoding="utf-8"))
    lines = set()
    for part in tree.body:
        if isinstance(part, ast.FunctionDef) and part.name == "fit":
            body = part.body[1:] if ast.get_docstring(part) else part.body
            for node in body:
                lines |= set(range(node.lineno, node.end_lineno + 1))
    return len(lines)


class Trial:
    """A tool on a camera; each method is a piece, and returns arrays."""

    def __init__(self, adapter, variant, job, folder):
        spec = importlib.util.spec_from_file_location("adapter", adapter)
        self.tool = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.tool)
        self.adapter, self.variant = adapter, variant
        self.job, self.folder = Job(job), folder
        test = self.job.data.get("test")
        number = np.arange(len(self.job.photos))
        folds = min(FOLDS, len(number))
        self.fold = np.where(test, 0, -1) if test is not None and test.any() else number % folds

    def pieces(self):
        """All names, in the order in which they are done."""
        folds = [f"fold{k}" for k in np.unique(self.fold[self.fold >= 0])]
        photos = hasattr(self.tool, "detect") and any(self.job.data["files"])
        own = ["detect", *(f"own_{fold}" for fold in folds)] if photos else []
        fits = ["full", *folds, "halves"] if hasattr(self.tool, "fit") else []
        return [*fits, *(own if fits else own[:1])]

    def fitted(self, job):
        """Of all starts the fit of least median error on its own photos; what it is judged by.

        Returns the model, its projection, its target's corners, and what was told on the way.
        """
        best, least, told = None, np.inf, {"lost": [], "seconds": 0.0}
        starts = self.tool.VARIANTS[self.variant]
        for start in range(starts):
            begun = spent()
            try:
                model = self.tool.fit(job, self.variant, start)
                seconds = spent() - begun
                lens = partial(self.tool.project, model)
                world = job.world if model.get("world") is None else model["world"]
                middle = np.median(evaluated(lens, world, job.judged())[0]) if starts > 1 else 0.0
            except Exception as problem:
                told["lost"].append(f"start {start}: {said(problem)}" if starts > 1 else said(problem))
                continue
            if best is None or middle < least:
                best, least = (model, lens, world), middle
                told |= {"seconds": seconds, "start": start}
        if best is None:
            raise ValueError("; ".join(told["lost"]))
        return *best, told

    def full(self):
        """A fit to all photos: its time, memory and claims, and errors on those very photos."""
        everything = self.job.of(self.job.photos)
        model, lens, world, told = self.fitted(everything)
        pixel, _, angle, rays = evaluated(lens, world, everything.judged())
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        return {
            "px": pixel, "angle": angle, "rays": self.spread(everything, rays), "memory": memory,
            "seconds": told["seconds"], "start": told["start"], "lost": "; ".join(told["lost"]),
            "lines": lines_of(self.adapter), "note": str(model.get("note", "")),
            "claims": json.dumps(model.get("claimed", {})), "refined": world is not everything.world,
        }  # fmt: skip

    def spread(self, job, rays):
        """Of the corners' rays, one of each cell of the photo."""
        pixel = np.concatenate([one[3] for one in job.photos])
        cell = np.floor(pixel / (np.array(job.size) / CELLS)).astype(int) @ [1, CELLS[0]]
        return rays[np.unique(cell, return_index=True)[1]]

    def split(self, photos, fold):
        """Of photos in the table's order, those of a fold and the others."""
        inside = [one for one, k in zip(photos, self.fold, strict=True) if k == fold]
        return inside, [one for one, k in zip(photos, self.fold, strict=True) if k != fold]

    def held_out(self, fold, photos, own=False):
        """Errors of a fold's photos by a lens fitted to others; as exported, and board as drawn."""
        test = self.job.of(self.split(self.job.photos, fold)[0])
        model, lens, world, _ = self.fitted(self.job.of(self.split(photos, fold)[1]))
        names = [name for name, _, point, _ in test.photos for _ in point]
        found = {"photo": np.array(names), "note": str(model.get("note", ""))}
        found |= self.errors("", lens, world, test)
        if not own and model.get("world") is not None:
            found |= self.errors("drawn_", lens, self.job.world, test)
        if not own and hasattr(self.tool, "export"):
            try:
                if (exported := self.tool.export(model, self.folder)) is not None:
                    found |= self.errors("export_", exported, world, test)
            except Exception as problem:
                found["export_problem"] = said(problem)
        return found

    def errors(self, prefix, lens, world, test):
        """Pixels, arc minutes and angles of test photos."""
        names = (f"{prefix}px", f"{prefix}min", f"{prefix}angle")
        return dict(zip(names, evaluated(lens, world, test.judged()), strict=False))

    def halves(self):
        """How far lenses of every other photo are apart, over the field."""
        lenses = [self.fitted(self.job.of(self.job.photos[half::2]))[1] for half in (0, 1)]
        far = 1e4 * np.ptp(self.job.world, axis=0).max()
        return {"px": apart(*lenses, far * known(self.folder, "full")["rays"])}

    def detect(self):
        """What the tool's own detector finds of the table's corners, and its own table."""
        begun, found, recalled = spent(), [], []
        for number, (_, file, _, pixel) in enumerate(self.job.photos):
            point, own = self.tool.detect(file, self.job)
            own = np.reshape(np.asarray(own, float), (-1, 2))
            found.append((np.full(len(point), number), point, own))
            away = np.linalg.norm(pixel[:, None] - found[-1][2], axis=-1)
            recalled.append((away <= RECALL_PX).any(axis=1))
        image, point, own = (np.concatenate(part) for part in zip(*found, strict=True))
        return {
            "image": image, "point": point.astype(int), "pixel": own,
            "recalled": np.concatenate(recalled), "seconds": spent() - begun,
        }  # fmt: skip

    def run(self, piece):
        """The arrays of a piece."""
        if piece.startswith("fold"):
            return self.held_out(int(piece[4:]), self.job.photos)
        if not piece.startswith("own_fold"):
            return getattr(self, piece)()
        own, photos = known(self.folder, "detect"), []
        for k, (name, file, *_) in enumerate(self.job.photos):
            mine = own["image"] == k
            photos.append((name, file, own["point"][mine], own["pixel"][mine]))
        table = [self.job.data[key] for key in ("image", "point", "pixel")]
        if all(a.shape == b.shape and np.allclose(a, b, atol=1e-3)
               for a, b in zip(table, (own["image"], own["point"], own["pixel"]), strict=True)):
            return known(self.folder, piece[4:])  # the table is its own
        return self.held_out(int(piece[8:]), photos, own=True)


def spent():
    """Seconds of processor time of this process and its children."""
    both = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in both)


def known(folder, piece):
    """What there is of a piece: arrays, or {"problem": ...} alone; {} if it was not done."""
    if (file := folder / f"{piece}.json").exists():
        return json.loads(file.read_text(encoding="utf-8"))
    file = folder / f"{piece}.npz"
    return dict(np.load(file)) if file.exists() else {}


def said(problem):
    """An exception in one line."""
    return " ".join(f"{type(problem).__name__}: {problem}".split())[:200]


def main():
    """Do what is not yet done."""
    adapter, variant, job, folder, limit = sys.argv[1:6]
    folder = Path(folder)
    try:
        trial = Trial(adapter, variant, job, folder)
    except Exception as problem:
        traceback.print_exc()
        np.savez(folder / "full.npz", problem=said(problem))
        return
    for piece in trial.pieces():
        file, begun = folder / f"{piece}.npz", folder / f"{piece}.begun"
        if file.exists() or file.with_suffix(".json").exists():
            continue
        after = "detect" if piece.startswith("own") else "full"
        if piece != "detect" and "problem" in known(folder, after):
            continue
        begun.touch()
        # Only this piece: what was used so far, and as much again as is allowed.
        most = int(spent() + float(limit)) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        try:
            found = trial.run(piece)
        except Exception as problem:
            traceback.print_exc()
            found = {"problem": said(problem)}
        np.savez(folder / f"{piece}.part.npz", **found)
        os.replace(folder / f"{piece}.part.npz", file)
        begun.unlink()


if __name__ == "__main__":
    main()
