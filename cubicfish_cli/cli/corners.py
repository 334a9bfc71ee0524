"""``cubicfish corners``: corners that another detector found, as corners.csv."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import as_command, needed_target, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, result, say
from cubicfish_cli.words.phrases import listed

# The names of corner_files.read.CORNER_FORMATS, here so that --help need not load numpy; a test
# holds them to each other.
FORMATS = ("mrcal", "kalibr")

_HELP = """Write the corners in FILES of another detector as corners.csv, ready for calibrate.

\b
mrcal     corners.vnl: '# filename x y', maybe with level or weight; one row
          for each corner of one board, dashes where it was not found
kalibr    a CSV table with the columns image (or filename, timestamp,
          timestamp_ns, ts), corner_id (or point_id, id; or tag_id and
          corner_index), x (u), y (v), and maybe camera, board_id, weight.
          Kalibr itself writes no corners; scripts around it do.

Corners are numbered row by row from the target's corner (0, 0), on an aprilgrid from its lowest row
up as in Kalibr, or four a tag. None of these files says which corner of the board that is, or how
large the photos are: the target's corner (0, 0) and axes must be those of the detector, and --size
is needed. Corners of a board that would be seen from behind are refused.
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
    written_by: Literal["mrcal", "kalibr"] | None = option(
        "--format",
        "What wrote the files. [default: .vnl mrcal, .csv kalibr]",
        click.Choice(FORMATS),
    )
    image_size: tuple[int, int] = option(
        "--size", "Size of the photos.", options.SIZE, required=True
    )
    boards: tuple[str, ...] = option(
        "--board [ID=]NAME",
        "The target's board that the files call ID; NAME alone where they tell no boards apart. "
        "May be given again.",
        multiple=True,
    )
    only: str | None = option("--only GLOB", "Only photos whose names match, such as 'cam0/*'.")
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "corners",
    "Take over corners that another detector found.",
    "cubicfish corners corners.vnl --target board.yaml --size 1920x1080",
    "cubicfish corners found.csv --target grid.yaml --size 752x480 --only 'cam0/*'",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.library.importing import import_corner_files

    target, boards = needed_target(given.target), _boards(given.boards)
    made = call(import_corner_files, given, target=target, boards=boards)
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


def _boards(given: tuple[str, ...]) -> dict[str, str]:
    """``4=front`` -> {"4": "front"}; ``front`` alone is for files that tell no boards apart."""
    boards: dict[str, str] = {}
    for text in given:
        label, equals, name = text.rpartition("=")
        if not name.strip() or (equals and not label.strip()):
            raise click.UsageError(f"--board {text!r}: write ID=NAME, or NAME alone")
        if label.strip() in boards:
            raise click.UsageError(f"--board {text!r}: that board was named already")
        boards[label.strip()] = name.strip()
    return boards
