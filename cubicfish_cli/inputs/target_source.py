"""The target that photos show: from a file, from a size of squares or from memory.

Nothing is loaded for it before it is read.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError, Listener, TargetError, UsageError, quoted
from cubicfish.files import StrPath
from cubicfish.target import MILLIMETRES

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish.files import Fingerprint


@dataclass(frozen=True, kw_only=True)
class TargetSource:
    """What photos show.

    Attributes:
        path: the target's file.
        counts: inner corners (columns, rows) of one flat checkerboard in the place of a file.
        square: the side of its squares, millimetres.
        given: a target in memory in the place of both.
        by_default: whether nobody named the file, so that the listener hears which it is.

    """

    path: Path | None = None
    counts: tuple[int, int] | None = None
    square: float | None = None
    given: Target | None = None
    by_default: bool = False

    @classmethod
    def of(cls, target: TargetSource | Target | StrPath | None) -> TargetSource:
        """What a caller names."""
        if isinstance(target, TargetSource):
            return target
        if target is None or isinstance(target, str | os.PathLike):
            return cls(path=None if target is None else Path(target))
        return cls(given=target)

    @classmethod
    def beside(cls, camera: Path) -> TargetSource:
        """The target of a camera's own calibration, by the camera's file; refined if it was."""
        names = ("target.refined.yaml", "target.yaml")
        there = (path for path in map(camera.with_name, names) if path.is_file())
        return cls(path=next(there, None), by_default=True)

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
            do = "name a flat checkerboard with --board 9x6 --square 25mm"
            raise CubicfishError.missing(self.path, do=do)

    def load(self, listener: Listener = Listener(), *, unplaced: bool = False) -> list[Target]:
        """The target; where nobody has said whether its outer squares are dark, light ones too.

        Args:
            listener: is told which file it is, if nobody named it.
            unplaced: whether the places of its boards may be unknown.

        Raises:
            TargetError: its file cannot be used.

        """
        self.check()
        targets = self._load(listener)
        return targets if unplaced else [_refuse_unplaced(one) for one in targets]

    def _load(self, listener: Listener) -> list[Target]:
        from cubicfish import Target

        if self.by_default:
            from cubicfish import Event

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
        from cubicfish.files import Fingerprint

        return None if self.path is None else Fingerprint.of(self.path)


def target_in(given: Target | StrPath) -> Target:
    """A target that a caller has, or has in a file.

    Raises:
        TargetError: its file cannot be used.

    """
    from cubicfish import Target

    one = given if isinstance(given, Target) else load_targets(Path(given))[0]
    return _refuse_unplaced(one)


def _refuse_unplaced(target: Target) -> Target:
    if target.unplaced:
        raise TargetError(
            f"board {quoted(target.unplaced[0])} has place: unknown: calibrate one camera with it, "
            "and go on with the target.refined.yaml that 'cubicfish calibrate' writes"
        )
    return target


def load_targets(path: Path) -> list[Target]:
    """The targets that a file may mean: Kalibr's do not say which squares are dark.

    Raises:
        TargetError: the file cannot be read or does not describe a usable target; the text
            names the file, the board and the key.

    """
    from cubicfish import Target

    data = Target.load_data(path)
    if isinstance(data, dict) and "target_type" in data:
        return colourings(Target.from_data(_convert_kalibr(str(path), data), str(path)))
    return [Target.from_data(data, str(path))]


def _convert_kalibr(where: str, data: dict[str, Any]) -> dict[str, Any]:
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
        raise TargetError(f"{quoted(text)} is not a length: write it like 30mm, 3cm or 1.25in")
    # Inches are exact in binary as little as tenths are; files should still look as meant.
    return round(value, 9)
