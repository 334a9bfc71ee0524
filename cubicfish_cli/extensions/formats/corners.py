"""``cubicfish corners``: corners that another detector found, as corners.csv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import Run, UsageError, listed
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import paths_of
from cubicfish_cli.inputs.target_source import target_in
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, result
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish_cli.extensions.formats.corner_files import ImportedCorners

_HELP = """Convert FILES with another detector's corners to corners.csv, ready for calibrate.

FILES are of one board, all of one kind or another:

\b
corners.vnl      mrcal's, as mrgingham writes them: '# filename x y', maybe with level or weight,
                 one row for each corner, dashes where it was not found; --size is needed
calib_data.mat   of Bouguet's toolbox for MATLAB, with the corners that were clicked
a JSON           of PhotonVision's calibration, with its observations

Corners are numbered row by row from the target's corner (0, 0); corners of a board that would be
seen from behind are refused.

The corners of any other detector can be written as a corners.csv, which is a plain table.
"""


@record
class CornersOptions:
    """Options of :func:`import_corner_files`.

    Attributes:
        files: mrcal's corners.vnl, as mrgingham writes it, Bouguet's calib_data.mat or
            PhotonVision's JSON.
        target: the calibration target, or its file.
        table: the corners.csv to write.
        image_size: (width, height) of the photos in pixels, where the files do not say.
        board: the name of the target's board in the photos; not needed for a target of one board.
        only: take only photos whose names match this pattern, such as ``left*``.

    """

    files: StrPath | Sequence[StrPath] = parameters.argument(
        "What the detector wrote.",
        nargs=-1,
        required=True,
        metavar="FILES...",
    )
    target: Target | StrPath = parameters.needed_target
    table: StrPath = parameters.output_option("Where the corners go.", default="corners.csv")
    image_size: tuple[int, int] | None = option(
        "--size", "Size of the photos, where the files do not say.", parameters.SIZE
    )
    board: str | None = option(
        "--board NAME", "The target's board in the photos. [default: the only one]"
    )
    only: str | None = option("--only GLOB", "Only photos whose names match, such as 'left*'.")


def import_corner_files(options: CornersOptions, *, run: Run = Run()) -> ImportedCorners:
    """Write corners that another detector found as corners.csv, as ``cubicfish corners`` does.

    Raises:
        CubicfishError: a file or the target cannot be used, or the table exists and may not be
            replaced.

    """
    from cubicfish import save_corners
    from cubicfish_cli.extensions.formats.corner_files import read_corner_files

    if not paths_of(options.files):
        raise UsageError("no files are named: name those of the detector")
    goal = Path(options.table)
    Plan(run).reads(options.files, options.target).writes(goal)
    read = read_corner_files(
        paths_of(options.files),
        target_in(options.target),
        image_size=options.image_size,
        board=options.board,
        only=options.only,
    )
    save_corners(goal, read.corners, overwrite=run.overwrite)
    return replace(read, file=goal)


@as_command(
    "corners",
    "Import corners from another detector.",
    "cubicfish corners corners.vnl --target board.yaml --size 1920x1080",
    "cubicfish corners calib_data.mat --target board.yaml",
    "cubicfish corners corners.vnl --target box.yaml --size 752x480 --board floor --only 'left*'",
    do=import_corner_files,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(made: ImportedCorners, given: CornersOptions, how: How) -> None:
    """See ``_HELP``."""
    if how.print(made):
        return
    corners = made.corners
    found = f"{plural(len(corners.pixel), 'corner')} in {plural(len(corners.images), 'photo')}"
    result(f"wrote {made.file}: {found}")
    if made.left_out:
        print_message(
            f"{plural(made.left_out, 'corner')} left out, as the files say they were not found."
        )
    if made.empty:
        print_message(
            f"{plural(len(made.empty), 'photo')} without corners: {listed(made.empty, 'photos')}"
        )
