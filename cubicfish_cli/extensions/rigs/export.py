"""``cubicfish rig export``: the cameras of a rig, and where they stand, for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import FitError, Run, UsageError
from cubicfish.files import StrPath, write_files
from cubicfish_cli.commands.export import LensOptions, print_exported
from cubicfish_cli.extension_guard import Place, written_formats
from cubicfish_cli.extensions.rigs.options import pair_option, rig_argument
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.words.phrases import shell_line

if TYPE_CHECKING:
    from cubicfish import Rig
    from cubicfish_cli.commands.export import ExportedFiles
    from cubicfish_cli.extension_table import CameraFormat

_HELP = """Write a rig for another tool: each camera's lens with its place on the body.

\b
opencv      stereo.opencv.yaml of two: M1, D1, M2, D2, R, T; R1, R2, P1, P2, Q for flat pictures
ros         a folder: a camera_info.yaml a camera, static_transforms.yaml, rig.urdf (metres)
kalibr-...  one camchain.yaml (metres)
colmap...   rig_config.json
mrcal       a folder: a .cameramodel a camera (metres)
nerfstudio  one transforms.json
anipose...  one calibration.toml (metres)

Each lens is fitted to its camera as by 'cubicfish export', whose help says more.
"""


@record
class RigExportOptions(LensOptions):
    """The cameras of a rig, written for another tool.

    Attributes:
        rig: its rig.yaml, or the folder of that.
        pair: two of its cameras; by default all.

    """

    rig: StrPath = rig_argument
    pair: tuple[str, str] | None = pair_option


def export_rig_files(options: RigExportOptions, *, run: Run = Run()) -> ExportedFiles:
    """Write all cameras of a rig, or two, with their places, as ``cubicfish rig export`` does.

    Raises:
        UsageError: the format holds no rigs.
        FitError: there is no such format, or its lens is too far from a camera.
        CubicfishError: a file cannot be used, or exists and may not be replaced.

    Keys:
        files: all that was written
        format: its format
        cameras: a record per camera: its name, and the keys of 'cubicfish export' from lens on

    """
    from cubicfish import load_rig
    from cubicfish_cli.commands.export import ExportedFiles
    from cubicfish_cli.commands.exporting import FAR, export_camera
    from cubicfish_cli.extensions.rigs.lens_rig import lens_rig
    from cubicfish_cli.words.export import printed

    if options.to is None:
        raise UsageError("what is to be written? Name a format with --to")
    known = load_rig(options.rig)
    chosen = known.cameras if options.pair is None else tuple(map(known.camera, options.pair))
    to, write_as = options.to, _find_format(options.to, known)
    run.listener.progress("Fitting the other lenses")
    goal, made = Path(options.output or write_as.rig_name), []
    for one in chosen:
        try:
            own = export_camera(
                one,
                to,
                max_error=options.max_error,
                max_angle_deg=options.max_angle_deg,
                distance=FAR,
            )
        except FitError as problem:
            raise problem.amid(f"camera {one.name}: ") from problem
        made.append((one, own))
    write = Place(write_as.extension, write_as.write_rig).load()
    text = write(lens_rig(known, made))
    texts = {goal: text} if isinstance(text, str) else {goal / n: one for n, one in text.items()}
    Plan(run).reads(known.files).writes(*texts)
    written = write_files(texts, overwrite=run.overwrite, folder=goal)
    lines: list[str] = []
    for one, lens in made:
        lines += [f"{one.name}: {lens.cost()}", f"  {lens.note[1]}"]
        lines += [f"  {printed(line, *texts.values())}" for line in lens.note[2:]]
    warnings = [(one.name, lens.warning) for one, lens in made]
    records = [{"name": one.name, **lens.as_record()} for one, lens in made]
    return ExportedFiles(
        files=written,
        record={"files": written, "format": to, "cameras": records},
        lines=tuple(lines),
        warnings=tuple(f"camera {name}: {text}" for name, text in warnings if text is not None),
    )


def _find_format(to: str, rig: Rig) -> CameraFormat:
    """The format of a name that holds rigs.

    Raises:
        UsageError: there is none.

    """
    formats = {name: made for name, made in written_formats().items() if made.write_rig}
    if to not in formats:
        each = shell_line("cubicfish", "export", rig.files[1], "--to", to)
        raise UsageError(
            f"--to {to} holds one camera: choose one of {', '.join(formats)}, or write each with "
            + each
        )
    return formats[to]


@as_command(
    "export",
    "Write a rig for OpenCV, ROS, Kalibr, COLMAP, mrcal and others.",
    "cubicfish rig export --to kalibr-omni -o camchain.yaml",
    "cubicfish rig export rig/rig.yaml --to opencv --pair left,right",
    do=export_rig_files,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(made: ExportedFiles, given: RigExportOptions, how: How) -> None:
    """See ``_HELP``."""
    print_exported(made, how)
