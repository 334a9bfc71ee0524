"""``cubicfish frames``: from films to the few frames that are worth calibrating from."""

from __future__ import annotations

import shlex
from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.choosing import choose_frames
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.target_choice import TargetChoice, say_default, target_options
from cubicfish_cli.cli.terminal import print_json, result
from cubicfish_cli.films import MOST


@as_command(
    "frames",
    "Choose frames of films to calibrate from.",
    "cubicfish frames film.mp4 -o photos/ --target target.yaml",
    "cubicfish frames 'films/*.mp4' -o photos/ --most 40",
)
@options.argument(
    "films", "Films of one camera, all of one size.", nargs=-1, required=True, metavar="FILM..."
)
@target_options
@options.output_option(
    "Where the frames (PNG, with their time in the name), frames.csv and contact_sheet.html go.",
    folder=True,
    required=True,
)
@option("--most N", "Choose no more frames than these.", IntRange(min=1), MOST)
@options.overwrite_option
@options.json_option("frames")
@options.jobs_option
@options.no_cache_option
def command(
    films: tuple[Path, ...],
    target: TargetChoice,
    output: Path,
    most: int,
    overwrite: bool,
    as_json: bool,
    jobs: int | None,
    no_cache: bool,
) -> None:
    """Choose the frames of each FILM that a camera is best calibrated from.

    They are sharp, still, and each shows something that the others do not: corners in another
    part of the picture, or a board from another side. A run that was interrupted goes on where it
    ended.
    """
    known = target.counts is not None or target.path is not None
    if known:
        target.check()
        say_default(target)
    chosen = choose_frames(
        films,
        output,
        target if known else None,
        most=most,
        jobs=jobs,
        no_cache=no_cache,
        overwrite=overwrite,
    )
    if as_json:
        print_json(
            {
                "photos": [str(path) for path in chosen.photos],
                "file": str(chosen.table),
                "sheet": str(chosen.sheet),
                "frames": chosen.frames,
                "looked_at": chosen.looked_at,
                "films": chosen.films,
            }
        )
        return
    result(
        f"{count(len(chosen.photos), 'frame')} of {chosen.frames:,} chosen; boards were looked for "
        f"in {chosen.looked_at}"
    )
    result(f"wrote {output}: frames, {chosen.table.name} and {chosen.sheet.name}")
    if target.path is not None:
        command_line = shlex.join(
            ["cubicfish", "calibrate", str(output), "--target", str(target.path)]
        )
        result(f"\nNext: {command_line}", whole=True)
