"""``cubicfish import``: another tool's camera as camera.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import FloatRange, as_command, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, result
from cubicfish_cli.formats.registry import READABLE

if TYPE_CHECKING:
    from cubicfish_cli.library.importing import Imported

_HELP = f"""Read a camera and write it as camera.yaml, for undistort, map, compare and others.

These can be read, by the names that --from takes:

\b
{chr(10).join(f"{name:<13}{what}" for name, what in READABLE.items())}

P is fitted to the lens over its field; how near it comes, how far it is trusted and why no farther
are printed. Corners of other detectors are read by 'cubicfish corners'.
"""


@record
class Asked:
    """What is asked of ``cubicfish import``."""

    path: Path = options.argument(
        "The other tool's camera file.",
        metavar="FILE",
        missing="name the other tool's camera file: 'cubicfish import camchain.yaml'",
    )
    written_by: str | None = option(
        "--from FORMAT",
        "What wrote the file: a name of the list above. [default: told by what it holds]",
        click.Choice(list(READABLE)),
    )
    camera: str | None = option(
        "--camera NAME",
        "Which camera, where the file holds several: cam1, COLMAP's CAMERA_ID, 1 for M1 and D1.",
    )
    image_size: tuple[int, int] | None = option(
        "--size", "Size of the photos, where the file does not say.", options.SIZE
    )
    max_angle_deg: float | None = option(
        "--max-angle DEG",
        "Trust the lens up to this angle from its axis: files do not say how far it was "
        "calibrated. [default: what it shows in the photo, at most 110]",
        FloatRange(min=0, max=175, min_open=True),
    )
    output: Path = options.output_option(
        "Where the camera goes.", default="calibration/camera.yaml"
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "import",
    "Another tool's camera as camera.yaml.",
    "cubicfish import camchain.yaml --camera cam1",
    "cubicfish import calib_results.txt -o lens_a/camera.yaml --max-angle 95",
    "cubicfish import sparse/0/cameras.bin --camera 1",
    "cubicfish import opencv.yaml --size 1280x800",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.library.importing import import_files

    files = call(import_files, given)
    if given.as_json:
        print_json(files.as_record())
        return
    imported, made = files.imported, files.imported.camera
    error, (width, height) = imported.conversion.error, made.image_size
    result(
        f"wrote {files.file}: a lens of {imported.written_by}, {width}x{height}, trusted to "
        f"{made.max_angle_deg:.1f}° from its axis"
    )
    result(f"field: {_why_it_ends(imported, asked=given.max_angle_deg is not None)}")
    result(
        f"conversion error: RMS {error.rms_px:.4f} px, largest {error.max_px:.4f} px up to "
        f"{error.max_angle_deg:.1f}°"
    )


def _why_it_ends(imported: Imported, *, asked: bool) -> str:
    """What ends the field, and what to do where that may be wrong."""
    trusted = f"{imported.camera.max_angle_deg:.1f}°"
    ended_by, fold_deg = imported.conversion.ended_by, imported.conversion.fold_deg
    if imported.knows_its_field and not asked and ended_by == "angle":
        return f"as far as the camera was trusted that cubicfish exported, {trusted}"
    unknown = "the file does not say how far the lens was calibrated"
    if ended_by == "fold":
        return (
            f"cut at {trusted}, since the lens folds at {fold_deg:.1f}°, inside the "
            f"photo; {unknown}: choose --max-angle if that was less"
        )
    if ended_by == "fit":
        return (
            f"cut at {trusted}, since no sound cubic camera is as near to the lens farther out; "
            f"{unknown}: choose --max-angle if that was less"
        )
    if ended_by == "region":
        return "as far as the file says that the lens is valid"
    if ended_by == "photo":
        return f"all that the lens shows in the photo; {unknown}: choose --max-angle if it was less"
    if asked:
        return f"cut at {trusted}, the --max-angle given"
    return f"cut at {trusted}, which few lenses see beyond; {unknown}: choose --max-angle"
