"""``cubicfish rig info``: where the cameras of a rig stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.extensions.rigs.options import rig_argument
from cubicfish_cli.extensions.rigs.printed import print_rig
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How

if TYPE_CHECKING:
    from cubicfish import Rig


@record
class RigInfoOptions:
    """A rig: its rig.yaml, or the folder of that."""

    rig: StrPath = rig_argument


@dataclass(frozen=True, kw_only=True)
class RigInfo:
    """What the file of a rig says.

    Attributes:
        model: the file.
        rig: the rig, with its verdict.

    """

    model: Path
    rig: Rig

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig info --json`` prints.

        Keys:
            model: the rig's file
            rig: what it holds: units, cameras, pairs, fit, made_by

        """
        plain = {**self.rig.as_record(), "made_by": dict(self.rig.made_by)}
        return {"model": self.model, "rig": plain}


def info_rig_files(options: RigInfoOptions, *, run: Run = Run()) -> RigInfo:
    """Say what a rig is, as ``cubicfish rig info`` does.

    Raises:
        CameraFileError: the file cannot be used.

    """
    from cubicfish import load_rig

    rig = load_rig(options.rig)
    return RigInfo(model=rig.files[0], rig=rig)


@as_command(
    "info",
    "Show where a rig's cameras are, and how certain that is.",
    "cubicfish rig info",
    "cubicfish rig info last_year/rig.yaml --json",
    do=info_rig_files,
    how=("as_json",),
)
def command(made: RigInfo, given: RigInfoOptions, how: How) -> None:
    """Show where the cameras of RIG (by default: rig) stand, how surely, and how well it fits."""
    if not how.print(made):
        print_rig(made.rig)
