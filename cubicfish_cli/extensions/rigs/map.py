"""``cubicfish rig map``: maps of two cameras, after which both show things in equal rows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.app.asked import Run
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.options import as_command, record
from cubicfish_cli.app.terminal.progress import How
from cubicfish_cli.commands.map import photo_size_option, print_maps
from cubicfish_cli.commands.view_options import view_options
from cubicfish_cli.core.views.options import ViewOptions
from cubicfish_cli.extensions.rigs.options import pair_option, rig_option

if TYPE_CHECKING:
    from cubicfish_cli.extensions.rigs.pair_maps import PairMapFiles

_HELP = """Write two maps of the rig's cameras that --pair names: OUT_left.npz and OUT_right.npz.

After them what one camera shows in a row the other shows in the same row. Flat
pictures end before 180°; --view cylindrical and equirectangular are then about the line between
the cameras and go on all around it. OUT.stereo.yaml has what it takes to get from disparities to
points: baseline, focal length, and of flat ones P1, P2 and Q. Maps are written as
'cubicfish map' does: .npz, .exr, .png or .pgm.
"""


@record
class Asked:
    """What is asked of ``cubicfish rig map``."""

    output: Path = options.argument(
        "Where the maps go: a name that ends in .npz, .exr, .png or .pgm.",
        metavar="OUT",
    )
    rig: Path = rig_option
    pair: tuple[str, str] | None = pair_option
    view: ViewOptions = view_options
    photo_size: tuple[int, int] | None = photo_size_option


def _map(asked: Asked, *, run: Run) -> PairMapFiles:
    from cubicfish_cli.extensions.rigs.pair_maps import map_rig_files

    return map_rig_files(**vars(asked), run=run)


@as_command(
    "map",
    "Maps of two cameras, after which rows of their pictures agree: stereo.",
    "cubicfish rig map stereo.npz --pair left,right",
    "cubicfish rig map stereo.npz --model rig --view equirectangular",
    do=_map,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(made: PairMapFiles, given: Asked, how: How) -> None:
    """See ``_HELP``."""
    unit = f" {made.stereo['units']}" if made.stereo["units"] else ""
    depth = f"baseline {made.stereo['baseline']:.3f}{unit}; {made.stereo['depth']}"
    print_maps(made, how, depth)
