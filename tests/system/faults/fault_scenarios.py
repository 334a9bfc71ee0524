"""What is run and disturbed: one scenario a way in which a command writes files."""

import hashlib
import importlib.util
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import fault_inputs
from fault_cluster import cluster
from fault_process import SCHEDULER, start_program


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A command that reads below ``in/`` and writes below ``out/`` of its working folder.

    Attributes:
        name: what tables call it.
        args: its arguments.
        prepare: fills ``in/``.
        before: fills ``out/`` with older results, which the command is told to replace.
        head: the file below ``out/`` that is there only when all others are, and are its own.
        skips: whether the rerun is told to skip what exists; else it is told to overwrite.
        prints: whether the result is what it prints, and there are no files.
        close: whether results are fits, whose last bits may differ from one process to another.
        needs: modules without which the command cannot work.

    """

    name: str
    args: tuple[str, ...]
    prepare: Callable[[Path], None]
    before: Callable[[Path], None] | None = None
    head: str | None = None
    skips: bool = False
    prints: bool = False
    close: bool = False
    needs: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command's name."""
        return " ".join(self.args[: 2 if self.args[0] == "target" else 1])

    @property
    def again(self) -> tuple[str, ...]:
        """What the rerun is told."""
        if self.prints or self.before:
            return ()
        return ("--skip-existing",) if self.skips else ("--overwrite",)

    @property
    def possible(self) -> bool:
        """Whether what it needs is installed."""
        return all(importlib.util.find_spec(module) for module in self.needs)


MODEL = ("--model", "in/calibration/camera.yaml")
OBJECT = ("--target", "in/target.yaml")
FIT = ("--no-hold-out", "--refine-target", "off")
PAGE = ("matplotlib", "jinja2")
SCENARIOS = {
    scenario.name: scenario
    for scenario in (
        Scenario(
            name="calibrate photos",
            args=("calibrate", "in/photos", *OBJECT, "-o", "out", *FIT, "--no-report",
                  "--jobs", "2"),
            prepare=fault_inputs.photos,
            head="camera.yaml",
            close=True,
        ),
        Scenario(
            name="calibrate corners",
            args=("calibrate", "in/corners.csv", *OBJECT, "-o", "out", "--no-hold-out",
                  "--refine-target", "shape", "--no-report"),
            prepare=fault_inputs.corners,
            head="camera.yaml",
            close=True,
        ),
        Scenario(
            name="calibrate, report",
            args=("calibrate", "in/corners.csv", *OBJECT, "-o", "out", *FIT),
            prepare=fault_inputs.corners,
            head="camera.yaml",
            close=True,
            needs=PAGE,
        ),
        Scenario(
            name="calibrate again",
            args=("calibrate", "in/corners.csv", *OBJECT, "-o", "out", *FIT, "--no-report",
                  "--overwrite"),
            prepare=fault_inputs.corners,
            before=fault_inputs.older_calibration,
            head="camera.yaml",
            close=True,
        ),
        Scenario(
            name="detect",
            args=("detect", "in/photos", *OBJECT, "-o", "out/corners.csv",
                  "--draw", "out/drawn", "--jobs", "2"),
            prepare=fault_inputs.two_photos,
        ),
        Scenario(
            name="detect, cluster",
            args=("detect", "in/photos", *OBJECT, "-o", "out/corners.csv",
                  "--scheduler", SCHEDULER),
            prepare=fault_inputs.two_photos,
            needs=("distributed",),
        ),
        Scenario(
            name="corners",
            args=("corners", "in/corners.vnl", *OBJECT, "--size", "480x360",
                  "-o", "out/corners.csv"),
            prepare=fault_inputs.found_elsewhere,
        ),
        Scenario(
            name="evaluate",
            args=("evaluate", "in/calibration/corners.csv", *OBJECT, *MODEL),
            prepare=fault_inputs.camera_and_corners,
            prints=True,
        ),
        Scenario(
            name="compare",
            args=("compare", "in/calibration/camera.yaml", "in/calibration/camera.yaml",
                  "--picture", "out/difference.png"),
            prepare=fault_inputs.camera,
        ),
        Scenario(
            name="report",
            args=("report", "in/calibration", *OBJECT, "-o", "out/report.html"),
            prepare=fault_inputs.camera_and_corners,
            needs=PAGE,
        ),
        Scenario(
            name="advise",
            args=("advise", "in/calibration", *OBJECT, "-o", "out/next.svg"),
            prepare=fault_inputs.camera_and_corners,
        ),
        Scenario(
            name="undistort photo",
            args=("undistort", "in/photos/corner_01.jpg", "out/flat.png", *MODEL),
            prepare=fault_inputs.camera_and_photo,
            skips=True,
        ),
        Scenario(
            name="undistort folder",
            args=("undistort", "in/photos", "out", *MODEL, "-j", "2"),
            prepare=fault_inputs.camera_and_photos,
            skips=True,
        ),
        Scenario(
            name="undistort formats",
            args=("undistort", "in/photos", "out", *MODEL, "--mask", "out/mask.png",
                  "--camera", "out/view.yaml"),
            prepare=fault_inputs.camera_and_pictures,
            skips=True,
        ),
        Scenario(
            name="undistort cubes",
            args=("undistort", "in/photos", "out", *MODEL, "--view", "cube",
                  "--size", "120x120"),
            prepare=fault_inputs.camera_and_photos,
            skips=True,
        ),
        Scenario(
            name="undistort, cluster",
            args=("undistort", "in/photos", "out", *MODEL, "--scheduler", SCHEDULER),
            prepare=fault_inputs.camera_and_photos,
            skips=True,
            needs=("distributed",),
        ),
        Scenario(
            name="undistort video",
            args=("undistort", "in/drive.mp4", "out/flat.mp4", *MODEL),
            prepare=fault_inputs.camera_and_video,
            skips=True,
            needs=("av",),
        ),
        Scenario(
            name="map npz",
            args=("map", "out/map.npz", *MODEL),
            prepare=fault_inputs.camera,
            head="map.npz",
        ),
        Scenario(
            name="map pgm",
            args=("map", "out/map.pgm", *MODEL),
            prepare=fault_inputs.camera,
            head="map_x.pgm",
        ),
        Scenario(
            name="map png",
            args=("map", "out/map.png", *MODEL, "--view", "cube"),
            prepare=fault_inputs.camera,
            head="map_front_x.png",
        ),
        Scenario(
            name="map exr",
            args=("map", "out/map.exr", *MODEL),
            prepare=fault_inputs.camera,
            head="map.exr",
            needs=("OpenEXR",),
        ),
        Scenario(
            name="project",
            args=("project", "in/points.csv", *MODEL),
            prepare=fault_inputs.points,
            prints=True,
        ),
        Scenario(
            name="unproject",
            args=("unproject", "in/pixels.csv", *MODEL),
            prepare=fault_inputs.points,
            prints=True,
        ),
        Scenario(
            name="export opencv",
            args=("export", *MODEL, "--to", "opencv", "--max-error", "50", "-o", "out/cv.yaml"),
            prepare=fault_inputs.camera,
        ),
        Scenario(
            name="export mrcal",
            args=("export", *MODEL, "--to", "mrcal", "--max-error", "50",
                  "-o", "out/lens.cameramodel"),
            prepare=fault_inputs.camera,
        ),
        Scenario(
            name="export maps",
            args=("export", *MODEL, "--to", "maps", "-o", "out/map.npz"),
            prepare=fault_inputs.camera,
        ),
        Scenario(
            name="import kalibr",
            args=("import", "in/camchain.yaml", "-o", "out/camera.yaml"),
            prepare=fault_inputs.foreign_camera,
        ),
        Scenario(
            name="import opencv",
            args=("import", "in/opencv.yaml", "-o", "out/camera.yaml"),
            prepare=fault_inputs.foreign_camera,
        ),
        Scenario(
            name="simulate",
            args=("simulate", *OBJECT, *MODEL, "-n", "2", "-o", "out"),
            prepare=fault_inputs.camera_and_corners,
            head="photo_01.jpg",
        ),
        Scenario(
            name="target check",
            args=("target", "check", "in/target.yaml", "--draw", "out/object.svg"),
            prepare=fault_inputs.target,
        ),
        Scenario(
            name="target print",
            args=("target", "print", "in/target.yaml", "--paper", "A5", "-o", "out"),
            prepare=fault_inputs.board,
            needs=PAGE,
        ),
        Scenario(
            name="target print new",
            args=("target", "print", "--object", "corner", "--square", "8mm",
                  "--paper", "A5", "-o", "out"),
            prepare=fault_inputs.board,
            head="boards.pdf",
            needs=PAGE,
        ),
    )
}  # fmt: skip


def start(scenario: Scenario, folder: Path, *more: str) -> subprocess.Popen[bytes]:
    """Start the scenario's command in a session of its own."""
    return start_program([*scenario.args, *more], folder)


@contextmanager
def prepared(scenario: Scenario, folder: Path) -> Iterator[Path]:
    """Make the working folder of a scenario, and what it needs while the block runs."""
    for name in ("in", "out", "home", "cache", "tmp", "fonts"):
        (folder / name).mkdir(parents=True)
    scenario.prepare(folder / "in")
    if scenario.before is not None:
        (folder / "before").mkdir()
        scenario.before(folder / "before")
    shutil.rmtree(folder / "cache")
    with cluster(folder) if SCHEDULER in scenario.args else nullcontext():
        yield folder


def clear(folder: Path) -> None:
    """Take away what a run has left, but not its inputs."""
    for name in ("out", "cache", "tmp", "home"):
        shutil.rmtree(folder / name, ignore_errors=True)
    for name in ("out", "tmp", "home"):
        (folder / name).mkdir()
    put_back(folder)


def put_back(folder: Path) -> None:
    """Put the older results where they were."""
    if (folder / "before").exists():
        shutil.copytree(folder / "before", folder / "out", dirs_exist_ok=True)


def contents(folder: Path) -> dict[str, str]:
    """Path below ``folder`` -> SHA-256, of every file."""
    found = {}
    for path in sorted(folder.rglob("*")):
        try:
            if path.is_file():
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                found[str(path.relative_to(folder))] = digest
        except FileNotFoundError:  # a temporary file of a worker that goes on
            continue
    return found


_TEMPORARY = re.compile(r"\..*\.part(\.[^.]*)?")


def is_temporary(name: str) -> bool:
    """Whether a file's name says that it is not finished."""
    return _TEMPORARY.fullmatch(Path(name).name) is not None


def finished(files: dict[str, str]) -> dict[str, str]:
    """Those of the files that have a final name."""
    return {name: digest for name, digest in files.items() if not is_temporary(name)}
