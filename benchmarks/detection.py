"""Corner finders side by side: this one and OpenCV's, on the same photos in one run.

    python benchmarks/detection.py                       # rendered photos, exact truth
    python benchmarks/detection.py DATA --board 14x14    # DATA/images, DATA/reference_corners.csv
    python benchmarks/detection.py --times [DATA]        # CPU seconds per megapixel, by size

Each finder gets every photo once. OpenCV's are repeated on the photo with the found board painted
over, until nothing more is found, since they return one board. A reference corner counts as found
when a corner lies within 1 px of it. A found corner without one within 3 px counts as extra: on
rendered photos that is a false corner, on real ones it may be one that the reference missed.

``--times`` takes the photos above, one of the sample photos at several sizes, and texture of every
scale with one board in it from 1 to 108 megapixels; each finder is given MOST_SECONDS a photo and
asked for one board, with one thread. Of ours it also says how many patches grow per board found.
"""

import argparse
import csv
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from asymmetric_lens import AsymmetricLens
from looking import look_at
from synthetic import checkerboard

from cubicfish import Target
from cubicfish.find import find_grids
from cubicfish.find.detection import finder
from cubicfish.scene import Scene

NEAR, FAR = 1.0, 3.0
# Image, corners that must be found, all corners that may be found.
Photo = tuple[np.ndarray, np.ndarray, np.ndarray]
MOST_BOARDS = 6
MOST_SECONDS = 120
# Width, height, side of the board's squares, px.
SCALED = (0.3, 1.0, 2.0, 8.0, 12.0, 24.0)  # megapixels
SAMPLE = Path(__file__).resolve().parents[1] / "sample_data" / "photos" / "corner_01.jpg"
TEXTURES = (
    (1152, 864, 20),
    (2000, 1500, 30),
    (4000, 3000, 60),
    (4000, 3000, 20),
    (12000, 9000, 180),
)


def ours(image: np.ndarray, board: tuple[int, int]) -> np.ndarray:
    grids = find_grids(image, [board]).grids
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
        checkerboard(name, n, n, square, origin, x_axis, y_axis)
        for name, origin, x_axis, y_axis in axes
    )
    target = Target(units="mm", boards=boards)
    for focal in (120, 250):
        size = (round(focal * 3.4),) * 2
        lens = AsymmetricLens(
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
            scene = Scene(target=target, lens=lens, image_size=size)
            truth, image = scene.corners(pose), scene.photo(pose, number=k)
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


def textured(width: int, height: int, square: float) -> np.ndarray:
    """Clouds of every scale down to the pixel, before them a board of 11x8 inner corners."""
    rng = np.random.default_rng(0)
    total = np.zeros((height, width), np.float32)
    side = 4
    while side < width:
        cloud = rng.normal(size=(max(2, side * height // width), side)).astype(np.float32)
        total += cv2.resize(cloud, (width, height), interpolation=cv2.INTER_CUBIC)
        side *= 2
    total *= 45 / total.std()
    cell = 40
    drawn = np.full((11 * cell, 14 * cell), 225, np.float32)
    for row in range(9):
        for column in range(row % 2, 12, 2):
            y, x = (row + 1) * cell, (column + 1) * cell
            drawn[y : y + cell, x : x + cell] = 25
    c, s = np.cos(0.4) * square / cell, np.sin(0.4) * square / cell
    move = np.array([[c, -s, 0.3 * width], [s, c, 0.25 * height], [1e-4, -5e-5, 1]])
    paper = cv2.warpPerspective(np.ones_like(drawn), move, (width, height))
    board = cv2.warpPerspective(drawn, move, (width, height))
    picture = cv2.GaussianBlur(np.where(paper > 0.5, board, 120 + total), (0, 0), 0.8)
    picture += rng.normal(0, 2, picture.shape).astype(np.float32)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def scaled(megapixels: float) -> np.ndarray:
    """A sample photo of so many pixels, as sharp for its size, with noise of 2 grey levels."""
    photo = cv2.imread(str(SAMPLE), cv2.IMREAD_GRAYSCALE)
    zoom = (megapixels * 1e6 / photo.size) ** 0.5
    how = cv2.INTER_AREA if zoom < 1 else cv2.INTER_CUBIC
    large = cv2.resize(photo, None, fx=zoom, fy=zoom, interpolation=how).astype(np.float32)
    large += np.random.default_rng(0).normal(0, 2, large.shape).astype(np.float32)
    return np.clip(np.rint(large), 0, 255).astype(np.uint8)


def count_patches(images: list[np.ndarray], board: tuple[int, int]) -> tuple[int, int]:
    """How many patches grow in some photos, and how many of them become boards."""
    search, results = finder.search, []
    finder.search = lambda *seen: results.append(search(*seen)) or results[-1]
    try:
        for image in images:
            find_grids(image, [board])
    finally:
        finder.search = search
    boards = sum(len(one.grids) for one in results)
    return sum(one.grown for one in results), boards


def sectors_whole(image: np.ndarray, board: tuple[int, int]) -> np.ndarray | None:
    return cv2.findChessboardCornersSB(image, board, flags=cv2.CALIB_CB_ACCURACY)[1]


def classic_whole(image: np.ndarray, board: tuple[int, int]) -> np.ndarray | None:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    return cv2.findChessboardCorners(image, board, flags=flags)[1]


def charuco(image: np.ndarray, board: tuple[int, int]) -> np.ndarray | None:
    layout = cv2.aruco.CharucoBoard(
        (board[0] + 1, board[1] + 1),
        1.0,
        0.8,
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250),
    )
    return cv2.aruco.CharucoDetector(layout).detectBoard(image)[0]


TIMED = {
    "cubicfish": ours,
    "SB": sectors_whole,
    "classic": classic_whole,
    "Charuco": charuco,
}


def spent(name: str, image: np.ndarray, board: tuple[int, int]) -> tuple[float, int] | None:
    """CPU seconds and corners of one finder on one photo; None where it was stopped."""
    ours_end, its_end = multiprocessing.Pipe(duplex=False)
    worker = multiprocessing.Process(target=_send, args=(its_end, name, image, board))
    worker.start()
    answer = ours_end.recv() if ours_end.poll(MOST_SECONDS) else None
    worker.kill()
    worker.join()
    return answer


def _send(end, name: str, image: np.ndarray, board: tuple[int, int]) -> None:
    cv2.setNumThreads(1)
    TIMED[name](image[:200, :200], board)  # what only the first call takes
    start = time.process_time()
    corners = TIMED[name](image, board)
    end.send((time.process_time() - start, 0 if corners is None else corners.size // 2))


def times(photos: list[Photo], board: tuple[int, int]) -> None:
    print("CPU seconds per megapixel (corners found)")
    print(f"{'':34}" + "".join(f"{name:>18}" for name in TIMED))
    rows = [("photos", [photo[0] for photo in photos], board)]
    sample = Target.load(SAMPLE.parents[1] / "target.yaml").boards[0]
    for size in SCALED:
        rows.append(("a sample photo", [scaled(size)], (sample.columns, sample.rows)))
    for width, height, square in TEXTURES:
        label = f"texture, squares of {square} px"
        rows.append((label, [textured(width, height, square)], (11, 8)))
    for label, images, inner in rows:
        megapixels = sum(image.size for image in images) / 1e6
        line = f"{label:24} {megapixels / len(images):5.1f} Mpx"
        for name in TIMED:
            answers = [spent(name, image, inner) for image in images]
            if None in answers:
                line += f"{f'over {MOST_SECONDS} s':>18}"
            else:
                cost = sum(answer[0] for answer in answers) / megapixels
                line += f"{f'{cost:.3f} ({sum(answer[1] for answer in answers)})':>18}"
        grown, boards = count_patches(images, inner)
        print(f"{line}   {grown} patches, {boards} boards", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("data", nargs="?", type=Path, help="folder with images and a reference")
    parser.add_argument("--board", default="14x14", help="inner corners, for the classic finder")
    parser.add_argument("--times", action="store_true", help="how long each takes")
    arguments = parser.parse_args()
    columns, rows = (int(part) for part in arguments.board.split("x"))
    cv2.setNumThreads(1)
    photos = list(photographed(arguments.data) if arguments.data else rendered())
    if arguments.times:
        times(photos, (columns, rows))
        return
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
