"""``cubicfish corners``: corners that another detector found, as corners.csv."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import as_command, needed_target, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, result, say
from cubicfish_cli.words.phrases import listed

_HELP = """Write the corners in FILES of another detector as corners.csv, ready for calibrate.

These are mrcal's corners.vnl, as mrgingham writes them: '# filename x y', maybe with level or
weight, and one row for each corner of one board, dashes where it was not found. Corners are
numbered row by row from the target's corner (0, 0); corners of a board that would be seen from
behind are refused. The files do not say how large the photos are: --size does.

What another detector writes can be made a corners.csv, a plain table.
"""


@record
class Asked:
    """What is asked of ``cubicfish corners``."""

    files: tuple[Path, ...] = options.argument(
        "What the detector wrote.",
        nargs=-1,
        required=True,
        metavar="FILES...",
        missing="name what the detector wrote: 'cubicfish corners corners.vnl --size 1920x1080'",
    )
    target: Path | None = options.target_option
    table: Path = options.output_option("Where the corners go.", default="corners.csv")
    image_size: tuple[int, int] = option(
        "--size", "Size of the photos.", options.SIZE, required=True
    )
    board: str | None = option(
        "--board NAME", "The target's board in the photos. [default: the only one]"
    )
    only: str | None = option("--only GLOB", "Only photos whose names match, such as 'left*'.")
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "corners",
    "Take over corners that another detector found.",
    "cubicfish corners corners.vnl --target board.yaml --size 1920x1080",
    "cubicfish corners corners.vnl --target box.yaml --size 752x480 --board floor --only 'left*'",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.library.importing import import_corner_files

    made = call(import_corner_files, given, target=needed_target(given.target))
    if given.as_json:
        print_json(made.as_record())
        return
    corners = made.corners
    found = f"{count(len(corners.pixel), 'corner')} in {count(len(corners.images), 'photo')}"
    result(f"wrote {made.file}: {found}")
    if made.left_out:
        say(f"{count(made.left_out, 'corner')} left out, as the files say they were not found.")
    if made.empty:
        say(f"{count(len(made.empty), 'photo')} without corners: {listed(made.empty, 'photos')}")
