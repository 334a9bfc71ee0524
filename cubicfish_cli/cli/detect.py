"""``cubicfish detect``: find and name the corners, and stop there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import (
    GOOD,
    PhotoRow,
    corners_by_board,
    count,
    lost_word,
    mark_of,
    print_photo_table,
)
from cubicfish_cli.cli.options import as_command, option, record, target_options
from cubicfish_cli.cli.progress import SchedulerOptions, call, say_found, scheduler_options
from cubicfish_cli.cli.terminal import print_json, result, say

if TYPE_CHECKING:
    from cubicfish_cli.identification.identified import Detection
    from cubicfish_cli.library.asked import TargetSource

_FEW_CORNERS = 20


@record
class Asked:
    """What is asked of ``cubicfish detect``."""

    photos: tuple[Path, ...] = options.argument(
        "Photos: files, folders or globs.", nargs=-1, required=True, metavar="PHOTOS..."
    )
    target: TargetSource = target_options
    table: Path = options.output_option("Where the corners go.", default="corners.csv")
    draw: Path | None = option(
        "--draw FOLDER",
        "Also write FOLDER/<photo>.png for each photo: its corners in a colour a board, a disc at "
        "corner (0, 0), arrows along x and y, in red what was left out and why.",
        options.FOLDER,
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option
    jobs: int | None = options.jobs_option
    scheduler: SchedulerOptions = scheduler_options
    no_cache: bool = options.no_cache_option


@as_command(
    "detect",
    "Find and name the corners of the target in photos.",
    "cubicfish detect photos/ --target target.yaml",
    "cubicfish detect 'run7/*.png' --target target.yaml -o run7.csv --draw seen/",
)
def command(given: Asked) -> None:
    """Find the corners of the target in PHOTOS (files, folders or globs) and name them.

    The result is a table, one corner per line: image, board, column, row, x, y.
    """
    from cubicfish_cli.library.detection import detect_files

    given.scheduler.check(given.jobs)
    given.target.check()
    made = call(detect_files, given)
    detection = made.detection
    if given.as_json:
        print_json(made.as_record())
    say_found([one for photo in detection.photos for one in photo.findings])
    for finding in detection.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    if not given.as_json:
        corners = detection.corners
        found = f"{count(len(corners.pixel), 'corner')} in {count(len(corners.images), 'photo')}"
        print_photo_table(_rows(detection), corners.boards)
        result(f"\nwrote {given.table}: {found}")


def _rows(detection: Detection) -> list[PhotoRow]:
    by_board = corners_by_board(detection.corners)
    rows = []
    for photo in detection.photos:
        said = []
        if photo.lost:
            said.append(lost_word(photo))
        elif photo.corners < _FEW_CORNERS:
            said.append("few corners")
        if not photo.exact:
            said.append("not sure which corners")
        if not photo.lost and photo.notes:
            said.append(f"{count(len(photo.notes), 'remark')}")
        rows.append(
            PhotoRow(
                name=photo.name,
                words="; ".join(said) or GOOD,
                level="good" if not said else "bad" if photo.lost else "care",
                boards=by_board.get(photo.name, {}),
                corners=None if photo.lost else photo.corners,
            )
        )
    return rows
