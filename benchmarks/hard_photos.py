"""Corner finders on hard photos of known truth: ``python benchmarks/hard_photos.py [--quick]``.

Photos are rendered through lenses from outside every fitted family (`synthetic_lenses.py` of
tests/support), each with one thing that makes boards hard to read, and go to this project's finder
and to OpenCV's in one run. A corner counts as readable, and so for recall, when it and its
neighbourhood are in the picture, nothing lies over it, and both bright squares at it are brighter
than both dark ones by 20 grey levels.

recall   share of the readable corners that were found within 1 px (1.5 px where it bleeds, is
         blurred by 4 px or more, or out of focus)
false    found corners farther than 3 px from every true corner
grids    accepted grids more than half of whose corners are false
wrong    corners that ``detect`` named, farther than 3 px from the corner of that name; the count
         of named ones stands before it. Names that it calls uncertain are in neither
bias     largest mean error in px along the picture's x and y, the board's x and y, and the radius
spread   RMS of the found corners' errors along x and y, px
s        CPU seconds per photo
"""

import argparse
import os
import sys
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from synthetic import TrueCorners
from synthetic_lenses import SYNTHETIC_LENSES, SyntheticLens, synthetic_lens

from cubicfish import CubicfishError, DetectionError, Target, detect
from cubicfish.find import find_grids
from cubicfish.scene import Look, Scene

SIZE = (640, 480)
Pose = tuple[np.ndarray, np.ndarray]
COLUMNS, ROWS, SQUARE = 10, 7, 30.0
A_LENS = 2  # photos, and one of them with markers too
FAR_PX = 3.0
READABLE = 20.0
Effect = Callable[[np.ndarray, TrueCorners, np.random.Generator], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, kw_only=True)
class Hard:
    """What makes photos hard; ``effect`` changes the noise-free photo and says what it hides."""

    name: str
    step_px: tuple[float, float] = (15, 24)
    exposure: float = 1.0
    blur: float = 0.7
    noise: float = 2.0
    quality: int | None = None
    cut: bool = False
    near_px: float = 1.0
    background: Callable[[np.ndarray], np.ndarray] | None = None
    effect: Effect | None = None


def motion(length: float) -> Effect:
    def smear(photo, _, rng):
        way = rng.uniform(0, np.pi)
        steps = np.linspace(-0.5, 0.5, 41) * length
        kernel = np.zeros((15, 15))
        for step in steps:
            x, y = 7 + step * np.cos(way), 7 + step * np.sin(way)
            i, j = int(y), int(x)
            fy, fx = y - i, x - j
            kernel[i : i + 2, j : j + 2] += np.outer([1 - fy, fy], [1 - fx, fx])
        return cv2.filter2D(photo, -1, kernel / kernel.sum()), np.zeros(photo.shape, bool)

    return smear


def defocus(radius: float) -> Effect:
    def soften(photo, *_):
        offset = np.arange(-8, 9)
        apart = np.hypot(offset[:, None], offset)
        disk = np.clip(radius + 0.5 - apart, 0, 1)
        return cv2.filter2D(photo, -1, disk / disk.sum()), np.zeros(photo.shape, bool)

    return soften


def _places(photo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.meshgrid(np.arange(photo.shape[1]), np.arange(photo.shape[0]))


def glare(photo, seen, rng):
    """A lamp's reflection over part of the board: bright beyond white in its middle."""
    x, y = _places(photo)
    middle = seen.pixel[seen.visible][rng.integers(seen.visible.sum())]
    width = 0.22 * np.ptp(seen.pixel[seen.visible], axis=0).max()
    bell = np.exp(-0.5 * ((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / width**2)
    return photo + 330 * bell, np.zeros(photo.shape, bool)


def hands(photo, seen, rng):
    """Fingers over an edge of the board and two cables across it."""
    shape, hidden = photo.copy(), np.zeros(photo.shape, np.uint8)
    pixel = seen.pixel[seen.visible]
    rim = pixel[rng.integers(len(pixel))]
    middle = pixel.mean(axis=0)
    way = (middle - rim) / (np.linalg.norm(middle - rim) + 1e-9)
    for finger in range(3):
        off = np.array([-way[1], way[0]]) * (finger - 1) * 17
        ends = [tuple(np.rint(rim + off - way * 50).astype(int).tolist()),
                tuple(np.rint(rim + off + way * 12).astype(int).tolist())]  # fmt: skip
        cv2.line(shape, *ends, float(rng.uniform(110, 170)), 14, cv2.LINE_AA)
        cv2.line(hidden, *ends, 1, 17)
    for _ in range(2):
        turn = rng.uniform(0, np.pi)
        along = np.array([np.cos(turn), np.sin(turn)])
        start = pixel[rng.integers(len(pixel))]
        t = np.linspace(-400, 400, 60)
        bow = 14 * np.sin(t / 45 + rng.uniform(0, 6))
        line = start + t[:, None] * along + bow[:, None] * [-along[1], along[0]]
        line = np.rint(line).astype(np.int32)
        cv2.polylines(shape, [line], False, float(rng.choice([15, 200])), 4, cv2.LINE_AA)
        cv2.polylines(hidden, [line], False, 1, 7)
    return cv2.GaussianBlur(shape, (0, 0), 0.4), hidden > 0


def lamp(photo, seen, _):
    """Dim light that falls off across the picture from a lamp beside it."""
    x, y = _places(photo)
    away = np.hypot(x + 60, y - 100) / 500
    return 6 + (photo - 6) * (0.32 / (0.35 + away**2)), np.zeros(photo.shape, bool)


def dark_wall(directions: np.ndarray) -> np.ndarray:
    return np.full(len(directions), 0.06)


def tiles(directions: np.ndarray) -> np.ndarray:
    """Chequered wallpaper on the walls of a room, squares about as large as the board's."""
    place = directions / np.abs(directions).max(axis=1, keepdims=True)
    cell = np.floor(place * 9).astype(int).sum(axis=1)
    return np.where(cell % 2 == 0, 0.2, 0.75)


CASES = (
    Hard(name="plain"),
    Hard(name="bleeding, gap 1 px", exposure=1.3, near_px=1.5),
    Hard(name="bleeding, gap 2 px", exposure=1.65, near_px=1.5),
    Hard(name="bleeding, gap 4 px", exposure=2.5, near_px=1.5),
    Hard(name="motion 2 px", effect=motion(2)),
    Hard(name="motion 4 px", effect=motion(4), near_px=1.5),
    Hard(name="motion 6 px", effect=motion(6), near_px=1.5),
    Hard(name="defocus 2 px", effect=defocus(2), near_px=1.5),
    Hard(name="defocus 4 px", effect=defocus(4), near_px=1.5),
    Hard(name="noise 8", noise=8),
    Hard(name="noise 16", noise=16),
    Hard(name="JPEG quality 30", quality=30),
    Hard(name="glare", effect=glare),
    Hard(name="hands and cables", effect=hands),
    Hard(name="dark wall", background=dark_wall),
    Hard(name="chequered wall", background=tiles),
    Hard(name="squares of 6 px", step_px=(6, 6.5)),
    Hard(name="cut by the border", cut=True),
    Hard(name="dim, one lamp", effect=lamp, noise=2.5),
)


def board(marked: bool) -> Target:
    own = {"name": "board", "corners": [COLUMNS, ROWS], "square": SQUARE, "type": "checkerboard"}
    if marked:
        own |= {"type": "charuco", "dictionary": "DICT_4X4_50", "marker": 0.8 * SQUARE}
    return Target.from_data({"units": "mm", "boards": [own]})


def chosen_pose(case: Hard, lens: SyntheticLens, rng: np.random.Generator) -> Pose:
    """The board somewhere in the field, slanted by up to 40°, with squares of the case's size."""
    target = board(False)
    middle = np.array([(COLUMNS - 1) / 2, (ROWS - 1) / 2, 0]) * SQUARE
    for _ in range(4000):
        pixel = rng.uniform([0, 0], SIZE)
        ray = lens.unproject(pixel)
        if not np.isfinite(ray[0]):
            continue
        slant, side, roll = np.radians(rng.uniform(0, 40)), *rng.uniform(-np.pi, np.pi, 2)
        across = np.cross(ray, [np.cos(side), np.sin(side), 0.3])
        across /= np.linalg.norm(across)
        inward = np.cos(slant) * ray + np.sin(slant) * across
        x = np.cross(inward, [np.cos(roll), np.sin(roll), 0.2])
        x /= np.linalg.norm(x)
        turn = np.stack([x, np.cross(inward, x), inward], axis=1)
        # Slant, perspective and the rim make squares smaller than the axis would have them.
        distance = lens.focal[0] * SQUARE / (rng.uniform(*case.step_px) * rng.uniform(1, 1.6))
        pose = cv2.Rodrigues(turn)[0].ravel(), distance * ray - turn @ middle
        seen = Scene(target=target, lens=lens, image_size=SIZE).corners(pose)
        whole = seen.visible.all()
        if case.cut != (not whole) or seen.visible.mean() < 0.4:
            continue
        grid = seen.pixel.reshape(ROWS, COLUMNS, 2)
        step = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
        step = np.concatenate(
            [step.ravel(), np.linalg.norm(np.diff(grid, axis=0), axis=-1).ravel()]
        )
        step = step[np.isfinite(step)]
        if case.step_px[0] <= np.percentile(step, 10) <= case.step_px[1]:
            return pose
    raise SystemExit(f"{case.name}: no pose was found")


@dataclass(frozen=True, kw_only=True)
class Shot:
    photo: np.ndarray
    seen: TrueCorners
    readable: np.ndarray


def taken(case, lens, pose, seed, readable=None) -> Shot:
    """A photo of the plain board, or, where it is known what can be read, of the marked one."""
    target = board(readable is not None)
    rng = np.random.default_rng(seed)
    look = Look(noise=0, blur=case.blur, vignetting=0.3, exposure=case.exposure)
    scene = Scene(target=target, lens=lens, image_size=SIZE)
    clean = scene.photo(pose, look, background=case.background).astype(float)
    seen = scene.corners(pose)
    hidden = np.zeros(clean.shape, bool)
    if case.effect is not None:
        clean, hidden = case.effect(clean, seen, rng)
    clean = np.clip(clean, 0, 255)
    photo = clean + rng.normal(0, case.noise, clean.shape)
    photo = np.clip(np.rint(photo), 0, 255).astype(np.uint8)
    if case.quality is not None:
        data = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, case.quality])[1]
        photo = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    if readable is None:
        readable = seen.visible & _can_be_read(clean, hidden, seen)
    return Shot(photo=photo, seen=seen, readable=readable)


def _can_be_read(clean: np.ndarray, hidden: np.ndarray, seen: TrueCorners) -> np.ndarray:
    """(N,) whether both bright squares at a corner are brighter than both dark ones, uncovered."""
    grid = np.nan_to_num(seen.pixel.reshape(ROWS, COLUMNS, 2), nan=-1e3)
    down, right = np.gradient(grid, axis=0), np.gradient(grid, axis=1)
    level = {}
    covered = np.zeros(grid.shape[:2], bool)
    mean = cv2.blur(clean, (3, 3))
    for i in (-1, 1):
        for j in (-1, 1):
            for share in (0.15, 0.35):
                place = np.rint(grid + share * (i * right + j * down)).astype(int)
                x, y = (np.clip(place[..., k], 0, SIZE[k] - 1) for k in (0, 1))
                level[i, j] = mean[y, x]
                covered |= hidden[y, x]
    first = np.minimum(level[1, 1], level[-1, -1]) - np.maximum(level[1, -1], level[-1, 1])
    other = np.minimum(level[1, -1], level[-1, 1]) - np.maximum(level[1, 1], level[-1, -1])
    return ((np.maximum(first, other) >= READABLE) & ~covered).ravel()


# Finders: photo -> corners (N, 2) and how many grids of them each hold.
def ours(photo):
    return [grid.pixel for grid in find_grids(photo).grids]


def sectors(photo):
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCornersSB(photo, (COLUMNS, ROWS), flags=flags)
    return [corners.reshape(-1, 2)] if found else []


def classic(photo):
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(photo, (COLUMNS, ROWS), flags=flags)
    if not found:
        return []
    grid = corners.reshape(ROWS, COLUMNS, 2)
    step = np.linalg.norm(np.diff(grid, axis=1), axis=-1).min()
    half = int(np.clip(0.4 * step, 2, 5))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
    return [cv2.cornerSubPix(photo, corners, (half, half), (-1, -1), stop).reshape(-1, 2)]


PLAIN = {"cubicfish": ours, "cv2 SB": sectors, "cv2 classic": classic}


def our_marked(photo):
    with suppress(DetectionError):  # none is named
        return [detect([photo], board(True), again=False).corners.pixel]
    return []


def charuco(photo):
    layout = cv2.aruco.CharucoBoard(
        (COLUMNS + 1, ROWS + 1),
        SQUARE,
        0.8 * SQUARE,
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50),
        board(True).boards[0].marker_cells()[:, 0].astype(np.int32),
    )
    corners, ids, _, _ = cv2.aruco.CharucoDetector(layout).detectBoard(photo)
    return [] if ids is None else [np.asarray(corners, float).reshape(-1, 2)]


MARKED = {"cubicfish, ChArUco": our_marked, "cv2 CharucoDetector": charuco}


@dataclass
class Score:
    readable: int = 0
    found: int = 0
    false: int = 0
    grids: int = 0
    seconds: float = 0.0
    photos: int = 0
    errors: list[np.ndarray] = field(default_factory=list)
    along: list[np.ndarray] = field(default_factory=list)

    def add(self, shot: Shot, parts: list[np.ndarray], seconds: float, near: float) -> None:
        """Count one photo."""
        self.photos += 1
        self.seconds += seconds
        self.readable += int(shot.readable.sum())
        all_true = shot.seen.pixel[np.isfinite(shot.seen.pixel[:, 0])]
        for part in parts:
            if len(part):
                away = np.linalg.norm(part[:, None] - all_true, axis=-1).min(axis=1) > FAR_PX
                self.false += int(away.sum())
                self.grids += bool(away.mean() > 0.5)
        corners = np.concatenate([*parts, np.zeros((0, 2))])
        true = shot.seen.pixel[shot.readable]
        if not len(corners) or not len(true):
            return
        apart = corners[None] - true[:, None]
        distance = np.linalg.norm(apart, axis=-1)
        hit = distance.min(axis=1) < near
        self.found += int(hit.sum())
        error = apart[np.arange(len(true)), distance.argmin(axis=1)][hit]
        grid = shot.seen.pixel.reshape(ROWS, COLUMNS, 2)
        axes = [np.gradient(grid, axis=axis).reshape(-1, 2)[shot.readable][hit] for axis in (1, 0)]
        axes.append(true[hit] - np.array(SIZE) / 2)
        ways = [axis / np.linalg.norm(axis, axis=1, keepdims=True) for axis in axes]
        self.errors.append(error)
        self.along.append(np.stack([*error.T, *((error * way).sum(axis=1) for way in ways)]))

    def line(self) -> str:
        """The table's columns."""
        recall = self.found / max(self.readable, 1)
        text = f"{recall:6.3f} {self.false:5d} {self.grids:5d}"
        if self.found:
            error = np.concatenate(self.errors)
            bias = np.abs(np.nanmean(np.concatenate(self.along, axis=1), axis=1)).max()
            text += f" {bias:6.3f} {np.sqrt(np.mean(error**2)):6.3f}"
        else:
            text += "      -      -"
        return text + f" {self.seconds / max(self.photos, 1):5.2f}"


def named(shots: list[Shot]) -> tuple[int, int]:
    """How many corners ``detect`` names in photos of one lens, and how many wrongly."""
    try:
        found = detect([shot.photo for shot in shots], board(False)).corners
    except CubicfishError:
        return 0, 0
    index = {name: i for i, name in enumerate(f"photo_{k}" for k in range(len(shots)))}
    photo = np.array([index[found.images[i]] for i in found.image])
    true = np.stack([shot.seen.pixel for shot in shots])[photo, found.row * COLUMNS + found.column]
    away = np.linalg.norm(found.pixel - true, axis=1)
    return int(found.certain.sum()), int((found.certain & ~(away < FAR_PX)).sum())


def main() -> None:
    """Render, find, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="two lenses of four")
    parser.add_argument("--only", help="cases whose name holds this")
    parser.add_argument("--save", help="folder for the photos, to look at")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    cv2.setNumThreads(1)
    lenses = SYNTHETIC_LENSES[:2] if arguments.quick else SYNTHETIC_LENSES
    made = {name: synthetic_lens(name, SIZE) for name in lenses}
    head = f"{'':22} {'':20} recall false grids   bias spread     s  named/wrong"
    print(head)
    for number, case in enumerate(CASES):
        if arguments.only and arguments.only not in case.name:
            continue
        scores = {name: Score() for name in (*PLAIN, *MARKED)}
        count = wrong = 0
        for which, name in enumerate(lenses):
            shots = []
            for k in range(A_LENS):
                seed = (number, which, k)
                pose = chosen_pose(case, made[name], np.random.default_rng(seed))
                for marked, finders in ((False, PLAIN), (True, MARKED)):
                    if marked and k % 2:
                        continue
                    known = shots[-1].readable if marked else None
                    shot = taken(case, made[name], pose, seed, known)
                    if arguments.save:
                        place = f"{case.name}_{name}_{k}_{'m' if marked else 'p'}.png"
                        cv2.imwrite(f"{arguments.save}/{place.replace(' ', '_')}", shot.photo)
                    if not marked:
                        shots.append(shot)
                    for label, find in finders.items():
                        start = time.process_time()
                        parts = find(shot.photo)
                        spent = time.process_time() - start
                        scores[label].add(shot, parts, spent, case.near_px)
            some, bad = named(shots)
            count, wrong = count + some, wrong + bad
        for label, score in scores.items():
            first = case.name if label == "cubicfish" else ""
            last = f"  {count}/{wrong}" if label == "cubicfish" else ""
            print(f"{first:22} {label:20} {score.line()}{last}")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
