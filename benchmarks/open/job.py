"""A camera as tools get it: its target, its photos and their corners."""

import csv
import json
import os
from pathlib import Path

import numpy as np

FOLDS = 5
CELLS = (16, 12)  # parts of the photo
LEAST = 6  # corners that make a photo worth fitting
PLAUSIBLE = 0.005  # an RMS above so much of the width is a fit that went astray


class Job:
    """A camera; ``boards`` are as in target.yaml, ``target`` is that file.

    ``world`` (K, 3) and ``local`` (K, 2) are the target's corners in the target's frame and in that
    of their ``board`` (K,), where each has a ``column`` and a ``row``. ``photos`` are (name, file,
    numbers of corners (N,), pixels (N, 2)); ``fold`` says when each is held out, -1 for never.
    """

    def __init__(self, path):
        self.path, self.data = Path(path), dict(np.load(path))
        for name in ("world", "local", "board", "column", "row"):
            setattr(self, name, self.data[name])
        test, number = self.data["test"], np.arange(len(self.data["names"]))
        self.fold = np.where(test, 0, -1) if test.any() else number % min(FOLDS, len(number))
        self.size = tuple(int(side) for side in self.data["size"])
        self.boards = json.loads(str(self.data["boards"]))
        self.target = self.path.parent / "target.yaml"
        self.photos = [
            (str(name), str(file), *self.part(k, self.data))
            for k, (name, file) in enumerate(
                zip(self.data["names"], self.data["files"], strict=True)
            )
        ]

    @staticmethod
    def part(photo, table):
        """Numbers and pixels of a photo's corners."""
        own = table["image"] == photo
        return table["point"][own], table["pixel"][own]

    def of(self, photos):
        """The same camera with other photos, of which those with too few corners are left out."""
        job = object.__new__(Job)
        job.__dict__ = {**self.__dict__, "photos": [one for one in photos if len(one[2]) >= LEAST]}
        return job

    def grid(self, board):
        """(rows, columns) numbers of a board's corners."""
        return grids_of(self.board, self.column, self.row)[board]

    def one_board(self):
        """The board, for finders of one."""
        if len(self.boards) > 1 or self.boards[0]["type"] not in ("checkerboard", "charuco"):
            raise NotImplementedError("its finder is run on one checkerboard or ChArUco board")
        return self.boards[0]

    def one_shape(self):
        """(columns, rows, side of a square), for tools whose boards are of one kind."""
        shapes = {self.grid(board).shape for board in range(len(self.boards))}
        steps = np.diff(np.unique(self.local[:, 0].round(6)))
        if len(shapes) > 1 or np.ptp(steps) > 1e-5 * steps.max():
            raise NotImplementedError("it takes boards of one size, corners at even distances")
        return *shapes.pop()[::-1], float(steps.mean())

    def lifted(self, height):
        """World points (K, 3) of corners that stand so high (K,) on their boards (x cross y)."""
        world = self.world.copy()
        for board in np.unique(self.board):
            own = self.board == board
            places = np.column_stack([self.local[own], np.ones(own.sum())])
            x, y = np.linalg.lstsq(places, self.world[own], rcond=None)[0][:2]
            world[own] += np.outer(height[own], np.cross(x, y))
        return world

    def views(self):
        """For tools of one flat board: (points (N, 3), their numbers, pixels) a board seen."""
        for _, _, point, pixel in self.photos:
            for board in np.unique(self.board[point]):
                own = self.board[point] == board
                if own.sum() >= LEAST:
                    flat = np.column_stack([self.local[point[own]], np.zeros(own.sum())])
                    yield flat, point[own], pixel[own]

    def judged(self):
        """The photos as measure.evaluated takes them."""
        return [(point, pixel, self.board[point]) for _, _, point, pixel in self.photos]

    def spread(self):
        """A corner of each part of the field that has any: their numbers, and pixels (N, 2)."""
        pixel = np.concatenate([one[3] for one in self.photos])
        cell = np.floor(pixel / self.size * CELLS) @ [1, CELLS[0]]
        first = np.unique(cell, return_index=True)[1]
        return first, pixel[first]

    def table(self):
        """A corners.csv of these photos."""
        file = self.path.parent / f"corners_{os.getpid()}.csv"
        rows = [f"# cubicfish corners 1, image_size {self.size[0]}x{self.size[1]}"]
        rows.append("image,board,column,row,x,y")
        for name, _, point, pixel in self.photos:
            for k, (x, y) in zip(point, pixel, strict=True):
                board = self.boards[self.board[k]]["name"]
                rows.append(f"{name},{board},{self.column[k]},{self.row[k]},{x:.6f},{y:.6f}")
        file.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return file


def by_fisheye(k, d, points):
    """cv2.fisheye's pixels. It divides by z: what is beside or behind the camera has none."""
    import cv2

    where, zero = np.ascontiguousarray(points[:, None], float), np.zeros(3)
    with np.errstate(all="ignore"):
        seen = cv2.fisheye.projectPoints(where, zero, zero, k, d)[0]
    return np.where(points[:, 2:] > 0, seen[:, 0], np.nan)


def grids_of(board, column, row):
    """For each board (rows, columns) numbers of its corners."""
    grids = []
    for one in np.unique(board):
        own = np.flatnonzero(board == one)
        grids.append(np.full((row[own].max() + 1, column[own].max() + 1), -1))
        grids[-1][row[own], column[own]] = own
    return grids


def read_table(file, boards, grids):
    """A corners.csv: size, and by photo (corners' numbers, pixels (N, 2))."""
    with open(file, encoding="utf-8", newline="") as stream:
        size, found = stream.readline().split()[-1].split("x"), {}
        for line in csv.DictReader(stream):
            number = grids[boards.index(line["board"])][int(line["row"]), int(line["column"])]
            found.setdefault(line["image"], []).append((number, float(line["x"]), float(line["y"])))
    parts = {name: np.array(rows) for name, rows in found.items()}
    return [int(side) for side in size], {
        n: (p[:, 0].astype(int), p[:, 1:]) for n, p in parts.items()
    }
