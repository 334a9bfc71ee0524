"""``cubicfish project`` and ``unproject``: points to pixels, and back, as text, one per line."""

from __future__ import annotations

import io
import re
import sys
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish import CorrespondenceError, Run, UsageError, quoted
from cubicfish.files import StrPath, read_bytes
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import echo, print_message

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MAX_BYTES = 100_000_000
LONGEST_LINE = 10_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Points: values (N, columns), and whether the text that was read had a header."""

    values: npt.NDArray[np.float64]
    has_header: bool


# Numbers with commas between them, as a point is written on the command line.
_A_POINT = re.compile(r"[-+0-9.eE]+(,[-+0-9.eE]+)+")


class PointsCommand(parameters.Command):
    """A command whose argument may be a point that begins with a minus."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, after moving points behind the options."""
        points = [arg for arg in args if _A_POINT.fullmatch(arg)]
        if points and "--" not in args:
            args = [*(arg for arg in args if arg not in points), "--", *points]
        return super().parse_args(ctx, args)


def read_points(path: Path, columns: Sequence[str]) -> Points:
    """Read points of the named columns from a file, from stdin for ``-``, or one written out.

    Numbers are separated by commas, semicolons or blanks. A first line that is not numbers is a
    header; blank lines and lines that start with ``#`` are skipped; ``nan`` is a point that
    another step could not compute.

    Raises:
        CorrespondenceError: the file cannot be read or holds nothing, or a line does not hold
            the numbers; the text names the file and the line.

    """
    import numpy as np

    name = "stdin" if str(path) == "-" else str(path)
    if _A_POINT.fullmatch(name) and not path.exists():
        row = _read_numbers(name)
        if row is None or len(row) != len(columns):
            raise CorrespondenceError(f"{name} is no point: write {','.join(columns)}")
        return Points(values=np.array([row]), has_header=False)
    has_header = False
    numbers = array("d")
    for where, line in _read_lines(path, name):
        row = _read_numbers(line)
        if row is None and (numbers or has_header):
            raise CorrespondenceError(
                f"{where}: {quoted(line.rstrip())} does not hold numbers only"
            )
        if row is None:
            has_header = True
        elif len(row) != len(columns):
            raise CorrespondenceError(
                f"{where}: {len(row)} numbers where {len(columns)} belong: {', '.join(columns)}"
            )
        else:
            numbers.extend(row)
    if not numbers and not has_header:
        nothing = f"{name} holds no points: give {','.join(columns)} a line"
        if name != "stdin":
            raise CorrespondenceError(nothing)
        print_message(f"note: {nothing}")  # no error: a step of a pipe may have found none
    values = np.array(numbers, float).reshape(-1, len(columns))
    return Points(values=values, has_header=has_header)


def _read_lines(path: Path, name: str) -> Iterator[tuple[str, str]]:
    """Yield where each line that says something stands, and the line."""
    lines = io.TextIOWrapper(io.BytesIO(_read_bytes(path)), encoding="utf-8-sig")
    try:
        for number, line in enumerate(iter(lambda: lines.readline(LONGEST_LINE), ""), start=1):
            if len(line) == LONGEST_LINE:
                raise CorrespondenceError(f"{name}, line {number}: too long: is it the right file?")
            if line.strip() and not line.startswith("#"):
                yield f"{name}, line {number}", line
    except UnicodeDecodeError as error:
        raise CorrespondenceError(f"{name} is not UTF-8 text: is it the right file?") from error


def _read_bytes(path: Path) -> bytes:
    """Read a file, or stdin for ``-``."""
    if str(path) != "-":
        return read_bytes(path, max_bytes=MAX_BYTES, error=CorrespondenceError)
    raw = b"" if sys.stdin is None else sys.stdin.buffer.read(MAX_BYTES + 1)
    if len(raw) > MAX_BYTES:
        raise CorrespondenceError(f"stdin gave more than {MAX_BYTES / 1e6:g} MB: give it in parts")
    return raw


def _read_numbers(line: str) -> list[float] | None:
    try:
        return [float(cell) for cell in line.replace(",", " ").replace(";", " ").split()]
    except ValueError:
        return None


def print_points(points: Points, columns: Sequence[str]) -> None:
    """Print points as CSV to stdout, below a header of ``columns`` if the input had one.

    Numbers are written so that they read back exactly.
    """
    lines = [",".join(columns)] if points.has_header else []
    lines += [",".join(map(repr, row)) for row in points.values.tolist()]
    if lines:
        echo("\n".join(lines), sys.stdout)


@record
class ProjectOptions:
    """Options of :func:`project_points`.

    Attributes:
        points: a CSV file of points X,Y,Z, one point written out, or ``-`` for stdin.
        near: whether the points' distance counts.
        camera: the file or folder of the camera.

    """

    points: StrPath = parameters.argument(
        "A CSV file of points X,Y,Z, or one point such as 0.2,0.1,1. [default: stdin]",
        default=Path("-"),
    )
    near: bool = parameters.option(
        "--near",
        "How near the points are counts: they are in the units of the calibration target, and "
        "the entrance pupil wanders.",
    )
    camera: StrPath = parameters.model_options


def project_points(options: ProjectOptions, *, run: Run = Run()) -> Points:
    """Project points to pixels, (N, 2), as ``cubicfish project`` does.

    Raises:
        UsageError: the camera has no use for ``near``.
        CubicfishError: the camera or the points cannot be used.

    """
    from cubicfish import CameraFile, load_camera

    loaded = load_camera(in_folder(Path(options.camera)), any_lift=True)
    if options.near and not isinstance(loaded, CameraFile):
        raise UsageError(
            "--near is of cameras with rays: with lift 'point' points count where they are"
        )
    read = read_points(Path(options.points), ("X", "Y", "Z"))
    if isinstance(loaded, CameraFile):
        pixel = loaded.camera.project(read.values, near=options.near)
    else:
        loaded.camera.refuse_off_boards(read.values)
        pixel = loaded.camera.project(read.values)
    return replace(read, values=pixel)


@as_command(
    "project",
    "Project points in the camera frame to pixels.",
    "cubicfish project 0.2,0.1,1",
    "cubicfish project points.csv --model lens_a/",
    "echo 0.5,0,1 | cubicfish project",
    do=project_points,
    cls=PointsCommand,
)
def project(made: Points, given: ProjectOptions, how: How) -> None:
    """Project POINTS to pixels: X,Y,Z a line (a CSV file or stdin) in, x,y a line out. One
    point may stand on the command line: 0.2,0.1,1.

    Points are in the camera's frame: X to the right, Y down, Z forward, any unit. Pixel (0, 0)
    is the middle of the top-left pixel. Points count as far away unless --near is given; those
    outside the camera's valid field give nan,nan. A header in gives a header out. With a camera of
    lift 'point' the points are in its own frame (world or camera) and unit, and a point off the
    boards is refused where they did not determine the camera.
    """
    print_points(made, ("x", "y"))


@record
class UnprojectOptions:
    """Options of :func:`unproject_points`.

    Attributes:
        pixels: a CSV file of pixels x,y, one pixel written out, or ``-`` for stdin.
        camera: the file or folder of the camera.

    """

    pixels: StrPath = parameters.argument(
        "A CSV file of pixels x,y, or one pixel such as 640,400. [default: stdin]",
        default=Path("-"),
    )
    camera: StrPath = parameters.model_options


def unproject_points(options: UnprojectOptions, *, run: Run = Run()) -> Points:
    """Turn pixels into unit viewing rays, (N, 3), as ``cubicfish unproject`` does.

    Raises:
        CubicfishError: the camera or the pixels cannot be used.

    """
    from cubicfish.io import read_camera

    camera = read_camera(in_folder(Path(options.camera)))
    read = read_points(Path(options.pixels), ("x", "y"))
    return replace(read, values=camera.unproject(read.values))


@as_command(
    "unproject",
    "Unproject pixels to unit rays in the camera frame.",
    "cubicfish unproject 640,400",
    "echo 640,400 | cubicfish unproject --model lens_a/",
    do=unproject_points,
    cls=PointsCommand,
)
def unproject(made: Points, given: UnprojectOptions, how: How) -> None:
    """Turn PIXELS into viewing rays: x,y a line (a CSV file or stdin) in, X,Y,Z a line out.
    One pixel may stand on the command line: 640,400.

    Rays are unit vectors in the camera's frame: X to the right, Y down, Z forward; Z is
    negative for rays more than 90 degrees off the axis. Pixels outside the camera's valid
    field give nan,nan,nan. A header in gives a header out.
    """
    print_points(made, ("X", "Y", "Z"))
