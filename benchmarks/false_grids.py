"""Boards that are not there: ``python benchmarks/false_grids.py [--count 500]``.

Draws pictures without any calibration board, a tenth each of ten kinds, and counts in how many of
them the finder accepts a grid, by kind and by the number of corners. None should be accepted.
``--save FOLDER`` keeps the pictures in which one was.
"""

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

from cubicfish.find import find_grids

SIZE = (640, 480)
EVERY = 50  # pictures: how far it is
Picture = np.ndarray
Random = np.random.Generator


def texture(rng: Random) -> Picture:
    """Clouds of several scales, as plaster, lawn or cloth."""
    total = np.zeros(SIZE[::-1])
    for octave in range(int(rng.integers(3, 8))):
        side = 3 * 2**octave
        cloud = rng.normal(size=(side, side))
        total += cv2.resize(cloud, SIZE, interpolation=cv2.INTER_CUBIC) * rng.uniform(0.3, 1)
    if rng.random() < 0.3:
        total = np.sign(total)
    return _levels(total)


def tiles(rng: Random) -> Picture:
    """Tiles with joints: all alike, or of a few shades at random; bricks half of the time."""
    picture = np.full((900, 900), float(rng.uniform(100, 230)))
    wide, high, joint = rng.integers(18, 70), rng.integers(18, 70), rng.integers(2, 6)
    shades = rng.uniform(30, 240, rng.integers(1, 4))
    for row, y in enumerate(range(0, 900, int(high))):
        shift = int(wide // 2) * (row % 2) if rng.random() < 0.5 else 0
        for x in range(-int(wide), 900, int(wide)):
            shade = float(rng.choice(shades))
            start = (x + shift + int(joint), y + int(joint))
            cv2.rectangle(picture, start, (x + shift + int(wide) - 1, y + int(high) - 1), shade, -1)
    return picture


def windows(rng: Random) -> Picture:
    """A front with dark windows, each with its cross bars."""
    picture = np.full((900, 900), float(rng.uniform(120, 230)))
    step = rng.integers(50, 110, 2)
    for y in range(10, 880, int(step[1])):
        for x in range(10, 880, int(step[0])):
            far = (x + int(0.6 * step[0]), y + int(0.7 * step[1]))
            cv2.rectangle(picture, (x, y), far, float(rng.uniform(10, 90)), -1)
            middle = ((x + far[0]) // 2, (y + far[1]) // 2)
            bar = int(rng.integers(2, 5))
            cv2.line(picture, (middle[0], y), (middle[0], far[1]), 220.0, bar)
            cv2.line(picture, (x, middle[1]), (far[0], middle[1]), 220.0, bar)
    return picture


def keyboard(rng: Random) -> Picture:
    """Rows of keys, each row shifted, with letters."""
    picture = np.full((900, 900), rng.uniform(10, 60), np.uint8)
    key, gap = int(rng.integers(22, 55)), int(rng.integers(2, 7))
    shade = float(rng.uniform(60, 240))
    for row, y in enumerate(range(0, 900, key + gap)):
        for x in range(-int(0.3 * key * (row % 4)), 900, key + gap):
            cv2.rectangle(picture, (x, y), (x + key, y + key), shade, -1)
            letter = chr(int(rng.integers(65, 91)))
            place = (x + key // 4, y + 3 * key // 4)
            cv2.putText(picture, letter, place, cv2.FONT_HERSHEY_SIMPLEX, key / 45, 255 - shade, 2)
    return picture


def markers(rng: Random) -> Picture:
    """ArUco markers in rows or strewn, without any squares between them."""
    dictionary = cv2.aruco.getPredefinedDictionary(
        int(rng.choice([cv2.aruco.DICT_4X4_50, cv2.aruco.DICT_5X5_250, cv2.aruco.DICT_6X6_250]))
    )
    picture = np.full((900, 900), 235.0)
    side = int(rng.integers(28, 90))
    step = int(side * rng.uniform(1.15, 1.7))
    rows = rng.random() < 0.6
    for y in range(5, 900 - side, step):
        for x in range(5, 900 - side, step):
            number = int(rng.integers(0, 50))
            image = cv2.aruco.generateImageMarker(dictionary, number, side)
            at = (x, y) if rows else tuple(rng.integers(0, 900 - side, 2))
            picture[at[1] : at[1] + side, at[0] : at[0] + side] = image
    return picture


def lines(rng: Random) -> Picture:
    """Squared paper, blinds or a fence: thin lines that cross, of one colour."""
    picture = np.full((900, 900), float(rng.choice([30, 120, 230])))
    shade = float(255 - picture[0, 0]) if picture[0, 0] != 120 else 20.0
    step, thick = rng.integers(10, 60, 2), int(rng.integers(1, 9))
    for x in range(0, 900, int(step[0])):
        cv2.line(picture, (x, 0), (x, 900), shade, thick)
    for y in range(0, 900, int(step[1])):
        cv2.line(picture, (0, y), (900, y), shade, thick)
    return picture


def text(rng: Random) -> Picture:
    """A printed page."""
    picture = np.full((900, 900), 240, np.uint8)
    scale = rng.uniform(0.3, 1.2)
    for y in range(20, 900, int(34 * scale) + 4):
        words = "".join(chr(int(c)) for c in rng.choice([*range(97, 123), 32, 32, 32], 90))
        cv2.putText(picture, words, (5, y), cv2.FONT_HERSHEY_PLAIN, 1.4 * scale, 20.0, 1)
    return picture


def dots(rng: Random) -> Picture:
    """Circle grids, lattices of holes, halftone."""
    picture = np.full((900, 900), float(rng.choice([20, 235])))
    step = int(rng.integers(10, 60))
    radius = max(2, int(step * rng.uniform(0.2, 0.5)))
    for row, y in enumerate(range(0, 900, step)):
        for x in range(0, 900, step):
            middle = (x + (step // 2) * (row % 2) * int(rng.random() < 0.9), y)
            cv2.circle(picture, middle, radius, 255 - float(picture[899, 899]), -1, cv2.LINE_AA)
    return picture


def clutter(rng: Random) -> Picture:
    """Boxes, bars and discs over each other, on texture."""
    picture = cv2.resize(texture(rng), (900, 900))
    for _ in range(int(rng.integers(60, 400))):
        shade, middle = float(rng.uniform(0, 255)), rng.uniform(0, 900, 2)
        if rng.random() < 0.7:
            box = (tuple(middle.tolist()), tuple(rng.uniform(8, 120, 2).tolist()),
                   float(rng.choice([0, 0, 45, rng.uniform(0, 90)])))  # fmt: skip
            cv2.fillPoly(picture, [cv2.boxPoints(box).astype(np.int32)], shade, cv2.LINE_AA)
        else:
            at = tuple(np.rint(middle).astype(int).tolist())
            cv2.circle(picture, at, int(rng.integers(4, 50)), shade, -1, cv2.LINE_AA)
    return picture


def mosaic(rng: Random) -> Picture:
    """Square cells, each dark or bright by chance: QR codes, pixel art, cloth. No chequers."""
    cells = int(rng.integers(18, 70))
    code = rng.random((cells, cells)) < rng.uniform(0.35, 0.65)
    shades = np.where(code, rng.uniform(0, 70), rng.uniform(150, 255))
    return cv2.resize(shades.astype(float), (900, 900), interpolation=cv2.INTER_NEAREST)


KINDS: tuple[Callable[[Random], Picture], ...] = (
    texture, tiles, windows, keyboard, markers, lines, text, dots, clutter, mosaic
)  # fmt: skip


def _levels(values: Picture) -> Picture:
    low, high = np.percentile(values, [1, 99])
    return np.clip((values - low) / (high - low + 1e-9), 0, 1) * 230 + 10


def photographed(picture: Picture, rng: Random) -> Picture:
    """The picture on a wall, as a fisheye lens sees it from somewhere: bent, blurred, noisy."""
    if picture.shape != (900, 900):
        picture = cv2.resize(picture, (900, 900))
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    focal = rng.uniform(180, 420)
    across = np.stack([x - SIZE[0] / 2, y - SIZE[1] / 2], axis=-1) / focal
    radius = np.linalg.norm(across, axis=-1)
    angle = np.minimum(2 * np.arcsin(np.minimum(radius / 2, 0.66)), 1.35)
    scale = np.tan(angle) / np.maximum(radius, 1e-9)
    ray = np.concatenate([across * scale[..., None], np.ones((*x.shape, 1))], axis=-1)
    turn = cv2.Rodrigues(rng.normal(0, [0.25, 0.25, 0.8]))[0]
    ray = ray @ turn.T
    place = ray[..., :2] / np.maximum(ray[..., 2:], 0.05) * rng.uniform(120, 420)
    place = (place + rng.uniform(300, 600, 2)).astype(np.float32)
    photo = cv2.remap(
        picture.astype(np.float32),
        place[..., 0],
        place[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    photo = cv2.GaussianBlur(photo, (0, 0), rng.uniform(0.5, 1.1))
    photo = photo * rng.uniform(0.4, 1.0) + rng.normal(0, rng.uniform(0.5, 5), photo.shape)
    return np.clip(np.rint(photo), 0, 255).astype(np.uint8)


def main() -> None:
    """Draw, find, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--save", type=Path, help="folder for pictures in which a grid was found")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    pictures = dict.fromkeys((kind.__name__ for kind in KINDS), 0)
    wrong: dict[str, list[list[int]]] = {name: [] for name in pictures}
    start = time.process_time()
    for number in range(arguments.count):
        kind = KINDS[number % len(KINDS)]
        rng = np.random.default_rng((arguments.seed, number))
        photo = photographed(kind(rng), rng)
        pictures[kind.__name__] += 1
        grids = find_grids(photo).grids
        if grids:
            wrong[kind.__name__].append([number, *(len(grid) for grid in grids)])
            print(f"picture {number}, {kind.__name__}: {wrong[kind.__name__][-1][1:]}", flush=True)
            if arguments.save:
                arguments.save.mkdir(parents=True, exist_ok=True)
                seen = cv2.cvtColor(photo, cv2.COLOR_GRAY2BGR)
                for grid in grids:
                    for x, y in grid.pixel:
                        cv2.circle(seen, (round(x), round(y)), 3, (0, 0, 255), 1)
                cv2.imwrite(str(arguments.save / f"{number:04d}_{kind.__name__}.png"), seen)
        if (number + 1) % EVERY == 0:
            false, spent = sum(map(len, wrong.values())), time.process_time() - start
            print(f"{number + 1} pictures, {false} with a grid, {spent:.0f} s of CPU", flush=True)
    print(f"{'kind':12} pictures  with a grid  [number, corners of each grid]")
    for name, count in pictures.items():
        print(f"{name:12} {count:8d} {len(wrong[name]):12d}  {wrong[name] or ''}")
    spent = time.process_time() - start
    total = sum(len(numbers) for numbers in wrong.values())
    print(f"\n{total} of {arguments.count} pictures; {spent:.0f} s of CPU")


if __name__ == "__main__":
    main()
