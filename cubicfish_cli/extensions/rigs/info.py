"""``cubicfish rig info``: where the cameras of a rig stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.asked import StrPath
from cubicfish_cli.app.terminal.options import as_command, record
from cubicfish_cli.app.terminal.progress import How
from cubicfish_cli.extensions.rigs.options import rig_argument
from cubicfish_cli.extensions.rigs.printed import print_rig

if TYPE_CHECKING:
    from cubicfish_cli.extensions.rigs.rig import Rig


@record
class Asked:
    """What is asked of ``cubicfish rig info``."""

    rig: Path = rig_argument


@as_command(
    "info",
    "What a rig is: where its cameras stand, and how surely.",
    "cubicfish rig info",
    "cubicfish rig info last_year/rig.yaml --json",
    do=lambda asked, run: info_rig_files(**vars(asked)),
    how=("as_json",),
)
def command(made: RigInfo, given: Asked, how: How) -> None:
    """Say where the cameras of RIG (by default: rig) stand, how surely, and how well it fits."""
    if how.print(made):
        return
    print_rig(made.rig)


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
        """Plain data: what ``cubicfish rig info --json`` prints."""
        held = {**self.rig.as_record(), "made_by": dict(self.rig.made_by)}
        return {"model": self.model, "rig": held}


def info_rig_files(rig: StrPath) -> RigInfo:
    """Say what a rig is, as ``cubicfish rig info`` does.

    Args:
        rig: its rig.yaml, or the folder of that.

    Raises:
        CameraFileError: the file cannot be used.

    """
    from cubicfish_cli.extensions.rigs.rig import load_rig, rig_file

    path = rig_file(rig)
    return RigInfo(model=path, rig=load_rig(path))
