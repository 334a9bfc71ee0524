"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish import Run, UsageError, did_you_mean, quoted
from cubicfish.files import StrPath
from cubicfish_cli.extension_guard import Place, written_formats
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, print_wrote, result

# Maps have no lens model, and so are not among the registered formats.
FORMATS = {
    **{name: one.written[name]["what"] for name, one in written_formats().items()},
    "maps": ".npz for cv2.remap; holds any lens",
}

_HELP = f"""Write the camera for another tool, and say how near its lens model comes.

\b
{chr(10).join(f"{name:<35}{what}" for name, what in FORMATS.items())}

What is exact holds the camera itself, in a file that needs no other. The lens of each other format
is fitted to the camera over its field, in pixels. The RMS and the largest error are printed, with
the angle up to which they hold, and written into the file if it takes comments. They hold up to
where the calibration's corners reach. Beyond, the camera is extrapolated, and the error there is
stated apart. A camera that was imported has no corners: there the whole field counts.

Most programs read OPENCV_FISHEYE, which colmap writes; colmap-rad-tan-thin-prism-fisheye needs
COLMAP 3.11 or newer.

A symmetric lens model is given in the frame in which the camera looks most symmetric. The rotation
from the frame of camera.yaml is printed, and poses in the file are turned with it.
"""


@record
class LensOptions:
    """Options of writing lenses for another tool.

    Attributes:
        to: the format: a name of ``cubicfish export --help``.
        output: the file; by default the format's usual name, in the current folder.
        max_error: as for :func:`export_camera`; None for 0.5.
        max_angle_deg: as for :func:`export_camera`.

    """

    to: str = option(
        "--to FORMAT",
        "What to write: a name of the list above.",
        parameters.Choice(list(FORMATS)),
        required=True,
    )
    output: StrPath | None = parameters.output_option(
        "Where it goes. [default: the format's usual name, in the current folder]", folder=None
    )
    max_error: float | None = option(
        "--max-error PX",
        "Write nothing if the format's lens is farther than this from the camera anywhere up to "
        "where the calibration's corners reach. Beyond, the error is only printed. [default: 0.5]",
        FloatRange(min=0, min_open=True),
    )
    max_angle_deg: float | None = option(
        "--max-angle DEG",
        "Leave out of the conversion what is farther from the axis than this, so that the lens "
        "meets the rest more closely. [default: the whole field]",
        FloatRange(min=0, max=180, min_open=True),
    )


@record
class ExportOptions(LensOptions):
    """Options of :func:`export_files`, beside those of the lens.

    Attributes:
        camera: its file or folder.
        name: what functions of source text begin with; None for "camera".

    """

    camera: StrPath = parameters.camera_options
    name: str | None = option(
        "--name NAME",
        "What the functions of source text begin with, and by default the name of its file. "
        "[default: camera]",
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ExportedFiles:
    """Result of :func:`export_files`.

    Attributes:
        files: the files that were written.
        record: plain data: what ``cubicfish export --json`` prints.
        lines: the errors of the conversion, for people.
        warnings: what not to rely on.

    """

    files: list[Path]
    record: dict[str, Any]
    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish export --json`` prints.

        Keys:
            file: what was written
            format: its format
            lens: the format's lens model (this and the rest not where the camera is held as it is)
            rms_px: the RMS of the conversion
            max_px: its largest error
            max_angle_deg: the angle up to which these hold: how far corners reached
            by_angle: a record a ring about the axis: from_deg, to_deg, rms_px, max_px
            also: the errors in other ways of reading the file, where there are any
            beyond: from_deg, to_deg, rms_px and max_px of the field where no corner was, if any
            turned_deg: how far the frame was turned
            lens_from_camera: that turn, a 3x3 matrix

        """
        return self.record


def export_files(options: ExportOptions, *, run: Run = Run()) -> ExportedFiles:
    """Write a camera for another tool, as ``cubicfish export`` does.

    Raises:
        UsageError: the options do not go together.
        FitError: there is no such format, or its lens is too far from a camera.
        CubicfishError: a file cannot be used, or exists and may not be replaced.

    """
    from cubicfish import build_map, build_view, load_camera, save_map
    from cubicfish_cli.commands.exporting import MAX_ERROR, export_camera, printed

    to, path = options.to, in_folder(Path(options.camera))
    formats = written_formats()
    if to != "maps" and to not in formats:
        suggestion = did_you_mean(to, sorted({"maps", *formats}))
        raise UsageError(f"no format is called {quoted(to)}: {suggestion}")
    is_exact = to != "maps" and formats[to].exact
    for name, given in (("--max-error", options.max_error), ("--max-angle", options.max_angle_deg)):
        if (to == "maps" or is_exact) and given is not None:
            raise UsageError(f"{name} is of lens models: --to {to} holds the camera as it is")
    if options.name is not None and not is_exact:
        raise UsageError(f"--name is of functions, and --to {to} writes none")
    max_error = MAX_ERROR if options.max_error is None else options.max_error
    usual = Path("undistort_map.npz" if to == "maps" else formats[to].file_name)
    goal = Path(options.output or usual.with_stem(options.name or usual.stem))
    plan = Plan(run).reads(path)
    plan.writes(goal)
    loaded = load_camera(path)
    if to == "maps":
        if goal.suffix.lower() != ".npz":
            raise UsageError(f"{goal}: --to maps writes .npz; 'cubicfish map' writes others")
        save_map(goal, build_map(loaded.camera, build_view(loaded.camera)), overwrite=run.overwrite)
        return ExportedFiles(files=[goal], record={"file": goal, "format": to})
    if is_exact:
        write = Place(formats[to].extension, formats[to].write).load()
        plan.write({goal: write(loaded, to, options.name)})
        return ExportedFiles(files=[goal], record={"file": goal, "format": to})
    run.listener.progress("Fitting the other lens")
    lens = export_camera(loaded, to, max_error=max_error, max_angle_deg=options.max_angle_deg)
    text = lens.text
    plan.write({goal: text})
    warning = lens.warning(max_error)
    return ExportedFiles(
        files=[goal],
        record={"file": goal, "format": to, **lens.as_record()},
        lines=tuple(printed(line, text) for line in lens.note[1:]),
        warnings=() if warning is None else (warning,),
    )


@as_command(
    "export",
    "Write the camera for OpenCV, ROS, Kalibr, COLMAP, mrcal and others.",
    "cubicfish export --to opencv --max-angle 89",
    "cubicfish export --to kalibr-omni -o camchain.yaml",
    "cubicfish export --to mrcal -m lens_a/camera.yaml",
    do=export_files,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(made: ExportedFiles, given: ExportOptions, how: How) -> None:
    """See ``_HELP``."""
    print_exported(made, how)


def print_exported(made: ExportedFiles, how: How) -> None:
    """Print the files that were written, and the errors of the conversion."""
    if how.print(made):
        return
    print_wrote(made.files)
    for line in made.lines:
        result(line)
    for line in made.warnings:
        print_message(f"warning: {line}")
