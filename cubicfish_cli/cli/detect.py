"""``cubicfish detect``: find and name the corners, and stop there."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.inputs import detect, photo_problems
from cubicfish_cli.cli.options import (
    FILE,
    common_options,
    examples,
    jobs_option,
    json_option,
    overwrite_option,
    target_option,
)
from cubicfish_cli.cli.terminal import print_json, print_table, result, say


@click.command(
    "detect",
    short_help="Find and name the corners of the object in photos.",
    epilog=examples(
        "cubicfish detect photos/ --target target.yaml",
        "cubicfish detect 'run7/*.png' --target target.yaml -o run7.csv --json",
    ),
)
@click.argument("photos", type=FILE, nargs=-1, required=True, metavar="PHOTOS...")
@target_option
@click.option(
    "-o",
    "--output",
    type=FILE,
    default=Path("corners.csv"),
    show_default=True,
    metavar="FILE",
    help="Where the corners go.",
)
@overwrite_option
@json_option
@jobs_option
@common_options
def command(
    photos: tuple[Path, ...],
    target: Path | None,
    output: Path,
    overwrite: bool,
    as_json: bool,
    jobs: int | None,
) -> None:
    """Find the corners of the object in PHOTOS (files, folders or globs) and name them.

    The result is a table, one corner a line: image, board, column, row, x, y.
    """
    from cubicfish_cli.correspondences import save_corners
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.target import load_target

    if target is None:
        raise click.UsageError("name the calibration object with --target target.yaml")
    refuse_existing(output, overwrite=overwrite)
    detection, _ = detect(photos, load_target(target), jobs)
    save_corners(output, detection.corners, overwrite=overwrite)
    corners, images = len(detection.corners.pixel), len(detection.corners.images)
    if as_json:
        per_image = [
            {
                "image": photo.name,
                "boards": photo.boards,
                "corners": photo.corners,
                "exact": photo.exact,
                "problem": photo.problem,
                "notes": photo.notes,
            }
            for photo in detection.photos
        ]
        print_json(
            {
                "file": str(output),
                "image_size": detection.corners.image_size,
                "images": images,
                "corners": corners,
                "per_image": per_image,
            }
        )
    else:
        print_table(
            ("photo", "corners", "boards"),
            [
                (photo.name, str(photo.corners), ", ".join(photo.boards) or "none")
                for photo in detection.photos
            ],
        )
        result(f"\nwrote {output}: {count(corners, 'corner')} in {count(images, 'photo')}")
    for line in photo_problems(detection):
        say(line)
