"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import ROUND_UP, Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli import __version__
from cubicfish_cli.cli import json_keys, options
from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import as_command, option, rig_path
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say, working
from cubicfish_cli.errors import FitError

if TYPE_CHECKING:
    from cubicfish_cli.fitting.conversion.to_lens import Conversion
    from cubicfish_cli.formats.camera_yaml import CameraFile
    from cubicfish_cli.formats.foreign import Poses

# Those of formats.foreign, here so that --help need not load numpy; a test holds them together.
FORMATS = (
    "opencv", "ros", "kalibr-pinhole-equi", "kalibr-omni", "kalibr-eucm", "kalibr-ds",
    "ocamcalib", "pyocamcalib", "colmap", "colmap-thin-prism-fisheye",
    "colmap-rad-tan-thin-prism-fisheye", "colmap-eucm", "nerfstudio", "gyroflow", "nvidia",
    "mrcal", "maps", "usd",
)  # fmt: skip

# Of formats of one tool, the one that follows decentred lenses best.
_NEAREST = {"colmap": "colmap-rad-tan-thin-prism-fisheye", "kalibr": "kalibr-omni"}
# Formats whose files take no comment.
_NO_COMMENTS = ("pyocamcalib",)
_BEHIND_DEG = 90.0
_USD = Path("usd")

_HELP = """Write the camera for another tool, and say how near its lens model comes.

\b
opencv                             K and D of cv2.fisheye, YAML
ros                                camera_info.yaml
kalibr-pinhole-equi                camchain.yaml
kalibr-omni                        camchain.yaml; the nearest of Kalibr's
kalibr-eucm                        camchain.yaml
kalibr-ds                          camchain.yaml
ocamcalib                          calib_results.txt
pyocamcalib                        calibration.json
colmap                             cameras.txt; OPENCV_FISHEYE
colmap-thin-prism-fisheye          cameras.txt
colmap-rad-tan-thin-prism-fisheye  cameras.txt; the nearest of COLMAP's
colmap-eucm                        cameras.txt
nerfstudio                         transforms.json, with poses
gyroflow                           lens_profile.json
nvidia                             rig.json; f-theta
mrcal                              .cameramodel; holds any lens
maps                               .npz for cv2.remap; holds any lens
usd                                .usda and .exr in a folder; holds any lens

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
@options.argument(
    "calibration",
    "The folder that calibrate or rig wrote, or the camera's or the rig's file. [default: --model]",
    required=False,
    metavar="[CAMERA|RIG]",
)
@option(
    "--to FORMAT",
    "What to write: a name of the list above.",
    click.Choice(FORMATS),
    to="name",
    required=True,
)
@options.output_option("Where it goes. [default: the format's usual name, in the current folder]")
@options.model_option
@option(
    "--max-error PX",
    "Write nothing when the format's lens is farther than this from the camera anywhere up "
    "to where the calibration's corners reach. Beyond, the error is printed alone.",
    FloatRange(min=0, min_open=True),
    0.5,
)
@option(
    "--max-angle DEG",
    "Leave out of the conversion what is farther from the axis, so that the rest is met more "
    "nearly. [default: the whole field]",
    FloatRange(min=0, max=180, min_open=True),
)
@options.pair_option
@options.overwrite_option
@options.json_option(json_keys.EXPORT)
def command(
    calibration: Path | None,
    name: str,
    output: Path | None,
    model: Path | None,
    max_error: float,
    max_angle: float | None,
    pair: tuple[str, str] | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.files import refuse_existing, write_text
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.formats.foreign import FILE_NAMES, foreign_text

    rig = rig_path(calibration or model)
    if rig is not None:
        _export_rig(rig, name, output, max_error, max_angle, pair, overwrite, as_json)
        return
    if pair is not None:
        raise click.UsageError("--pair names two cameras of a rig: name the rig.yaml")
    if name == "usd":
        from cubicfish_cli.cli.export_usd import write_usd

        alone = load_camera(options.model_path(calibration or model)).camera
        write_usd(
            output or _USD,
            [("camera", alone, None)],
            None,
            max_error=max_error,
            overwrite=overwrite,
            as_json=as_json,
        )
        return
    path = output or Path(FILE_NAMES.get(name, "undistort_map.npz"))
    refuse_existing(path, overwrite=overwrite)
    loaded = load_camera(options.model_path(calibration or model))
    if name == "maps":
        _write_map(path, loaded.camera, overwrite=overwrite, as_json=as_json)
        return
    with working("Fitting the other lens"):
        conversion, note = _converted(loaded, name, max_error, max_angle)
    text = foreign_text(name, conversion.record, note, _poses(loaded.fit, conversion))
    write_text(path, text, overwrite=overwrite)
    if as_json:
        print_json({"file": str(path), "format": name, **_record(conversion)})
        return
    result(f"wrote {path}")
    for line in note[1:]:
        result(_without_matrix(line) if name not in _NO_COMMENTS else line)
    _warn_beyond(conversion, max_error)


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
    from cubicfish_cli.files import refuse_existing, write_files
    from cubicfish_cli.formats.foreign import RIG_FILE_NAMES, rig_texts
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rig_files import ConvertedCamera, lens_rig

    rig = load_rig(path)
    chosen = rig.cameras if pair is None else tuple(map(rig.camera, pair))
    if name == "usd":
        from cubicfish_cli.cli.export_usd import write_usd

        write_usd(
            output or _USD,
            [(one.name, one.camera, (one.rotation, one.translation)) for one in chosen],
            rig.units,
            max_error=max_error,
            overwrite=overwrite,
            as_json=as_json,
        )
        return
    if name not in RIG_FILE_NAMES:
        one = path.parent / rig.cameras[0].path
        raise click.UsageError(
            f"--to {name} holds one camera: name one of the rig's, such as {one}, or choose one of "
            + ", ".join([*RIG_FILE_NAMES, "usd"])
        )
    goal = output or Path(RIG_FILE_NAMES[name])
    converted = []
    with working("Fitting the other lenses"):
        for camera in chosen:
            try:
                conversion, note = _converted(camera.file, name, max_error, max_angle)
            except FitError as problem:
                raise FitError(f"camera {camera.name}: {problem}") from problem
            converted.append(ConvertedCamera(camera=camera, conversion=conversion, note=note))
    texts = rig_texts(name, lens_rig(rig, converted), goal)
    refuse_existing(*texts, overwrite=overwrite)
    written = write_files(texts, overwrite=overwrite)
    if as_json:
        records = [{"name": one.camera.name, **_record(one.conversion)} for one in converted]
        print_json({"files": list(map(str, written)), "format": name, "cameras": records})
        return
    print_wrote(written)
    for own in converted:
        result(f"{own.camera.name}: {own.note[1]}")
        for line in own.note[2:]:
            result("  " + _without_matrix(line))
        _warn_beyond(own.conversion, max_error, f"camera {own.camera.name}: ")


def _converted(
    loaded: CameraFile, name: str, max_error: float, max_angle: float | None
) -> tuple[Conversion, list[str]]:
    """A camera as the format's lens, and how it was made, in lines.

    Raises:
        FitError: the lens is farther from the camera than that.

    """
    from cubicfish_cli.fitting.conversion.to_lens import to_lens
    from cubicfish_cli.formats.foreign import LENS_OF

    conversion = to_lens(
        loaded.camera,
        LENS_OF[name],
        max_angle_deg=max_angle,
        covered_deg=_covered_deg(loaded.fit),
    )
    if not conversion.error.max_px <= max_error:
        raise FitError(_too_far(conversion, name, max_error))
    trusted = min(max_angle or 180.0, loaded.camera.max_angle_deg)
    return conversion, _note(conversion, name, loaded.made_by, trusted)


def _record(conversion: Conversion) -> dict[str, Any]:
    """The lens and its errors, for JSON."""
    return {
        "lens": conversion.record.model,
        **conversion.error.as_record(),
        "turned_deg": conversion.turned_deg,
        "lens_from_camera": conversion.lens_from_camera,
    }


def _warn_beyond(conversion: Conversion, max_error: float, whose: str = "") -> None:
    error = conversion.error
    if error.beyond is not None and not error.beyond["max_px"] <= max_error:
        start = error.beyond["from_deg"]
        say(
            f"warning: {whose}beyond {start:.1f}°, where no corner was, {_figures(error.beyond)}: "
            f"do not rely on it there, or leave that out with --max-angle {start:.1f}"
        )


def _without_matrix(line: str) -> str:
    """A line of the note as it is told: numbers for programs stay in the file."""
    before, named, _ = line.partition("; lens_from_camera: ")
    return f"{before}: lens_from_camera is in the file" if named else line


def _write_map(path: Path, camera: Any, *, overwrite: bool, as_json: bool) -> None:
    from cubicfish_cli.undistortion.maps import build_map, save_map
    from cubicfish_cli.undistortion.views import default_view

    if path.suffix.lower() != ".npz":
        raise click.UsageError(f"{path}: --to maps writes .npz; 'cubicfish map' writes others")
    view = default_view(camera)
    save_map(path, build_map(camera, view), overwrite=overwrite)
    if as_json:
        print_json({"file": str(path), "format": "maps"})
    else:
        result(f"wrote {path}")


def _covered_deg(fit: Mapping[str, Any]) -> float | None:
    """How far corners reached, where the camera's file says so."""
    value = fit.get("covered_deg")
    return float(value) if isinstance(value, int | float) else None


def _figures(figures: Mapping[str, float]) -> str:
    if figures["max_px"] == float("inf"):
        return "the lens does not see all of it"
    return f"RMS {figures['rms_px']:.4f} px, largest {figures['max_px']:.4f} px"


def _note(
    conversion: Conversion, name: str, made_by: Mapping[str, Any], trusted_deg: float
) -> list[str]:
    """How the lens was made, in lines."""
    from cubicfish_cli.formats.foreign import FRONT_ONLY, OWN_FIELD

    error = conversion.error
    when = f" of {made_by['date']}" if made_by.get("date") else ""
    lines = [
        f"cubicfish {__version__}: the lens nearest to a cubic camera{when}",
        f"conversion error: RMS {error.rms_px:.4f} px, largest {error.max_px:.4f} px, up to "
        f"{error.max_angle_deg:.1f} degrees from the axis",
    ]
    farthest = error.max_angle_deg
    if error.beyond is not None:
        farthest = error.beyond["to_deg"]
        lines.append(
            f"from there to {farthest:.1f} degrees, where no corner was: {_figures(error.beyond)}"
        )
    lines += [f"{way}: {_figures(figures)}" for way, figures in error.also.items()]
    lines.append(f"{OWN_FIELD} {trusted_deg:.3f} degrees from the axis")
    if farthest >= _BEHIND_DEG and name in FRONT_ONLY:
        lines.append(f"{FRONT_ONLY[name]} itself sees nothing at 90 degrees from the axis or more")
    if conversion.turned_deg > 0:
        turn = " ".join(f"{value:.8f}" for value in conversion.lens_from_camera.ravel())
        lines.append(
            f"the frame is turned by {conversion.turned_deg:.3f} degrees; lens_from_camera: {turn}"
        )
    return lines


def _too_far(conversion: Conversion, name: str, max_error: float) -> str:
    error = conversion.error
    good = [ring for ring in error.by_angle if ring["max_px"] <= max_error]
    bad = [ring for ring in error.by_angle if ring["max_px"] > max_error]
    largest = "everything" if error.max_px == float("inf") else f"{error.max_px:.2f} px"
    ways = []
    if good and bad and max(r["to_deg"] for r in good) <= min(r["from_deg"] for r in bad):
        ways.append(f"try --max-angle {max(r['to_deg'] for r in good):.0f}")
    if error.max_px < float("inf"):
        ways.append(f"raise it to {_rounded_up(error.max_px)}")
    others = "mrcal, maps or usd, which hold any lens"
    nearest = _NEAREST.get(name.split("-")[0], name)
    if nearest != name:
        others = f"{nearest}, which comes nearer to most, or to {others}"
    ways.append(f"export to {others}")
    return (
        f"the lens of {name} misses the camera by up to {largest} (RMS {error.rms_px:.2f} px up "
        f"to {error.max_angle_deg:.0f}°), more than the {max_error:g} px of --max-error: "
        f"{' or '.join(ways)}"
    )


def _rounded_up(value: float) -> str:
    """To two digits, and no less: what ``--max-error`` takes is what is written here."""
    step = Decimal(1).scaleb(Decimal(value).adjusted() - 1)
    return f"{Decimal(value).quantize(step, ROUND_UP).normalize():f}"


def _poses(fit: Mapping[str, Any], conversion: Conversion) -> Poses:
    """camera_from_world of the calibration's photos, in the lens's frame."""
    from cubicfish_cli.fitting.statistics import poses_on_record
    from cubicfish_cli.rendering.pose import rotation_matrix

    turn = conversion.lens_from_camera
    return {
        name: (turn @ rotation_matrix(vector), turn @ translation)
        for name, (vector, translation) in poses_on_record(fit).items()
    }
