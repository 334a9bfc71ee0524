"""What an installed program is asked to do, one command after the other, and what each may write.

Paths are relative to the folder that the commands run in; ``{sample}`` is the project's folder
``sample_data``.
"""

from __future__ import annotations

import csv
import fnmatch
import hashlib
import os
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

CACHE = ".cache/cubicfish"

Files = Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Step:
    """One command.

    Attributes:
        args: its arguments.
        writes: patterns of what it writes; each is of at least one file.
        input: what it reads from stdin.
        extra: the extra without which it cannot work.
        code: its exit code.

    """

    args: tuple[str, ...]
    writes: tuple[str, ...] = ()
    input: str = ""
    extra: str | None = None
    code: int = 0

    @property
    def name(self) -> str:
        """What tables call it."""
        return " ".join(self.args).replace("{sample}/", "")


def _step(line: str, *writes: str, input: str = "", extra: str | None = None) -> Step:
    return Step(args=tuple(line.split()), writes=writes, input=input, extra=extra)


# As the reference of the command line has them, which is made from the commands.
_REFERENCE = (Path(__file__).parents[3] / "docs" / "cli.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^## cubicfish (.+)$", _REFERENCE, re.MULTILINE)
_NARROW, _EXACT = ("--max-error 10 --max-angle 60", ""), ("", "")
FORMATS = {
    "opencv": _NARROW, "ros": _NARROW, "kalibr-pinhole-equi": _NARROW, "kalibr-omni": _NARROW,
    "kalibr-ds": _NARROW, "ocamcalib": _NARROW,
    "colmap": _NARROW, "colmap-rad-tan-thin-prism-fisheye": _NARROW, "nerfstudio": _NARROW,
    "gyroflow": _NARROW, "anipose": _NARROW, "anipose-pinhole": _NARROW,
    "mrcal": ("--max-error 10", ""), "maps": ("", ".npz"),
    "c": _EXACT, "python": _EXACT, "js": _EXACT, "glsl": _EXACT, "osl": _EXACT,
}  # fmt: skip

_CALIBRATION = tuple(f"calibration/{name}" for name in ("camera.yaml", "undistort_map.npz"))
_FIT = "--target {sample}/target.yaml --no-hold-out --refine-target off"

HELP = (
    _step("--version"),
    _step("--help"),
    *(_step(f"{command} --help") for command in COMMANDS),
)

QUICK = (
    _step(f"calibrate {{sample}}/true_corners.csv {_FIT} --no-report", *_CALIBRATION,
          "calibration/corners.csv"),
    _step("evaluate calibration/corners.csv --target {sample}/target.yaml"),
    _step("undistort {sample}/photos/corner_01.jpg flat.png --mask mask.png",
          "flat.png", "mask.png"),
    _step("map map.npz", "map.npz", "map.view.yaml"),
    _step("transform --scale 0.5 -o half.yaml", "half.yaml"),
    _step("export --to mrcal -o camera.cameramodel", "camera.cameramodel"),
    _step("export --to js --name left", "left.mjs"),
    _step("import camera.cameramodel -o imported.yaml", "imported.yaml"),
    _step("compare calibration/camera.yaml imported.yaml --picture off.png", "off.png"),
    _step("target check {sample}/target.yaml --draw object.svg", "object.svg",
          extra="report"),
    _step("advise calibration -o advice.svg", "advice.svg", extra="report"),
    _step("simulate --target {sample}/target.yaml -n 1 -o simulated",
          "simulated/photo_*", "simulated/true_*"),
    _step("detect simulated/ --target {sample}/target.yaml -o found.csv --draw seen",
          "found.csv", "seen/*.png"),
    _step("project", input="0,0,100\n"),
    _step("unproject", input="480,360\n"),
    _step("report calibration", "calibration/report.html", extra="report"),
    _step("target print --object corner --paper A4 -o boards",
          "boards/*.pdf", "boards/target.yaml", extra="report"),
)  # fmt: skip
"""A chain of commands in which each reads what others wrote."""

MORE = (
    _step(f"calibrate {{sample}}/photos {_FIT} -o again --no-report", "again/*"),
    _step(f"calibrate {{sample}}/photos {_FIT} -o paged", "paged/*", extra="report"),
    _step(f"calibrate {{sample}}/photos {_FIT} -o third --no-cache --no-report", "third/*"),
    _step("detect {sample}/photos --target {sample}/target.yaml -o corners.csv", "corners.csv"),
    _step("calibrate corners.csv --target {sample}/target.yaml -o judged --compare --no-report",
          "judged/*"),
    _step(f"calibrate corners.csv {_FIT} -o lifted --lift point --no-report", "lifted/*"),
    _step("corners table.csv --target {sample}/target.yaml --board floor --size 960x720 "
          "-o taken.csv", "taken.csv"),
    _step("undistort {sample}/photos many -j 2", "many/corner_*.jpg"),
    _step("undistort {sample}/photos/corner_01.jpg floor.png --view plane:floor "
          "--target {sample}/target.yaml", "floor.png"),
    _step("map stmap.exr", "stmap.exr", "stmap.view*.yaml", extra="exr"),
    _step("map pair.pgm", "pair*.pgm", "pair.view*.yaml"),
    _step("map pair16.png", "pair16*.png", "pair16.view*.yaml"),
    _step("undistort drive.avi flat.mp4", "flat.mp4", extra="video"),
    *(_step(f"export --to {name} {more} -o exported/{name}{suffix}",
            f"exported/{name}*") for name, (more, suffix) in FORMATS.items()),
    _step("target print {sample}/target.yaml --paper A3 -o pages", "pages/*.pdf", extra="report"),
    _step("target print --object board --type charuco -o charuco",
          "charuco/*.pdf", "charuco/target.yaml", extra="report"),
)  # fmt: skip
"""What takes longer; what :func:`prepare` makes is there already."""

_VIDEO = """
import cv2, sys
to, *photos = sys.argv[1:]
video = None
for photo in photos:
    picture = cv2.imread(photo)
    if video is None:
        size = picture.shape[1::-1]
        video = cv2.VideoWriter(to, cv2.VideoWriter.fourcc(*"MJPG"), 5, size)
    video.write(picture)
video.release()
"""


def prepare(work: Path, python: Path, sample: Path) -> None:
    """Make the files that :data:`MORE` reads and no command writes.

    Args:
        work: where.
        python: one that has cv2.
        sample: the project's folder ``sample_data``.

    """
    photos = sorted((sample / "photos").iterdir())
    subprocess.run([python, "-c", _VIDEO, work / "drive.avi", *photos], check=True)
    with (sample / "true_corners.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    columns = 1 + max(int(row["column"]) for row in rows if row["board"] == "floor")
    with (work / "table.csv").open("w", encoding="utf-8") as file:
        file.write("image,corner_id,x,y\n")
        for row in rows:
            if row["board"] == "floor":
                corner = int(row["row"]) * columns + int(row["column"])
                file.write(f"{row['image']},{corner},{row['x']},{row['y']}\n")


@dataclass(frozen=True, kw_only=True)
class Sandbox:
    """A home, a folder for temporary files and one to work in, all below one folder.

    Attributes:
        base: that folder, made if need be.
        free: patterns, below the base, of what need not be looked at.

    """

    base: Path
    free: tuple[str, ...] = field(default=())

    def make(self) -> Sandbox:
        """Make the folders."""
        for folder in ("home", "tmp", "work"):
            (self.base / folder).mkdir(parents=True, exist_ok=True)
        return self

    @property
    def work(self) -> Path:
        """Where commands run."""
        return self.base / "work"

    def environment(self, **more: str) -> dict[str, str]:
        """The environment of a program that knows nothing else."""
        return {
            "PATH": os.defpath,
            "LANG": "C.UTF-8",
            "HOME": str(self.base / "home"),
            "TMPDIR": str(self.base / "tmp"),
            "OMP_NUM_THREADS": "1",
            **more,
        }

    def files(self) -> Files:
        """Every file and folder below the base, with what is in it."""
        found = {}
        for path in sorted(self.base.rglob("*")):
            name = path.relative_to(self.base).as_posix()
            if any(fnmatch.fnmatch(name, pattern) for pattern in self.free):
                continue
            if path.is_dir() and not path.is_symlink():
                found[name + "/"] = ""
            elif path.is_file():
                found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
            else:
                found[name] = "no file"
        return found


def wrongly_written(
    step: Step, before: Files, after: Files, *, cache: bool | None = None
) -> list[str]:
    """What a command wrote that it should not have written, and what it did not write.

    Args:
        step: the command.
        before: the sandbox's files before.
        after: and after.
        cache: whether it may write into the user's cache; by default unless told --no-cache.

    """
    if cache is None:
        cache = "--no-cache" not in step.args
    wanted = [f"work/{pattern}" for pattern in step.writes]
    allowed = [*wanted, *_folders_of(wanted)]
    if cache:
        allowed += ["home/.cache/", f"home/{CACHE}/", f"home/{CACHE}/*"]
    changed = [name for name in after if after[name] != before.get(name)]
    wrong = [f"{name} was written" for name in changed if not _matches(name, allowed)]
    wrong += [f"{name} is gone" for name in before if name not in after]
    wrong += [
        f"{pattern} was not written" for pattern in wanted if not fnmatch.filter(changed, pattern)
    ]
    return wrong


def _folders_of(patterns: Sequence[str]) -> list[str]:
    return [f"{parent}/" for pattern in patterns for parent in map(str, Path(pattern).parents)]


def _matches(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatch.fnmatch(name, pattern) for pattern in patterns)
