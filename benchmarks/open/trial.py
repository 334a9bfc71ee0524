"""One tool on one camera, run by the tool's own Python: ``trial.py ADAPTER TOOL JOB FOLDER LIMIT``.

Each piece of work leaves FOLDER/<piece>.npz, and what is there is not done again. A piece that ends
the process (a crash, more than LIMIT seconds of processor time) leaves FOLDER/<piece>.begun.
"""

import importlib.util
import inspect
import json
import os
import resource
import sys
import traceback
from functools import partial
from pathlib import Path

import numpy as np
from job import PLAUSIBLE, Job
from measure import apart, evaluated

RECALL_PX = 2.0  # a detector's corner this near to one of the table is that corner


class Trial:
    """A tool on a camera; ``run`` does a piece, and returns arrays."""

    def __init__(self, adapter, variant, job, folder):
        spec = importlib.util.spec_from_file_location("adapter", adapter)
        self.tool = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.tool)
        self.variant, self.job, self.folder = variant, Job(job), folder

    def pieces(self):
        """All names, in the order in which they are done."""
        folds = [f"fold{k}" for k in np.unique(self.job.fold[self.job.fold >= 0])]
        fits = ["full", *folds, "halves"] if hasattr(self.tool, "fit") else []
        own = hasattr(self.tool, "detect") and any(self.job.data["files"])
        return fits + (["detect"] + [f"own_{fold}" for fold in folds if fits]) * own

    def run(self, piece):
        """The arrays of a piece."""
        if piece.startswith("fold"):
            return self.held_out(int(piece[4:]), self.job.photos)
        if not piece.startswith("own_fold"):
            return getattr(self, piece)()
        own = known(self.folder, "detect")
        photos = [(*one[:2], *self.job.part(k, own)) for k, one in enumerate(self.job.photos)]
        return self.held_out(int(piece[8:]), photos, extra=False)

    def fitted(self, job):
        """The fit of least RMS by its own words, of starts up to the first that is plausible.

        Returns the model, its projection, its target's corners, and what was told on the way.
        """
        best, least, told = None, np.inf, {"lost": [], "seconds": 0.0}
        for start in range(self.tool.VARIANTS[self.variant]):
            begun = spent()
            try:
                model = self.tool.fit(job, self.variant, start)
            except Exception as problem:
                told["lost"].append(f"start {start + 1}: {said(problem)}")
                continue
            if best is None or model["claimed"]["rms_px"] < least:
                best, least = model, model["claimed"]["rms_px"]
                told["seconds"] = spent() - begun
            if least < PLAUSIBLE * job.size[0]:
                break
        if best is None:
            raise ValueError("; ".join(told["lost"]))
        world = job.world if best.get("world") is None else best["world"]
        return best, partial(self.tool.project, best), world, told

    def full(self):
        """A fit to all photos: its time, memory and claims, and errors on those very photos."""
        job = self.job
        model, lens, world, told = self.fitted(job)
        pixel, _, _, rays = evaluated(lens, world, job.judged())
        return {
            "px": pixel, "rays": rays[job.spread()[0]], "seconds": told["seconds"],
            "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "lines": inspect.getsource(self.tool.fit).strip().count("\n") - 1,
            "note": str(model.get("note", "")),
            "claims": json.dumps(model.get("claimed", {})), "lost": "; ".join(told["lost"]),
            "refined": model.get("world") is not None,
        }  # fmt: skip

    def held_out(self, fold, photos, extra=True):
        """Errors of a fold's photos by a lens fitted to the others.

        ``extra``: also with the board as drawn where the tool fits it too, and as exported.
        """
        pairs = list(zip(self.job.photos, self.job.fold, strict=True))
        test = self.job.of([photo for photo, held in pairs if held == fold])
        train = self.job.of([p for p, k in zip(photos, self.job.fold, strict=True) if k != fold])
        model, lens, world, _ = self.fitted(train)
        found = {"photo": np.array([one[0] for one in test.photos for _ in one[2]])}
        found["px"], found["min"], found["angle"], _ = evaluated(lens, world, test.judged())
        if extra and model.get("world") is not None:
            found["drawn"] = evaluated(lens, self.job.world, test.judged())[0]
        if extra and hasattr(self.tool, "export"):
            try:
                found["export"] = evaluated(self.tool.export(model), world, test.judged())[0]
            except Exception as problem:
                found["export_problem"] = said(problem)
        return found

    def halves(self):
        """How far lenses of every other photo are apart, over the field."""
        lenses = []
        for job in [self.job.of(self.job.photos[half::2]) for half in (0, 1)]:
            _, lens, world, _ = self.fitted(job)
            if np.median(evaluated(lens, world, job.judged())[0]) > PLAUSIBLE * job.size[0]:
                # Two that give up at the same guess would agree.
                raise ValueError("no lens that fits the half of the photos that it was fitted to")
            lenses.append(lens)
        far = 1e4 * np.ptp(self.job.world, axis=0).max()
        return {"px": apart(*lenses, far * known(self.folder, "full")["rays"])}

    def detect(self):
        """What the tool's own detector finds of the table's corners, and its own table."""
        found = {"image": [], "point": [], "pixel": [], "recalled": []}
        for number, (_, file, _, pixel) in enumerate(self.job.photos):
            try:
                point, own = self.tool.detect(file, self.job)
            except NotImplementedError:
                raise
            except Exception:  # of this photo; the others may do
                traceback.print_exc()
                point, own = [], []
            own = np.reshape(np.asarray(own, float), (-1, 2))
            away = np.linalg.norm(pixel[:, None] - own, axis=-1)
            found["image"].append(np.full(len(point), number))
            found["point"].append(np.asarray(point, int))
            found["pixel"].append(own)
            found["recalled"].append((away <= RECALL_PX).any(axis=1))
        return {name: np.concatenate(parts) for name, parts in found.items()}


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
    adapter, tool, job, folder, limit = sys.argv[1:]
    trial = Trial(adapter, tool, job, Path(folder))
    for piece in trial.pieces():
        before = known(trial.folder, "detect" if piece.startswith("own") else "full")
        if known(trial.folder, piece) or ("problem" in before and piece != "detect"):
            continue
        begun = trial.folder / f"{piece}.begun"
        begun.touch()
        # Only this piece: what was used so far, and as much again as is allowed.
        most = int(spent() + float(limit)) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        try:
            found = trial.run(piece)
        except Exception as problem:
            traceback.print_exc()
            found = {"problem": said(problem)}
        np.savez(begun.with_suffix(".part.npz"), **found)
        os.replace(begun.with_suffix(".part.npz"), begun.with_suffix(".npz"))
        begun.unlink()


if __name__ == "__main__":
    main()
