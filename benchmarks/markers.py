"""Recall of marked boards by angle from the axis: ``python benchmarks/markers.py``.

Renders photos from inside a box of five ChArUco or AprilGrid walls with a lens of 196 degrees, and
compares OpenCV's own detectors with this project's. A found corner counts when it is within 1.5 px
of the truth; seconds are of one processor, for all that is done with a photo once it is decoded.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from asymmetric_lens import AsymmetricLens
from looking import look_at
from synthetic import Pose, TrueCorners

from cubicfish import Target, detect
from cubicfish.models import angle_from_axis
from cubicfish.scene import Look, Scene

LENS = AsymmetricLens(
    image_size=(1280, 1280),
    fx=372.0,
    fy=372.6,
    cx=644.3,
    cy=633.8,
    k=(-0.021, -0.0042, 0.0011, -0.00012),
    p=(0.00045, -0.0006),
    tilt=(0.0016, -0.0011),
    max_angle_deg=98.0,
)
BINS = np.array([0, 30, 60, 70, 75, 80, 84, 87, 90, 95])
GOOD_PX = 1.5
# Wall -> directions away from the camera, of growing column and of growing row.
WALLS = {
    "front": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "left": ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "right": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "top": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "bottom": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
}
BOX = 600.0
POSES = (
    look_at((10, 20, -60), (60, 40, 300), up=(0.1, -0.9, 0.3), roll=0.2),
    look_at((-60, -80, 40), (200, 80, 300), up=(0.1, -0.9, 0.3), roll=1.0),
    look_at((90, -30, -150), (-300, 250, 200), up=(0.1, -0.9, 0.3), roll=-0.6),
    look_at((0, 60, 30), (20, 300, 120), up=(0.1, -0.9, 0.3), roll=2.4),
)


class Named(NamedTuple):
    """Corners as a detector names them."""

    board: np.ndarray
    column: np.ndarray
    row: np.ndarray
    pixel: np.ndarray


def box(kind: str, count: int, side: float, marker: float = 0.75) -> Target:
    """Five walls with ``count`` x ``count`` corners (tags) each."""
    boards = []
    for number, (name, axes) in enumerate(WALLS.items()):
        inward, x, y = (np.array(axis, float) for axis in axes)
        if kind == "charuco":
            each, extent = (count + 1) ** 2 // 2, (count - 1) * side
            own = {"corners": [count] * 2, "square": side, "marker": marker * side}
            own |= {"dictionary": "DICT_5X5_1000"}
        else:
            each, spacing = count**2, 0.3
            extent = side * (count + (count - 1) * spacing)
            own = {"tags": [count] * 2, "tag": side, "spacing": spacing, "family": "tag36h11"}
        origin = (BOX * inward - extent * (x + y)) / 2
        place = {"origin": origin.tolist(), "x_axis": x.tolist(), "y_axis": y.tolist()}
        own |= {"name": name, "type": kind, "first_marker": number * each, **place}
        boards.append(own)
    return Target.from_data({"units": "mm", "boards": boards})


TARGETS = {
    "ChArUco, 12x12 corners a wall": box("charuco", 12, 42.0),
    "ChArUco, 16x16 corners a wall": box("charuco", 16, 31.0, marker=0.7),
    "AprilGrid, 6x6 tags a wall": box("aprilgrid", 6, 70.0),
    "AprilGrid, 8x8 tags a wall": box("aprilgrid", 8, 52.0),
}


def opencv_charuco(photo: np.ndarray, target: Target) -> Named:
    """cv2.aruco.CharucoDetector, one after the other board."""
    parts = []
    for index, board in enumerate(target.boards):
        assert board.markers is not None
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.markers.dictionary))
        layout = cv2.aruco.CharucoBoard(
            (board.columns + 1, board.rows + 1),
            board.square,
            board.markers.side,
            dictionary,
            board.marker_cells()[:, 0].astype(np.int32),
        )
        corners, ids, _, _ = cv2.aruco.CharucoDetector(layout).detectBoard(photo)
        if ids is not None:
            row, column = np.divmod(np.asarray(ids).ravel(), board.columns)
            pixel = np.asarray(corners, float).reshape(-1, 2)
            parts.append((np.full(len(row), index), column, row, pixel))
    return Named(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def opencv_tags(photo: np.ndarray, target: Target) -> Named:
    """cv2.aruco.ArucoDetector with sub-pixel corners, told Kalibr's frame of two modules."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = 2
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(photo)
    places = {
        int(number): (index, column, row)
        for index, board in enumerate(target.boards)
        for number, column, row in board.marker_cells()
    }
    known = [number for number in np.asarray(ids).ravel().tolist() if number in places]
    place = np.array([places[number] for number in known])
    chosen = np.isin(np.asarray(ids).ravel(), known)
    # OpenCV's tags are upside down against Kalibr's.
    pixel = np.asarray(corners, float).reshape(-1, 4, 2)[chosen][:, [2, 3, 0, 1]]
    column = 2 * place[:, 1, None] + [0, 1, 1, 0]
    row = 2 * place[:, 2, None] + [0, 0, 1, 1]
    return Named(np.repeat(place[:, 0], 4), column.ravel(), row.ravel(), pixel.reshape(-1, 2))


def score(seen: TrueCorners, named: Named) -> tuple[np.ndarray, np.ndarray]:
    """Which of the target's corners were found, and all distances from the truth."""
    place = {key: i for i, key in enumerate(zip(seen.board, seen.column, seen.row, strict=True))}
    index = [place[key] for key in zip(named.board, named.column, named.row, strict=True)]
    error = np.nan_to_num(np.hypot(*(named.pixel - seen.pixel[index]).T), nan=np.inf)
    found = np.zeros(len(seen.board), bool)
    found[np.array(index)[error < GOOD_PX]] = True
    return found, error


def own_corners(photo: np.ndarray, target: Target) -> Named:
    """What this project names at first sight."""
    found = detect([photo], target, again=False).corners
    return Named(found.board, found.column, found.row, found.pixel)


def timed(find: Callable[..., Any], *arguments: object) -> tuple[Any, float]:
    """A call's result and the processor seconds that it took."""
    start = time.process_time()
    result = find(*arguments)
    return result, time.process_time() - start


def measure(target: Target, poses: tuple[Pose, ...]) -> dict[str, list]:
    """Per way of finding: a list of (found, error, seconds, true corners)."""
    rows: dict[str, list] = {}
    scene = Scene(target=target, lens=LENS, image_size=LENS.image_size)
    for seed, pose in enumerate(poses):
        photo = scene.photo(pose, Look(blur=0.6), number=seed)
        seen = scene.corners(pose, neighbourhood=0.3)
        charuco = target.boards[0].kind == "charuco"
        theirs, seconds = timed(opencv_charuco if charuco else opencv_tags, photo, target)
        ours, own_seconds = timed(own_corners, photo, target)
        name = "cv2 CharucoDetector" if charuco else "cv2 ArucoDetector"
        for label, named, spent in (
            (name, theirs, seconds),
            ("all named corners", ours, own_seconds),
        ):
            rows.setdefault(label, []).append((*score(seen, named), spent, seen))
        print(f"  photo {seed + 1}: {len(ours.pixel)} corners", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photos", type=int, default=len(POSES), help="photos of each target")
    poses = POSES[: parser.parse_args().photos]
    cv2.setNumThreads(1)
    head = "".join(f"{low}-{high}°".rjust(7) for low, high in pairwise(BINS))
    for title, target in TARGETS.items():
        print(title)
        rows = measure(target, poses)
        print(f"  {'recall by angle':<24}{head}     all  RMS px  >1.5 px  s/photo")
        for label, photos in rows.items():
            points = np.concatenate([seen.camera for *_, seen in photos])
            angle = np.degrees(angle_from_axis(points))
            visible = np.concatenate([seen.visible for *_, seen in photos])
            found = np.concatenate([part[0] for part in photos]) & visible
            error = np.concatenate([part[1] for part in photos])
            hit, there = (np.histogram(angle[x], BINS)[0] for x in (found, visible))
            good = error[error < GOOD_PX]
            recall = "".join(f"{value:7.3f}" for value in hit / np.maximum(there, 1))
            print(
                f"  {label:<24}{recall}{found.sum() / visible.sum():8.3f}"
                f"{np.sqrt(np.mean(good**2)):8.3f}{(error >= GOOD_PX).sum():9d}"
                f"{np.mean([part[2] for part in photos]):9.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
