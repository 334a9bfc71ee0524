"""What is asked of the library beside what it works on, and what files say of how they were made.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.listener import SILENT, Listener
from cubicfish_cli.core.errors import (
    MISSING,
    CameraFileError,
    CubicfishError,
    TargetError,
    UsageError,
)
from cubicfish_cli.core.units import MILLIMETRES
from cubicfish_cli.core.wording import quoted

if TYPE_CHECKING:
    from cubicfish_cli.app.executors.pool import Executor, Work
    from cubicfish_cli.app.fingerprint import Fingerprint
    from cubicfish_cli.app.photos import Photo
    from cubicfish_cli.core.target import Target


StrPath = str | os.PathLike[str]


@dataclass(frozen=True, kw_only=True)
class Run:
    """How work is done; nothing here changes what is worked out.

    Attributes:
        jobs: photos to work on at a time; None for one per processor.
        cache: a folder in which what is found in photos and frames is kept; None for nowhere.
        anew: whether nothing that an earlier run found is used.
        overwrite: whether files that exist may be replaced.
        listener: who is told how far it is.
        executor: who looks at photos instead of processes here.
        command: the command line that is run, which files say of themselves.

    """

    jobs: int | None = None
    cache: Path | None = None
    anew: bool = False
    overwrite: bool = False
    listener: Listener = SILENT
    executor: Executor | None = None
    command: str | None = None

    def __post_init__(self) -> None:
        if self.anew:
            object.__setattr__(self, "cache", None)

    def work(self, step: str) -> Work:
        """Who looks at photos in a step, which begins now."""
        from cubicfish_cli.app.executors.pool import Work

        progress = self.listener.counting(step)
        return Work(jobs=self.jobs, progress=progress, executor=self.executor)


RUN: Run = Run()
"""With all processors, silently; nothing is kept or replaced."""


@dataclass(frozen=True, kw_only=True)
class TargetSource:
    """What photos show.

    Attributes:
        path: the target's file.
        counts: inner corners (columns, rows) of one flat checkerboard in the place of a file.
        square: the side of its squares, millimetres.
        given: a target in memory in the place of both.
        told: whether nobody named the file, so that it is told which it is.

    """

    path: Path | None = None
    counts: tuple[int, int] | None = None
    square: float | None = None
    given: Target | None = None
    told: bool = False

    @classmethod
    def of(cls, target: TargetSource | Target | StrPath | None) -> TargetSource:
        """What a caller names."""
        if isinstance(target, TargetSource):
            return target
        if target is None or isinstance(target, str | os.PathLike):
            return cls(path=None if target is None else Path(target))
        return cls(given=target)

    @property
    def is_known(self) -> bool:
        """Whether there is any."""
        return not (self.path is None and self.counts is None and self.given is None)

    @property
    def needs_file(self) -> bool:
        """Whether it is in no file yet."""
        return self.path is None and self.is_known

    def check(self) -> None:
        """Refuse before anything is done where there is none, or its file is not there.

        Raises:
            UsageError: no target was named.
            CubicfishError: the file is not there.

        """
        if not self.is_known:
            raise UsageError(
                "name the target that the photos show with --target target.yaml (make and "
                "print one with 'cubicfish target print --object corner'), or a flat checkerboard "
                "with --board 9x6 --square 25mm (inner corners, side of a square)"
            )
        if self.path is not None and not os.path.lexists(self.path):
            raise CubicfishError(
                f"{self.path} {MISSING}, or name a flat checkerboard with --board 9x6 --square 25mm"
            )

    def load(self, listener: Listener = SILENT) -> list[Target]:
        """The target; where nobody has said whether its outer squares are dark, light ones too.

        Raises:
            TargetError: its file cannot be used.

        """
        from cubicfish_cli.core.target import Target

        self.check()
        if self.told:
            from cubicfish_cli.app.listener import Event

            listener.tell(Event.TARGET, path=self.path)
        if self.given is not None:
            return [self.given]
        if self.path is not None:
            return load_targets(self.path)
        board = {
            "name": "board",
            "type": "checkerboard",
            "corners": list(self.counts or ()),
            "square": self.square,
        }
        return colourings(Target.from_data({"units": "mm", "boards": [board]}))

    def fingerprint(self) -> Fingerprint | None:
        """The file's, before it is read; None where there is none."""
        from cubicfish_cli.app.fingerprint import fingerprint

        return None if self.path is None else fingerprint(self.path)


def target_in(given: Target | StrPath) -> Target:
    """A target that a caller has, or has in a file.

    Raises:
        TargetError: its file cannot be used.

    """
    from cubicfish_cli.core.target import Target

    return given if isinstance(given, Target) else load_targets(Path(given))[0]


def load_targets(path: Path) -> list[Target]:
    """The targets that a file may mean: Kalibr's do not say which squares are dark.

    Raises:
        TargetError: the file cannot be read or does not describe a usable target; the text
            names the file, the board and the key.

    """
    from cubicfish_cli.core.target import Target, load_target_data

    data = load_target_data(path)
    if isinstance(data, dict) and "target_type" in data:
        return colourings(Target.from_data(_of_kalibr(str(path), data), str(path)))
    return [Target.from_data(data, str(path))]


def _of_kalibr(where: str, data: dict[str, Any]) -> dict[str, Any]:
    """What target.yaml would hold for a target file of Kalibr's, which counts inner corners too."""
    board: dict[str, Any] = {"name": "board", "type": data["target_type"]}
    if board["type"] == "aprilgrid":
        board |= {"tags": [data.get("tagCols"), data.get("tagRows")]}
        board |= {"tag": data.get("tagSize"), "spacing": data.get("tagSpacing")}
    else:
        square = data.get("colSpacingMeters")
        if square != data.get("rowSpacingMeters"):
            raise TargetError(
                f"{where}: rowSpacingMeters and colSpacingMeters differ: squares must be as high "
                "as wide"
            )
        board |= {"corners": [data.get("targetCols"), data.get("targetRows")], "square": square}
    return {"units": "m", "boards": [board]}


def colourings(target: Target) -> list[Target]:
    """The target, and where that is another one also the same with its colours exchanged.

    Turned by 180°, or by 90° where it is as wide as high, some boards look as if they were.
    """
    board = target.boards[0]
    if len(target.boards) > 1 or board.markers or not board.has_squares:
        return [target]
    columns, rows = board.columns, board.rows
    if columns % 2 != rows % 2 or (columns == rows and columns % 2):
        return [target]
    return [target, target.with_boards({0: board.with_other_colours()})]


def length_mm(text: str) -> float:
    """``30mm``, ``3cm``, ``0.75in`` or ``30`` (millimetres) -> millimetres.

    Raises:
        TargetError: the text is no positive length.

    """
    units = "|".join(sorted(MILLIMETRES, key=len, reverse=True))
    number = r"[0-9]+(?:\.[0-9]+)?|\.[0-9]+"
    match = re.fullmatch(rf"\s*({number})\s*({units})?\s*", text, re.I)
    value = float(match[1]) * MILLIMETRES[(match[2] or "mm").lower()] if match else 0.0
    if not 0 < value < 1e6:
        raise TargetError(f"{quoted(text)} is no length: write it like 30mm, 3cm or 1.25in")
    # Inches are exact in binary as little as tenths are; files should still look as meant.
    return round(value, 9)


def in_folder(path: Path) -> Path:
    """The camera file that is meant: a folder stands for the camera.yaml in it.

    Raises:
        CameraFileError: the folder has none.

    """
    if not path.is_dir():
        return path
    inside = path / "camera.yaml"
    if inside.exists():
        return inside
    if (path / "rig.yaml").exists():
        raise CameraFileError(
            f"{path} is the folder of a rig: name one of its cameras, a folder in it, or do this "
            "with 'cubicfish rig'"
        )
    raise CameraFileError(
        f"{path} is a folder without a {inside.name}: name the folder that 'cubicfish "
        "calibrate' wrote, or a camera file"
    )


def paths_of(given: StrPath | Iterable[StrPath]) -> list[Path]:
    """Names that may come alone or several together."""
    return [Path(given)] if isinstance(given, str | os.PathLike) else list(map(Path, given))


def path_or_none(given: StrPath | None) -> Path | None:
    """A name that may be left out."""
    return None if given is None else Path(given)


def check_inputs(
    inputs: Sequence[Path],
    target: TargetSource,
    run: Run,
    *,
    correspondences: Path | None = None,
    image_size: tuple[int, int] | None = None,
) -> bool:
    """Refuse at once, before anything is loaded or done, what cannot be read or says nothing here.

    Returns:
        Whether they are 2D-3D pairs, which have no target.

    Raises:
        UsageError: the inputs do not go together, or something is asked that would not be done.
        CubicfishError: one is not there.

    """
    if correspondences is not None and inputs:
        raise UsageError("give photos (or corners.csv) or --correspondences, not both")
    if correspondences is None and not inputs:
        raise UsageError("name photos, a folder of photos, or a corners.csv")
    tables = tables_among(inputs)
    if tables and len(inputs) > 1:
        raise UsageError(f"{quoted(str(tables[0]))} must be the only input, as all CSV files")
    for path in inputs if correspondences is None else [correspondences]:
        if not os.path.lexists(path) and not has_magic(str(path)):
            raise CubicfishError(f"{path} {MISSING}")
    pairs = correspondences is not None or any(map(holds_world_points, tables))
    if not pairs:
        target.check()
    elif target.is_known and not target.told:
        raise UsageError(
            "--target, --board and --square say what photos show, and 2D-3D pairs know their "
            "points: leave it out"
        )
    if pairs or tables:
        for name, given in (("--jobs", run.jobs is not None), ("--no-cache", run.anew)):
            if given:
                raise UsageError(
                    f"{name} goes with photos and films, which are searched, not with CSV files"
                )
    elif image_size is not None:
        raise UsageError("--size is of CSV files: photos have their own size")
    return pairs


def tables_among(inputs: Sequence[Path]) -> list[Path]:
    """Those of the inputs that are tables, by their names."""
    return [path for path in inputs if path.suffix.lower() == ".csv"]


def holds_world_points(path: Path) -> bool:
    """Whether the header of a CSV file is that of correspondences."""
    try:
        if not path.is_file():  # a pipe might be waited for
            return False
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            lines = [file.readline(10_000) for _ in range(2)]
    except OSError:
        return False  # the reader says what is wrong with it
    header = lines[1] if lines[0].startswith("#") else lines[0]
    return {"X", "Y", "Z"} <= {cell.strip() for cell in header.split(",")}


def named_photos(inputs: Sequence[StrPath], listener: Listener) -> list[Photo]:
    """The photos that are named; what may be missed among them is told.

    Raises:
        PhotoError: there are none, or one cannot be used.

    """
    from cubicfish_cli.app.listener import Event
    from cubicfish_cli.app.photos import find_photos

    lines: list[str] = []
    photos = find_photos(inputs, lines)
    for line in lines:
        listener.tell(Event.PASSED_OVER, line=line)
    return photos


def made_at() -> str:
    """The time in UTC, or that of SOURCE_DATE_EPOCH, with which results can be made again.

    Raises:
        CubicfishError: SOURCE_DATE_EPOCH is set to something else than seconds.

    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        moment = datetime.now(UTC) if epoch is None else datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise CubicfishError(
            f"SOURCE_DATE_EPOCH={epoch!r} is not a time in seconds since 1970: correct or unset it"
        ) from error
    return moment.isoformat(timespec="seconds")


def made_by_record(
    command: str | None,
    options: Mapping[str, Any],
    target: Fingerprint | None,
    files: Sequence[Fingerprint],
) -> dict[str, Any]:
    """Version, date, command and options, and the SHA-256 of the target and of every input.

    Raises:
        OutputError: a file is no longer what it was when it was read.

    """
    from cubicfish_cli import __version__

    return {
        "version": __version__,
        "date": made_at(),
        **({} if command is None else {"command": command}),
        "options": dict(options),
        "target": _of(target) if target else None,
        "inputs": [_of(file) for file in files],
    }


def _of(file: Fingerprint) -> dict[str, str]:
    return {"file": as_text(str(file.path)), "sha256": file.sha256}


def as_text(words: str) -> str:
    """What a name says, also where its bytes are no UTF-8, which no text file can hold."""
    return words.encode("utf-8", "backslashreplace").decode("utf-8")
