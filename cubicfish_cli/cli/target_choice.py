"""Which object photos show: a target.yaml, or one flat board named by its counts."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.options import Parsed, bundle, option, target_option
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.errors import MISSING, CubicfishError

if TYPE_CHECKING:
    from cubicfish_cli.files import Fingerprint
    from cubicfish_cli.target import Target

DEFAULT_TARGET = Path("target.yaml")
NO_TARGET = (
    "the photos show an unknown target: name it with --target target.yaml (make and print one with "
    "'cubicfish target print --object corner'), or a flat checkerboard with --board 9x6 --square "
    "25mm (inner corners, side of a square)"
)
# Kalibr's target files are a few lines.
_FIRST_BYTES = 4096


def _counts(text: str) -> tuple[int, int]:
    """``9x6`` -> (9, 6)."""
    match = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX×]\s*([0-9]{1,3})\s*", text)
    columns, rows = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (2 <= columns <= 100 and 2 <= rows <= 100):
        raise ValueError(f"{text!r} is not two numbers from 2 to 100, such as 9x6")
    return columns, rows


COUNTS = Parsed("COLUMNSxROWS", _counts)


@dataclass(frozen=True, kw_only=True)
class TargetChoice:
    """What the user said of the object.

    Attributes:
        path: its file; None where none was named and none is there.
        counts: inner corners (columns, rows) of one flat checkerboard in the place of a file.
        square: the side of its squares, millimetres.

    """

    path: Path | None = None
    counts: tuple[int, int] | None = None
    square: float | None = None

    def check(self) -> None:
        """Refuse before anything is done where there is no object, or its file is not there.

        Raises:
            click.UsageError: no object was named.
            CubicfishError: the file is not there.

        """
        if self.counts is not None:
            return
        if self.path is None:
            raise click.UsageError(NO_TARGET)
        if not os.path.lexists(self.path):
            raise CubicfishError(
                f"{self.path} {MISSING}, or name a flat checkerboard with --board 9x6 --square 25mm"
            )

    def load(self) -> list[Target]:
        """The object; where nobody has said whether its outer squares are dark, light ones too.

        Raises:
            TargetError: its file cannot be used.

        """
        from cubicfish_cli.target import Target, colourings, load_target

        self.check()
        if self.counts is None:
            assert self.path is not None
            target = load_target(self.path)
            return colourings(target) if _is_of_kalibr(self.path) else [target]
        board = {
            "name": "board",
            "type": "checkerboard",
            "corners": list(self.counts),
            "square": self.square,
        }
        return colourings(Target.from_data({"units": "mm", "boards": [board]}))

    def fingerprint(self) -> Fingerprint | None:
        """The file's, before it is read; None where there is none."""
        from cubicfish_cli.files import fingerprint

        return None if self.path is None else fingerprint(self.path)


def _is_of_kalibr(path: Path) -> bool:
    with path.open("rb") as file:
        return b"target_type" in file.read(_FIRST_BYTES)


def recorded_as(text: str, path: Path) -> dict[str, str]:
    """What camera.yaml has of an object whose file is written together with it."""
    return {"file": str(path), "sha256": hashlib.sha256(text.encode()).hexdigest()}


def _choice(target: Path | None, board: tuple[int, int] | None, square: str | None) -> TargetChoice:
    if board is None:
        if square is not None:
            raise click.UsageError("--square is of --board: add --board 9x6 (inner corners)")
        return TargetChoice(path=target_path(target))
    if target is not None:
        raise click.UsageError("--target says what the target is: leave --board out, or --target")
    if square is None:
        raise click.UsageError("--board needs the side of its squares: add --square 25mm")
    from cubicfish_cli.printing.paper import length_mm

    return TargetChoice(counts=board, square=length_mm(square))


target_options = bundle(
    "target",
    _choice,
    target_option,
    option(
        "--board",
        "In the place of a target.yaml: one flat checkerboard of so many inner corners "
        "(squares less one), such as 9x6.",
        COUNTS,
    ),
    option("--square LENGTH", "Side of the squares of --board: 30mm, 3cm, 1.25in."),
)
"""``--target``, or ``--board`` and ``--square``: one :class:`TargetChoice` as ``target``."""


def target_path(given: Path | None) -> Path | None:
    """The file that was named, else ./target.yaml; None where it is not there."""
    return given or (DEFAULT_TARGET if DEFAULT_TARGET.is_file() else None)


def say_default(choice: TargetChoice) -> None:
    """Say which object is meant where the user named none."""
    context = click.get_current_context()
    if choice.path is not None and context.params.get("target") is None:
        say(f"Target: {choice.path}.")


def needed_target(given: Path | None) -> Path:
    """The object's file, by default ./target.yaml, for commands that need one.

    Raises:
        click.UsageError: none was named, and none is there.

    """
    path = target_path(given)
    if path is None:
        raise click.UsageError(
            "name the calibration target with --target target.yaml: there is no ./target.yaml, and "
            "'cubicfish target print' makes one"
        )
    if given is None:
        say(f"Target: {path}.")
    return path
