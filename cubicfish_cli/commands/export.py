"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish import Run, UsageError, did_you_mean, quoted
from cubicfish.files import StrPath
from cubicfish_cli.core_table import CALIBRATION_FILES, MAPS
from cubicfish_cli.extension_guard import Place, written_formats
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import (
    DEFAULT_MODEL,
    FloatRange,
    as_command,
    option,
    record,
)
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, print_table, print_wrote, result

# Maps have no lens model, and so are not among the registered formats.
FORMATS = {
    **{name: one.written[name]["what"] for name, one in written_formats().items()},
    MAPS: ".npz for cv2.remap; holds any lens",
}

_HELP = f"""Write the camera for another tool, and say how near its lens model comes.

\b
{chr(10).join(f"{name:<35}{what}" for name, what in FORMATS.items())}

What is exact holds the camera itself, in a file that needs no other. The lens of each other format
is fitted to the camera over its field, in pixels. What it loses (the RMS) is printed first, with
the camera's own held-out error beside it and what loses less; --compare says it of all formats. It
holds up to where the calibration's corners reach. Beyond, the camera is extrapolated, and the error
there is stated apart. A camera that was imported has no corners: there the whole field counts. What
loses more than 0.5 px and more than the held-out error is not written.

These lenses have one centre, while a fisheye's entrance pupil travels: they hold for things at one
distance. opencv, ros, kalibr, ocamcalib and anipose, whose programs look at boards, are fitted for
things as near as the calibration's boards, the others for distant ones. --distance says otherwise.

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
        max_error: as for :func:`export_camera`.
        max_angle_deg: as for :func:`export_camera`.

    """

    to: str | None = option(
        "--to FORMAT", "What to write: a name of the list above.", parameters.Choice(list(FORMATS))
    )
    output: StrPath | None = parameters.output_option(
        "Where it goes. [default: the camera's title or folder and the format, in the current "
        "folder]",
        folder=None,
    )
    max_error: float | None = option(
        "--max-error PX",
        "Write nothing if the format's lens is farther than this from the camera anywhere up to "
        "where the calibration's corners reach. Beyond, the error is only printed. [default: what "
        "loses 0.5 px RMS, or no more than the held-out error, is written]",
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
        distance: as for :func:`export_camera`.
        compare: write nothing, and say what each format loses.

    """

    camera: StrPath = parameters.camera_options
    name: str | None = option(
        "--name NAME",
        "What the functions of source text begin with, and by default the name of its file. "
        "[default: camera]",
    )
    distance: str | None = option(
        "--distance far|boards|LENGTH",
        "How far away the things are that the lens is for: distant, as near as the calibration's "
        "boards, or such as 2m. [default: the format's own, see above]",
    )
    compare: bool = option("--compare", "Write nothing, and print what each format loses.")


@dataclass(frozen=True, kw_only=True, eq=False)
class ExportedFiles:
    """Result of :func:`export_files`.

    Attributes:
        files: the files that were written.
        record: plain data: what ``cubicfish export --json`` prints.
        cost: what the lens loses, and what loses less, in a line; "" where nothing is lost.
        lines: the errors of the conversion, for people.
        table: what each format loses: cells for people, the first row of titles.
        warnings: what not to rely on.

    """

    files: list[Path]
    record: dict[str, Any]
    cost: str = ""
    lines: tuple[str, ...] = ()
    table: tuple[tuple[str, ...], ...] = ()
    warnings: tuple[str, ...] = ()

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish export --json`` prints.

        Keys:
            file: what was written
            format: its format
            formats: with --compare, instead of the rest: a record a format, with its name and the
                keys from lens to beyond, where some lens is near
            lens: the format's lens model (this and the rest not where the camera is held as it is)
            rms_px: the RMS of the conversion: what is lost
            max_px: its largest error
            max_angle_deg: the angle up to which these hold: how far corners reached
            by_angle: a record a ring about the axis: from_deg, to_deg, rms_px, max_px
            also: the errors in other ways of reading the file, where there are any
            beyond: from_deg, to_deg, rms_px and max_px of the field where no corner was, if any
            held_out_rms_px: the camera's own held-out error
            times_held_out: the loss over that
            distance: of the things that the lens is for, in the camera's unit; null: distant ones
            distant: rms_px and max_px of distant things, where it is not for these
            turned_deg: how far the frame was turned
            lens_from_camera: that turn, a 3x3 matrix
            place: where the lens is in the camera's frame, in its unit

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
    from cubicfish_cli.commands.exporting import export_camera
    from cubicfish_cli.words.export import printed

    path = in_folder(Path(options.camera))
    if options.compare or options.to is None:
        return _compare(options, path, run)
    to, formats = options.to, written_formats()
    is_exact = _find_whether_exact(to, options)
    plan = Plan(run).reads(path)
    loaded = load_camera(path)
    usual = Path(CALIBRATION_FILES["map"] if to == MAPS else formats[to].file_name)
    goal = Path(options.output or _usual_name(usual, to, options.name, loaded.title or path))
    plan.writes(goal)
    if to == MAPS:
        if goal.suffix.lower() != ".npz":
            raise UsageError(f"{goal}: --to maps writes .npz; 'cubicfish map' writes others")
        save_map(goal, build_map(loaded.camera, build_view(loaded.camera)), overwrite=run.overwrite)
        return ExportedFiles(files=[goal], record={"file": goal, "format": to})
    if is_exact:
        write = Place(formats[to].extension, formats[to].write).load()
        plan.write({goal: write(loaded, to, options.name)})
        return ExportedFiles(files=[goal], record={"file": goal, "format": to})
    run.listener.progress("Fitting the other lens")
    lens = export_camera(
        loaded,
        to,
        max_error=options.max_error,
        max_angle_deg=options.max_angle_deg,
        distance=options.distance,
    )
    text = lens.text
    plan.write({goal: text})
    return ExportedFiles(
        files=[goal],
        record={"file": goal, "format": to, **lens.as_record()},
        cost=lens.cost(),
        lines=tuple(printed(line, text) for line in lens.note[1:]),
        warnings=() if lens.warning is None else (lens.warning,),
    )


def _find_whether_exact(to: str, options: ExportOptions) -> bool:
    """Whether a format holds the camera itself.

    Raises:
        UsageError: there is no such format, or an option is of others.

    """
    formats = written_formats()
    if to != MAPS and to not in formats:
        suggestion = did_you_mean(to, sorted({MAPS, *formats}))
        raise UsageError(f"no format is called {quoted(to)}: {suggestion}")
    is_exact = to == MAPS or formats[to].exact
    for name, given in (
        ("--max-error", options.max_error),
        ("--max-angle", options.max_angle_deg),
        ("--distance", options.distance),
    ):
        if is_exact and given is not None:
            raise UsageError(f"{name} is of lens models: --to {to} holds the camera as it is")
    if options.name is not None and (to == MAPS or not is_exact):
        raise UsageError(f"--name is of functions, and --to {to} writes none")
    return is_exact


def _usual_name(usual: Path, to: str, name: str | None, known: str | Path) -> Path:
    """What a file is called by default.

    Args:
        usual: the format's name for a camera that has none.
        to: the format.
        name: what the user calls its functions.
        known: what the camera is called, or its file: its folder's name, but for that in which
            'cubicfish calibrate' writes unless told otherwise.

    """
    if isinstance(known, Path):
        whole = known.resolve()
        known = whole.parent.name if known.name == CALIBRATION_FILES["camera"] else known.stem
        known = "" if known == DEFAULT_MODEL.parent.name else known
    if name is not None:
        return usual.with_stem(name)
    own = re.sub(r"\W+", "_", known).strip("_")
    if not own:
        return usual
    first, _, rest = usual.name.partition(".")
    return Path(f"{own}.{rest}" if first == "camera" else f"{own}.{to}{usual.suffix}")


def _compare(options: ExportOptions, path: Path, run: Run) -> ExportedFiles:
    """Say what each format loses."""
    from cubicfish import load_camera
    from cubicfish_cli.commands.exporting import Wish, compare_formats, list_exact
    from cubicfish_cli.words.export import comparison_rows

    if not options.compare:
        raise UsageError("what is to be written? Name a format with --to, or --compare them")
    for name, given in (
        ("--to", options.to),
        ("--output", options.output),
        ("--max-error", options.max_error),
        ("--name", options.name),
        ("--overwrite", run.overwrite or None),
    ):
        if given is not None:
            raise UsageError(f"--compare writes nothing: leave out {name}")
    wish = Wish(
        calibrated=load_camera(path),
        max_angle_deg=options.max_angle_deg,
        distance=options.distance,
    )
    found = compare_formats(wish)
    records = [{"format": name} for name in list_exact()] + [
        {"format": to, **({} if made is None else wish.loss_record(made))} for to, made in found
    ]
    camera, held_out = wish.calibrated.camera, wish.calibrated.fit.held_out_rms_px
    rows = comparison_rows(found, list_exact(), held_out, camera.units)
    return ExportedFiles(files=[], record={"formats": records}, table=rows)


@as_command(
    "export",
    "Export the camera to OpenCV, ROS, Kalibr, COLMAP and others.",
    "cubicfish export --to opencv --max-angle 89",
    "cubicfish export --to kalibr-omni -o camchain.yaml",
    "cubicfish export --to mrcal -m lens_a/camera.yaml",
    "cubicfish export --compare",
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
    if made.table:
        print_table(made.table[0], made.table[1:])
    if made.cost:
        result(made.cost)
    print_wrote(made.files)
    for line in made.lines:
        result(line)
    for line in made.warnings:
        print_message(f"warning: {line}")
