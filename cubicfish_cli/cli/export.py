"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import as_command, option, record, rig_path
from cubicfish_cli.cli.progress import listening, working
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say
from cubicfish_cli.formats.registry import WRITTEN

if TYPE_CHECKING:
    from cubicfish_cli.formats.camera_format import Pose
    from cubicfish_cli.lenses.cubic import CubicCamera
    from cubicfish_cli.library.exporting import Exported

# Of no lens model, and so not among the registered formats.
_MAPS = {
    "maps": ".npz for cv2.remap; holds any lens",
    "usd": ".usda and .exr in a folder; holds any lens",
}
FORMATS = {**WRITTEN, **_MAPS}

_HELP = f"""Write the camera for another tool, and say how near its lens model comes.

\b
{chr(10).join(f"{name:<35}{what}" for name, what in FORMATS.items())}

Of a rig.yaml each camera's lens is written with its place on the body: opencv as stereo.opencv.yaml
with R, T and, for flat pictures, R1, R2, P1, P2 and Q; ros as a folder of camera_info.yaml, static
transforms and URDF; Kalibr's as one camchain.yaml; COLMAP's as rig_config.json; nerfstudio's as one
transforms.json; nvidia as one rig.json; mrcal as a folder of .cameramodel. ros, Kalibr's, nvidia
and mrcal are in metres.

None of these formats holds a 3x20 matrix: each one's own lens is fitted to the camera over its
field, in pixels. The RMS, the largest error and the angle up to which they hold are printed,
and written into the file where it takes comments. They count up to where the calibration's
corners reach; the last degrees of the field are a guess of the camera's own, and their error is
stated apart. A camera that was imported has no corners: its whole field counts.

Most programs read OPENCV_FISHEYE, which colmap writes; colmap-rad-tan-thin-prism-fisheye needs
COLMAP 3.11 or newer.

Symmetric lens models get the frame in which the camera looks most symmetric; the turn from
camera.yaml's frame is printed, and poses that go into the file are turned along.
"""


@record
class Asked:
    """What is asked of ``cubicfish export``."""

    calibration: Path | None = options.argument(
        "The folder that calibrate or rig wrote, or the camera's or the rig's file. "
        "[default: --model]",
        required=False,
        metavar="[CAMERA|RIG]",
    )
    name: str = option(
        "--to FORMAT",
        "What to write: a name of the list above.",
        click.Choice(list(FORMATS)),
        required=True,
    )
    output: Path | None = options.output_option(
        "Where it goes. [default: the format's usual name, in the current folder]"
    )
    model: Path | None = options.model_option
    max_error: float = option(
        "--max-error PX",
        "Write nothing when the format's lens is farther than this from the camera anywhere up "
        "to where the calibration's corners reach. Beyond, the error is printed alone.",
        FloatRange(min=0, min_open=True),
        0.5,
    )
    max_angle: float | None = option(
        "--max-angle DEG",
        "Leave out of the conversion what is farther from the axis, so that the rest is met more "
        "nearly. [default: the whole field]",
        FloatRange(min=0, max=180, min_open=True),
    )
    pair: tuple[str, str] | None = options.pair_option
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("export")


@as_command(
    "export",
    "The camera for OpenCV, ROS, Kalibr, COLMAP, mrcal and others.",
    "cubicfish export --to opencv",
    "cubicfish export --to kalibr-ds -o camchain.yaml --max-angle 90",
    "cubicfish export --to mrcal -m lens_a/camera.yaml",
    "cubicfish export rig/rig.yaml --to kalibr-omni -o camchain.yaml",
    "cubicfish export rig --to opencv --pair left,right",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.files import refuse_existing, write_files
    from cubicfish_cli.formats import foreign
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.formats.foreign import FILE_NAMES
    from cubicfish_cli.library.exporting import export_camera
    from cubicfish_cli.undistortion.maps import build_map, save_map
    from cubicfish_cli.undistortion.views import default_view

    rig = rig_path(given.calibration or given.model)
    if rig is not None:
        _export_rig(
            rig,
            given.name,
            given.output,
            given.max_error,
            given.max_angle,
            given.pair,
            given.overwrite,
            given.as_json,
        )
        return
    if given.pair is not None:
        raise click.UsageError("--pair names two cameras of a rig: name the rig.yaml")
    path = given.output or Path(FILE_NAMES.get(given.name, "undistort_map.npz"))
    if given.name != "usd":
        refuse_existing(path, overwrite=given.overwrite)
    loaded = load_camera(options.model_path(given.calibration or given.model))
    if given.name == "usd":
        _write_usd(
            given.output,
            [("camera", loaded.camera, None)],
            None,
            given.max_error,
            given.overwrite,
            given.as_json,
        )
        return
    if given.name == "maps":
        if path.suffix.lower() != ".npz":
            raise click.UsageError(f"{path}: --to maps writes .npz; 'cubicfish map' writes others")
        made = build_map(loaded.camera, default_view(loaded.camera))
        save_map(path, made, overwrite=given.overwrite)
        if given.as_json:
            print_json({"file": path, "format": "maps"})
        else:
            print_wrote([path])
        return
    with working("Fitting the other lens"):
        lens = export_camera(
            loaded, given.name, max_error=given.max_error, max_angle_deg=given.max_angle
        )
    write_files({path: lens.text}, overwrite=given.overwrite)
    if given.as_json:
        print_json({"file": path, "format": given.name, **lens.as_record()})
        return
    print_wrote([path])
    for line in lens.note[1:]:
        result(_without_matrix(line) if foreign.WRITTEN[given.name].comments else line)
    _warn(lens, given.max_error)


def _export_rig(
    path: Path,
    name: str,
    output: Path | None,
    max_error: float,
    max_angle: float | None,
    pair: tuple[str, str] | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write all cameras of a rig, or two of them, with their places."""
    from cubicfish_cli.files import write_files
    from cubicfish_cli.formats.foreign import RIG_FILE_NAMES
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.exporting import exported_rig

    rig = load_rig(path)
    chosen = rig.cameras if pair is None else tuple(map(rig.camera, pair))
    if name == "usd":
        placed = [(one.name, one.camera, (one.rotation, one.translation)) for one in chosen]
        _write_usd(output, placed, rig.units, max_error, overwrite, as_json)
        return
    if name not in RIG_FILE_NAMES:
        one = path.parent / rig.cameras[0].path
        raise click.UsageError(
            f"--to {name} holds one camera: name one of the rig's, such as {one}, or choose one of "
            + ", ".join([*RIG_FILE_NAMES, "usd"])
        )
    goal = output or Path(RIG_FILE_NAMES[name])
    with working("Fitting the other lenses"):
        lenses, texts = exported_rig(
            rig, chosen, name, goal, max_error=max_error, max_angle_deg=max_angle
        )
    written = write_files(texts, overwrite=overwrite)
    if as_json:
        records = [{"name": camera, **lens.as_record()} for camera, lens in lenses.items()]
        print_json({"files": written, "format": name, "cameras": records})
        return
    print_wrote(written)
    for camera, lens in lenses.items():
        result(f"{camera}: {lens.note[1]}")
        for line in lens.note[2:]:
            result("  " + _without_matrix(line))
        _warn(lens, max_error, f"camera {camera}: ")


def _write_usd(
    output: Path | None,
    cameras: Sequence[tuple[str, CubicCamera, Pose | None]],
    units: str | None,
    max_error: float,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write cameras as tables, which hold any lens, into a folder."""
    from cubicfish_cli.files import refuse_existing, write_files
    from cubicfish_cli.library.exporting import usd_files, usd_paths
    from cubicfish_cli.undistortion.map_formats import require_exr

    folder = output or Path("usd")
    paths = usd_paths(folder, [name for name, *_ in cameras])
    refuse_existing(*paths, overwrite=overwrite)
    require_exr(paths[1])
    with listening() as listener:
        files, made = usd_files(folder, cameras, units, max_error=max_error, listener=listener)
    written = write_files(files, overwrite=overwrite)
    if as_json:
        records = [
            {
                "name": name,
                "rms_px": made[name][0].rms_px,
                "max_px": made[name][0].max_px,
                "max_angle_deg": camera.max_angle_deg,
            }
            for name, camera, _ in cameras
        ]
        print_json({"files": written, "format": "usd", "cameras": records})
        return
    print_wrote(written)
    for name, (_, error) in made.items():
        result(f"{name}: {error}")


def _warn(lens: Exported, max_error: float, whose: str = "") -> None:
    warning = lens.warning(max_error)
    if warning is not None:
        say(f"warning: {whose}{warning}")


def _without_matrix(line: str) -> str:
    """A line of the note as it is told: numbers for programs stay in the file."""
    before, named, _ = line.partition("; lens_from_camera: ")
    return f"{before}: lens_from_camera is in the file" if named else line
