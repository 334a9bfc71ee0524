"""Corner finders side by side: this one and OpenCV's, on the same photos in one run.

    python benchmarks/detection.py                       # rendered photos, exact truth
    python benchmarks/detection.py DATA --board 14x14    # DATA/images, DATA/reference_corners.csv

Each finder gets every photo once. OpenCV's are repeated on the photo with the found board painted
over, until nothing more is found, since they return one board. A reference corner counts as found
when a corner lies within 1 px of it. A found corner without one within 3 px counts as extra: on
rendered photos that is a false corner, on real ones it may be one that the reference missed.
"""

import argparse
import csv
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from cubicfish_cli.detection.finder import find_grids
from cubicfish_cli.rendering.lens import TrueLens
from cubicfish_cli.rendering.pose import look_at
from cubicfish_cli.rendering.render import render
from cubicfish_cli.rendering.truth import project_corners
from cubicfish_cli.target import Board, Target

NEAR, FAR = 1.0, 3.0
# Image, corners that must be found, all corners that may be found.
Photo = tuple[np.ndarray, np.ndarray, np.ndarray]
MOST_BOARDS = 6


def ours(image: np.ndarray, _: tuple[int, int]) -> np.ndarray:
    grids = find_grids(image).grids
    return np.concatenate([grid.pixel for grid in grids]) if grids else np.zeros((0, 2))


def repeated(find: Callable[[np.ndarray], np.ndarray | None], image: np.ndarray) -> np.ndarray:
    image, parts = image.copy(), []
    for _ in range(MOST_BOARDS):
        corners = find(image)
        if corners is None or len(corners) == 0:
            break
        parts.append(corners.reshape(-1, 2))
        hull = cv2.convexHull(np.rint(parts[-1]).astype(np.int32))
        cv2.fillConvexPoly(image, hull, 128)
    return np.concatenate(parts) if parts else np.zeros((0, 2))


def classic(image: np.ndarray, board: tuple[int, int]) -> np.ndarray:
    def find(picture: np.ndarray) -> np.ndarray | None:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCorners(picture, board, flags=flags)
        if not found:
            return None
        criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
        return cv2.cornerSubPix(picture, corners, (3, 3), (-1, -1), criteria)

    return repeated(find, image)


def sectors(image: np.ndarray, _: tuple[int, int]) -> np.ndarray:
    def find(picture: np.ndarray) -> np.ndarray | None:
        flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        found, corners, _ = cv2.findChessboardCornersSBWithMeta(picture, (3, 3), flags)
        return corners if found else None

    return repeated(find, image)


FINDERS = {
    "cubicfish": ours,
    "findChessboardCornersSBWithMeta 3x3 LARGER": sectors,
    "findChessboardCorners + cornerSubPix": classic,
}


def rendered() -> Iterator[Photo]:
    """Three boards at right angles under a fisheye of 190 degrees, noise 2 grey levels."""
    n, square, gap = 14, 40.0, 60.0
    far = gap + (n - 1) * square
    axes = (
        ("floor", (gap, far, 0), (1, 0, 0), (0, -1, 0)),
        ("left", (0, far, far), (0, 0, -1), (0, -1, 0)),
        ("back", (gap, 0, gap), (1, 0, 0), (0, 0, 1)),
    )
    boards = tuple(
        Board(
            name=name,
            kind="checkerboard",
            columns=n,
            rows=n,
            square=square,
            origin=np.array(origin, float),
            x_axis=np.array(x_axis, float),
            y_axis=np.array(y_axis, float),
        )
        for name, origin, x_axis, y_axis in axes
    )
    target = Target(units="mm", boards=boards)
    for focal in (120, 250):
        size = (round(focal * 3.4),) * 2
        lens = TrueLens(
            image_size=size,
            fx=focal,
            fy=focal,
            cx=size[0] / 2 + 3,
            cy=size[1] / 2 - 4,
            k=(0.02, -0.01, 0, 0),
            p=(0.001, -0.0005),
        )
        for k, (eye, aim) in enumerate(
            [((380, 400, 380), (120, 100, 120)), ((500, 300, 250), (200, 200, 100))]
        ):
            pose = look_at(eye, aim, roll=0.7 * k)
            truth = project_corners(target, lens, pose, size)
            image = render(target, lens.unproject, pose, size, seed=k)
            inside = np.isfinite(truth.pixel).all(axis=1)
            yield image, truth.pixel[truth.visible], truth.pixel[inside]


def photographed(folder: Path) -> Iterator[Photo]:
    lines = (folder / "reference_corners.csv").read_text().splitlines()
    reference: dict[str, list[tuple[float, float]]] = {}
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        reference.setdefault(row["image"], []).append((float(row["x"]), float(row["y"])))
    for name, corners in sorted(reference.items()):
        image = cv2.imread(str(folder / "images" / name), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise SystemExit(f"{folder / 'images' / name} cannot be read")
        yield image, np.array(corners), np.array(corners)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("data", nargs="?", type=Path, help="folder with images and a reference")
    parser.add_argument("--board", default="14x14", help="inner corners, for the classic finder")
    arguments = parser.parse_args()
    columns, rows = (int(part) for part in arguments.board.split("x"))
    cv2.setNumThreads(1)
    photos = list(photographed(arguments.data) if arguments.data else rendered())
    print(f"{len(photos)} photos, {sum(len(p[1]) for p in photos)} reference corners, one thread")
    print(f"{'finder':45} recall  extra  median px  95 % px  bias px  CPU s/photo")
    for name, find in FINDERS.items():
        found, total, extra, errors, seconds = 0, 0, 0, [np.zeros((0, 2))], 0.0
        for image, reference, possible in photos:
            start = time.process_time()
            corners = find(image, (columns, rows))
            seconds += time.process_time() - start
            total += len(reference)
            if not len(corners):
                continue
            apart = corners[None] - reference[:, None]
            distance = np.hypot(apart[..., 0], apart[..., 1])
            nearest = distance.argmin(1)
            hit = distance.min(1) < NEAR
            found += int(hit.sum())
            away = corners[None] - possible[:, None]
            extra += int((np.hypot(away[..., 0], away[..., 1]).min(0) > FAR).sum())
            errors.append(apart[np.arange(len(reference)), nearest][hit])
        error = np.concatenate(errors)
        length = np.hypot(*error.T) if len(error) else np.full(1, np.nan)
        bias = np.hypot(*error.mean(0)) if len(error) else np.nan
        print(
            f"{name:45} {found / total:6.3f} {extra:6d} {np.median(length):10.4f} "
            f"{np.percentile(length, 95):8.3f} {bias:8.4f} {seconds / len(photos):12.2f}"
        )


if __name__ == "__main__":
    main()
