"""``cubicfish frames``: from films to the few frames that are worth calibrating from."""

from __future__ import annotations

import shlex
from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import IntRange, as_command, option, record, target_options
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, result
from cubicfish_cli.films import MOST
from cubicfish_cli.library.asked import TargetSource


@record
class Asked:
    """What is asked of ``cubicfish frames``."""

    films: tuple[Path, ...] = options.argument(
        "Films of one camera, all of one size.", nargs=-1, required=True, metavar="FILM..."
    )
    target: TargetSource = target_options
    folder: Path = options.output_option(
        "Where the frames (PNG, with their time in the name), frames.csv and contact_sheet.html "
        "go.",
        folder=True,
        required=True,
    )
    most: int = option("--most N", "Choose no more frames than these.", IntRange(min=1), MOST)
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option
    jobs: int | None = options.jobs_option
    no_cache: bool = options.no_cache_option


@as_command(
    "frames",
    "Choose frames of films to calibrate from.",
    "cubicfish frames film.mp4 -o photos/ --target target.yaml",
    "cubicfish frames 'films/*.mp4' -o photos/ --most 40",
)
def command(given: Asked) -> None:
    """Choose the frames of each FILM that a camera is best calibrated from.

    They are sharp, still, and each shows something that the others do not: corners in another
    part of the picture, or a board from another side.
    """
    from cubicfish_cli.library.frames import choose_frames

    target, chosen = given.target, call(choose_frames, given)
    if given.as_json:
        print_json(chosen.as_record())
        return
    result(
        f"{count(len(chosen.photos), 'frame')} of {chosen.frames:,} chosen; boards were looked for "
        f"in {chosen.looked_at}"
    )
    result(chosen.ended)
    result(f"wrote {given.folder}: frames, {chosen.table.name} and {chosen.sheet.name}")
    if target.path is not None:
        command_line = shlex.join(
            ["cubicfish", "calibrate", str(given.folder), "--target", str(target.path)]
        )
        result(f"\nNext: {command_line}", whole=True)
