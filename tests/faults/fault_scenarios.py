"""What is run and disturbed: one scenario a way in which a command writes files."""

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

PROJECT = Path(__file__).parents[2]
SAMPLE = PROJECT / "sample_data"
PROGRAM = (str(Path(sys.executable).with_name("cubicfish")),)
# A command that takes longer than this hangs.
LONGEST_S = 300.0


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A command that reads below ``in/`` and writes below ``out/`` of its working folder.

    Attributes:
        name: what tables call it.
        args: its arguments.
        prepare: fills ``in/``.
        skips: whether the rerun is told to skip what exists; else it is told to overwrite.

    """

    name: str
    args: tuple[str, ...]
    prepare: Callable[[Path], None]
    skips: bool = False


def _photos(folder: Path, count: int = 4) -> None:
    (folder / "photos").mkdir(parents=True)
    for path in sorted((SAMPLE / "photos").iterdir())[:count]:
        shutil.copy(path, folder / "photos")
    shutil.copy(SAMPLE / "target.yaml", folder)


def _corners(folder: Path) -> None:
    shutil.copy(SAMPLE / "target.yaml", folder)
    shutil.copy(SAMPLE / "true_corners.csv", folder / "corners.csv")


def _camera(folder: Path) -> None:
    made = subprocess.run(
        [*PROGRAM, "calibrate", SAMPLE / "true_corners.csv", "--target", SAMPLE / "target.yaml",
         "--no-hold-out", "--refine-target", "off", "-o", folder / "calibration"],
        env=environment(folder.parent), capture_output=True, check=True,
    )  # fmt: skip
    assert not made.stderr.count(b"Traceback")


def _camera_and_photos(folder: Path) -> None:
    _camera(folder)
    _photos(folder, 6)


def _camera_and_pictures(folder: Path) -> None:
    """Formats that are written in different ways: 16 bits, transparency, TIFF."""
    _camera(folder)
    (folder / "photos").mkdir()
    grey = cv2.imread(str(next(iter(sorted((SAMPLE / "photos").iterdir())))), cv2.IMREAD_GRAYSCALE)
    colour = np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    for name, picture in (
        ("deep.png", grey.astype(np.uint16) * 257),
        ("see-through.png", colour),
        ("grey.tif", grey),
        ("grey.webp", colour[..., :3]),
    ):
        assert cv2.imwrite(str(folder / "photos" / name), picture)


MODEL = ("--model", "in/calibration/camera.yaml")
SCENARIOS = {
    scenario.name: scenario
    for scenario in (
        Scenario(
            name="calibrate photos",
            args=("calibrate", "in/photos", "--target", "in/target.yaml", "-o", "out",
                  "--no-hold-out", "--refine-target", "off"),
            prepare=_photos,
        ),
        Scenario(
            name="calibrate corners",
            args=("calibrate", "in/corners.csv", "--target", "in/target.yaml", "-o", "out",
                  "--no-hold-out", "--refine-target", "shape"),
            prepare=_corners,
        ),
        Scenario(
            name="detect",
            args=("detect", "in/photos", "--target", "in/target.yaml", "-o", "out/corners.csv",
                  "--draw", "out/drawn", "--jobs", "2"),
            prepare=_photos,
        ),
        Scenario(
            name="undistort photo",
            args=("undistort", "in/photos/corner_01.jpg", "out/flat.png", *MODEL),
            prepare=_camera_and_photos,
            skips=True,
        ),
        Scenario(
            name="undistort folder",
            args=("undistort", "in/photos", "out", *MODEL, "-j", "2"),
            prepare=_camera_and_photos,
            skips=True,
        ),
        Scenario(
            name="undistort formats",
            args=("undistort", "in/photos", "out", *MODEL, "--mask", "out/mask.png"),
            prepare=_camera_and_pictures,
            skips=True,
        ),
        Scenario(
            name="map npz", args=("map", "out/map.npz", *MODEL), prepare=_camera
        ),
        Scenario(
            name="map pgm", args=("map", "out/map.pgm", *MODEL), prepare=_camera
        ),
        Scenario(
            name="compare",
            args=("compare", "in/calibration/camera.yaml", "in/calibration/camera.yaml",
                  "--picture", "out/difference.png"),
            prepare=_camera,
        ),
        Scenario(
            name="target check",
            args=("target", "check", "in/target.yaml", "--draw", "out/object.svg"),
            prepare=_corners,
        ),
    )
}  # fmt: skip


def environment(folder: Path) -> dict[str, str]:
    """A user's environment of which nothing lies outside ``folder``."""
    return {
        **{key: value for key, value in os.environ.items() if not key.startswith("CUBICFISH_")},
        "HOME": str(folder / "home"),
        "XDG_CACHE_HOME": str(folder / "cache"),
        "TMPDIR": str(folder / "tmp"),
        "SOURCE_DATE_EPOCH": "1700000000",
        "OMP_NUM_THREADS": "1",
    }


def start(scenario: Scenario, folder: Path, *more: str) -> subprocess.Popen[bytes]:
    """Start the scenario's command in a session of its own."""
    with (folder / "said.txt").open("wb") as said:
        return subprocess.Popen(
            [*PROGRAM, *scenario.args, *more],
            cwd=folder,
            env=environment(folder),
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            start_new_session=True,
        )


def prepare(scenario: Scenario, folder: Path) -> None:
    """Make the working folder of a scenario."""
    for name in ("in", "out", "home", "cache", "tmp"):
        (folder / name).mkdir(parents=True)
    scenario.prepare(folder / "in")
    shutil.rmtree(folder / "cache")


def clear(folder: Path) -> None:
    """Take away what a run has left, but not its inputs."""
    for name in ("out", "cache", "tmp", "home"):
        shutil.rmtree(folder / name, ignore_errors=True)
    for name in ("out", "tmp", "home"):
        (folder / name).mkdir()


def contents(folder: Path) -> dict[str, str]:
    """Path below ``folder`` -> SHA-256, of every file."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def finished(files: dict[str, str]) -> dict[str, str]:
    """Those of the files that have a final name."""
    return {name: digest for name, digest in files.items() if ".part" not in name}
