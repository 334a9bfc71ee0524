"""``cubicfish import``: another tool's camera as camera.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.extension_guard import read_formats
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import result

if TYPE_CHECKING:
    from cubicfish_cli.extensions.formats.importing import Imported

_HELP = f"""Read a camera and write it as camera.yaml, for undistort, map, compare and others.

These can be read, by the names that --from takes:

\b
{chr(10).join(f"{name:<13}{one.reads}" for name, one in read_formats().items())}

P is fitted to the lens over its field; how near it comes, how far it is trusted and why no farther
are printed. Corners of other detectors are read by 'cubicfish corners'.
"""


@record
class ImportOptions:
    """Options of :func:`import_files`.

    Attributes:
        path: the other tool's file.
        written_by, camera, image_size, lens, max_angle_deg: as for :func:`import_camera`.
        output: the camera.yaml to write.

    """

    path: StrPath = parameters.argument(
        "The other tool's camera file.",
        metavar="FILE",
    )
    written_by: str | None = option(
        "--from FORMAT",
        "What wrote the file: a name of the list above. [default: told by what it holds]",
        parameters.Choice(list(read_formats())),
    )
    camera: str | None = option(
        "--camera NAME",
        "Which camera, where the file holds several: cam1, COLMAP's CAMERA_ID, 1 for M1 and D1.",
    )
    image_size: Sequence[int] | None = option(
        "--size", "Size of the photos, where the file does not say.", parameters.SIZE
    )
    lens: str | None = option(
        "--lens KIND",
        "Whose four distortion coefficients are, where the file does not say: fisheye or pinhole.",
        parameters.Choice(["fisheye", "pinhole"]),
    )
    max_angle_deg: float | None = option(
        "--max-angle DEG",
        "Trust the lens up to this angle from its axis: files do not say how far it was "
        "calibrated. [default: what it shows in the photo, at most 110]",
        FloatRange(min=0, max=175, min_open=True),
    )
    output: StrPath = parameters.output_option(
        "Where the camera goes.", default="calibration/camera.yaml"
    )


def import_files(options: ImportOptions, *, run: Run = Run()) -> Imported:
    """Write another tool's camera as camera.yaml, as ``cubicfish import`` does.

    Raises:
        CubicfishError: as :func:`import_camera`, or the camera's file exists and may not be
            replaced.

    """
    from cubicfish.files import Fingerprint
    from cubicfish_cli.extensions.formats.importing import import_camera

    run.date()  # an unusable date is an error before the work, not after
    goal = Path(options.output)
    Plan(run).reads(options.path).writes(goal)
    source = Fingerprint.of(Path(options.path))
    run.listener.progress("Fitting the cubic camera to the lens")
    imported = import_camera(
        options.path,
        written_by=options.written_by,
        camera=options.camera,
        image_size=options.image_size,
        lens=options.lens,
        max_angle_deg=options.max_angle_deg,
    )
    made_by = {**run.made_by({}, files=[source]), **imported.made_by}
    imported = replace(imported, made_by=made_by, file=goal)
    imported.save(goal, overwrite=run.overwrite)
    return imported


@as_command(
    "import",
    "Write another tool's camera as camera.yaml.",
    "cubicfish import camchain.yaml --camera cam1",
    "cubicfish import calib_results.txt -o lens_a/camera.yaml --max-angle 95",
    "cubicfish import sparse/0/cameras.bin --camera 1",
    "cubicfish import opencv.yaml --size 1280x800 --lens fisheye",
    do=import_files,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(imported: Imported, given: ImportOptions, how: How) -> None:
    """See ``_HELP``."""
    if how.print(imported):
        return
    made, error = imported.camera, imported.conversion.error
    width, height = made.image_size
    result(
        f"wrote {imported.file}: a lens of {imported.written_by}, {width}x{height}, trusted to "
        f"{made.max_angle_deg:.1f}° from its axis"
    )
    result(f"field: {_explain_end(imported, limited=given.max_angle_deg is not None)}")
    result(
        f"conversion error: RMS {error.rms_px:.4f} px, largest {error.max_px:.4f} px up to "
        f"{error.max_angle_deg:.1f}°"
    )


def _explain_end(imported: Imported, *, limited: bool) -> str:
    """Say what ends the field, and what to do if that may be wrong."""
    trusted = f"{imported.camera.max_angle_deg:.1f}°"
    ended_by, fold_deg = imported.conversion.ended_by, imported.conversion.fold_deg
    if ended_by == "region":
        return "as far as the file says that the lens is valid"
    if ended_by == "angle" and limited:
        return f"cut at {trusted}, the --max-angle given"
    if ended_by == "angle" and imported.knows_its_field:
        return f"as far as the camera was trusted that cubicfish exported, {trusted}"
    why = {
        "photo": "all that the lens shows in the photo",
        "fold": f"cut at {trusted}, since the lens folds at {fold_deg or 0:.1f}°, inside the photo",
        "fit": f"cut at {trusted}, since no sound cubic camera is as near to the lens farther out",
        "angle": f"cut at {trusted}, which few lenses see beyond",
    }
    return (
        f"{why[ended_by]}; the file does not say how far the lens was calibrated: choose "
        "--max-angle if that was less"
    )
