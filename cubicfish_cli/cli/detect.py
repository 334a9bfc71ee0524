"""``cubicfish detect``: find and name the corners, and stop there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.inputs import detect, lost_word, mark_of, photos_of, say_photo_problems
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.photo_table import GOOD, PhotoRow, corners_by_board, print_photo_table
from cubicfish_cli.cli.scheduler_options import SchedulerOptions, scheduler_options
from cubicfish_cli.cli.target_choice import TargetChoice, say_default, target_options
from cubicfish_cli.cli.terminal import print_json, progress, result, say

if TYPE_CHECKING:
    from cubicfish_cli.identification.identified import Detection

_FEW_CORNERS = 20


@as_command(
    "detect",
    "Find and name the corners of the target in photos.",
    "cubicfish detect photos/ --target target.yaml",
    "cubicfish detect 'run7/*.png' --target target.yaml -o run7.csv --draw seen/",
)
@options.argument(
    "photos", "Photos: files, folders or globs.", nargs=-1, required=True, metavar="PHOTOS..."
)
@target_options
@options.output_option("Where the corners go.", default="corners.csv")
@option(
    "--draw FOLDER",
    "Also write FOLDER/<photo>.png for each photo: its corners in a colour a board, a disc at "
    "corner (0, 0), arrows along x and y, in red what was left out and why.",
    options.FOLDER,
)
@options.overwrite_option
@options.json_option("detect")
@options.jobs_option
@scheduler_options
@options.no_cache_option
def command(
    photos: tuple[Path, ...],
    target: TargetChoice,
    output: Path,
    draw: Path | None,
    overwrite: bool,
    as_json: bool,
    jobs: int | None,
    scheduler: SchedulerOptions,
    no_cache: bool,
) -> None:
    """Find the corners of the target in PHOTOS (files, folders or globs) and name them.

    The result is a table, one corner per line: image, board, column, row, x, y.
    """
    from cubicfish_cli.corner_files.observations_csv import save_corners
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.library.drawings import drawings, write_drawings

    scheduler.check(jobs)
    target.check()
    refuse_existing(output, overwrite=overwrite)
    found = photos_of(photos)
    pictures = drawings(draw, found) if draw else {}
    refuse_existing(*pictures.values(), overwrite=overwrite)
    say_default(target)
    loaded = target.load()
    with scheduler.connected() as executor:
        detection = detect(found, loaded, jobs, no_cache=no_cache, executor=executor)
    save_corners(output, detection.corners, overwrite=overwrite)
    drawn = {}
    if draw is not None:
        with progress("Drawing") as callback:
            written = write_drawings(found, detection, pictures, callback, overwrite=overwrite)
        drawn = {"drawings": written}
    corners, images = len(detection.corners.pixel), len(detection.corners.images)
    if as_json:
        keys = ("boards", "corners", "added", "exact", "problem", "notes")
        per_image = [
            {
                "image": photo.name,
                **{key: getattr(photo, key) for key in keys},
                "findings": [finding.as_record() for finding in photo.findings],
            }
            for photo in detection.photos
        ]
        print_json(
            {
                "file": output,
                "image_size": detection.corners.image_size,
                "images": images,
                "corners": corners,
                "findings": [finding.as_record() for finding in detection.findings],
                "per_image": per_image,
                **drawn,
            }
        )
    say_photo_problems(detection)
    for finding in detection.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    if not as_json:
        print_photo_table(_rows(detection), detection.corners.boards)
        result(f"\nwrote {output}: {count(corners, 'corner')} in {count(images, 'photo')}")


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
