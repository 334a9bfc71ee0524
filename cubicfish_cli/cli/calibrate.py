"""``cubicfish calibrate``: photos of a known target to a camera."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import (
    corners_by_board,
    count,
    fitted_rows,
    hold_gate,
    mark_of,
    print_errors,
    print_figure,
    print_models,
    print_photo_table,
    print_verdict,
    px,
    why_lost,
)
from cubicfish_cli.cli.options import (
    DEFAULT_MODEL,
    IntRange,
    as_command,
    option,
    record,
    target_options,
    verbosity,
)
from cubicfish_cli.cli.progress import call, say_left_out
from cubicfish_cli.cli.report import FitOptions, fit_options, say_if_no_page
from cubicfish_cli.cli.terminal import (
    apart,
    detail,
    print_json,
    print_table,
    print_wrote,
    result,
    say,
)
from cubicfish_cli.films import MOST
from cubicfish_cli.library.asked import check_inputs

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.fitting.calibration import Calibration
    from cubicfish_cli.fitting.climb import RefineTarget
    from cubicfish_cli.fitting.point_fit import PointCalibration
    from cubicfish_cli.library.asked import TargetSource
    from cubicfish_cli.library.calibration_files import CalibratedFiles

_LONGEST_TITLE = 100


@record
class Asked:
    """What is asked of ``cubicfish calibrate``."""

    inputs: tuple[Path, ...] = options.argument(
        "Photos (files, folders or globs), films, or one corners.csv or correspondences.csv.",
        nargs=-1,
        metavar="[PHOTOS|FILM|CSV]...",
    )
    target: TargetSource = target_options
    correspondences: Path | None = option(
        "--correspondences FILE",
        "2D-3D pairs instead of photos: a CSV file with the columns image,X,Y,Z,x,y.",
        options.FILE,
    )
    image_size: tuple[int, int] | None = options.size_option
    folder: Path = options.output_option(
        "Where camera.yaml, undistort_map.npz, corners.csv and report.html go.",
        default="calibration",
        folder=True,
    )
    title: str | None = option("--title TEXT", "What to call this camera, in its file and report.")
    refine_target: RefineTarget = options.refine_target_option(
        "Fit the target too: boards' shapes and places, or each corner's own place as well; "
        "auto goes as far as it lowers the held-out error."
    )
    hold_out: bool = option(
        "--hold-out/--no-hold-out",
        "Measure the error on photos left out of the fit (five more fits; "
        "--refine-target auto needs it).",
        default=True,
    )
    lift: Literal["ray", "point"] = option(
        "--lift",
        "What the cubics are of: the viewing ray, a camera for everything else here; or the 3D "
        "point itself, as the paper prints it, which holds only where the corners were.",
        click.Choice(["ray", "point"]),
        "ray",
    )
    best: int | None = option(
        "--best N",
        "Calibrate from those N of many photos that add most. [default: all photos, and of films "
        f"{MOST} frames]",
        IntRange(min=1),
    )
    compare: bool = option(
        "--compare", "Also fit other lens models to the same corners, and print one table."
    )
    fit: FitOptions = fit_options


@as_command(
    "calibrate",
    "Photos of a known target to a camera and its undistortion map.",
    "cubicfish calibrate photos/ --target target.yaml",
    "cubicfish calibrate photos/ --board 9x6 --square 25mm --title 'front left'",
    "cubicfish calibrate film.mp4 --target target.yaml",
    "cubicfish calibrate corners.csv --target target.yaml -o lens_a --max-rms 0.5",
    "cubicfish calibrate --correspondences pairs.csv --size 1280x800",
)
def command(given: Asked) -> None:
    """Calibrate a camera from PHOTOS (files, folders or globs) of the target in target.yaml.

    One flat checkerboard needs no file: --board 9x6 --square 25mm says it all. A corners.csv,
    from 'cubicfish detect' or any other detector, may stand for the photos. Of films, frames are
    chosen and kept in the folder, as 'cubicfish frames' does. Everything else is written together
    at the end, or nothing is. With --overwrite, what an earlier calibration left in the
    folder goes.
    """
    check_inputs(given.inputs, given.correspondences, given.target)
    from cubicfish_cli.fitting.calibration import Calibration
    from cubicfish_cli.library.calibration_files import calibrate_files

    title = given.title
    if title is not None and (
        not title.strip() or not title.isprintable() or len(title) > _LONGEST_TITLE
    ):
        raise click.UsageError(
            f"--title must be a line of plain text, of at most {_LONGEST_TITLE} characters"
        )
    made = call(calibrate_files, given)
    fitted = made.fitted
    if given.fit.as_json:
        print_json(made.as_record())
    say_left_out(fitted.unfit)
    if isinstance(fitted, Calibration):
        _say_findings(fitted, made.record)
    if not given.fit.as_json:
        apart()
        result(made.facts.line, mark=(made.verdict.words, made.verdict.level))
        if isinstance(fitted, Calibration):
            _print_calibration(made, fitted)
        else:
            _print_points(made, fitted)
    for path in made.removed:
        say(f"removed {path}, which was of an earlier calibration")
    say_if_no_page(made.files, wanted=given.fit.report)
    hold_gate(fitted.errors.rms_px, given.fit.max_rms)


def _say_findings(calibration: Calibration, record: Mapping[str, Any]) -> None:
    """Say what is odd about a fit, on stderr."""
    for corner in record["dropped_corners"]:
        detail(
            "dropped: {image} {board} column {column} row {row}: {error_px:.1f} px off".format(
                **corner
            )
        )
    for finding in calibration.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    for note in calibration.notes:
        say(f"note: {note}")
    for deformation in calibration.departures:
        for doubt in deformation.doubts:
            say(f"warning: board {deformation.board} seems {doubt.what}: {doubt.do}")


def _print_calibration(made: CalibratedFiles, calibration: Calibration) -> None:
    """The figures that the verdict rests on, the photos, what was written, and what to do next."""
    camera, pairs, detection = calibration.camera, calibration.pairs, made.inputs.detection
    print_verdict(made.verdict)
    result(f"advice: {made.advice}\n")
    _print_figures(calibration, made.record)
    lost = dict.fromkeys(calibration.unfit, "left out")  # lines on stderr say more
    lost |= why_lost(detection)
    rows = fitted_rows(made.record, camera.image_size, corners_by_board(pairs), lost)
    everything = str(made.files["camera"])
    print_photo_table(rows, pairs.boards, made.record, everything=everything, apart=True)
    result()
    _print_object(calibration)
    if made.models:
        print_models(made.models)
        result()
    print_wrote(made.files.values())
    used = {Path(name).name for name in pairs.images}
    photo = next((photo for photo in made.inputs.photos if photo.name in used), None)
    say_next(made.verdict, made.files["camera"], photo, made.files.get("report"))


def _print_figures(calibration: Calibration, record: Mapping[str, Any]) -> None:
    from cubicfish_cli.assess.uncertainty import recorded_uncertainty
    from cubicfish_cli.fitting.findings import COVERED
    from cubicfish_cli.frame_names import counted

    dropped = len(calibration.dropped)
    result(
        f"{counted(row['image'] for row in record['per_image'])}, "
        f"{count(record['corners'], 'corner')} used, "
        f"{count(dropped, 'outlier')}{' (-v lists them)' * bool(dropped)}\n"
    )
    held_out = calibration.held_out
    more: list[tuple[str, float | None, str]] = [
        ("  radial reference", calibration.companion_rms_px, "a Kannala–Brandt lens, same corners"),
    ]
    if held_out is None:
        more += [("held-out RMS", None, "not measured")]
    else:
        more += [
            ("held-out RMS", held_out.rms_px, "photos judged by cameras that never saw them"),
            ("  radial reference", held_out.companion_rms_px, ""),
        ]
    print_errors(record, more)
    reach = f"corners reach {calibration.covered_deg:.1f}°"
    meaning = f"from the axis, where the camera may be trusted; {reach}"
    print_figure("field", f"{calibration.camera.max_angle_deg:.1f}", "°", meaning)
    print_figure("coverage", f"{100 * calibration.coverage:.0f}", "%", COVERED)
    uncertainty = recorded_uncertainty(record)
    if uncertainty is not None:
        print_figure("uncertainty", px(uncertainty.median_px), meaning=uncertainty.meaning)
    print_figure("entrance pupil", px(calibration.pupil.rim_px), meaning=calibration.pupil.meaning)


def _print_object(calibration: Calibration) -> None:
    """Say in one line per board what was found of the target, where any of it was fitted."""
    if not calibration.departures or calibration.target is None:
        return
    units = calibration.target.units
    what = {"shape": "boards' shapes and places", "points": "shapes, places and single corners"}
    levels = {"off": "as drawn", "shape": "shapes", "points": "corners too"}
    tried = ", ".join(
        f"{levels[level]} {px(rms)}" for level, rms in calibration.held_out_by_level.items()
    )
    result(
        f"target fitted too: {what[calibration.refined]}"
        + f" (held-out error px: {tried})" * bool(tried)
    )
    if calibration.renamed:
        photos = count(len(calibration.renamed), "photo")
        result(f"corners counted from the other end in {photos}, as the board's shape tells")
    print_table(
        ("board", f"bend x {units}", f"bend y {units}", f"twist {units}", "stretch x %",
         "stretch y %", f"moved {units}", "turned °", f"corners {units}"),
        [
            (
                part.board,
                *(f"{bend:.2g}" for bend in part.bend),
                f"{part.twist:.2g}",
                *(f"{100 * share:.2f}" for share in part.stretch),
                f"{part.shift:.2g}",
                f"{part.turn_deg:.2f}",
                f"{part.offset_rms:.2g}",
            )
            for part in calibration.departures
        ],
    )  # fmt: skip
    result()


def _print_points(made: CalibratedFiles, calibration: PointCalibration) -> None:
    """Print the photos, the errors, what P means and what was written."""
    camera, pairs, record = calibration.camera, calibration.pairs, made.record
    rows = fitted_rows(record, camera.image_size, corners_by_board(pairs), {})
    print_photo_table(rows, pairs.boards, record)
    result(
        f"\n{count(record['images'], 'photo')}, {count(record['corners'], 'corner')} used, "
        f"{record['dropped']} dropped\n"
    )
    print_errors(
        record,
        [
            ("  linear, plain", calibration.plain_rms_px, "Eq. 8 and 9"),
            ("  linear, reweighted", calibration.reweighted_rms_px, "over its denominators"),
            (
                "held-out RMS",
                calibration.held_out_rms_px,
                "not measured" if calibration.held_out_rms_px is None else "poses by a radial lens",
            ),
        ],
    )
    meaning = (
        "the corners determine P in the volume that they fill"
        if camera.rank == 20
        else "P means something on the boards only; points off them are refused"
    )
    print_figure("rank", str(camera.rank), "", f"of 20: {meaning}")
    print_figure("frame", camera.frame, "", "of the points that it takes")
    result()
    print_verdict(made.verdict)
    result()
    print_wrote(made.files.values())
    result(f"\nNext: cubicfish project POINTS --model {made.files['camera']}", whole=True)


def say_next(judged: Verdict, camera: Path, photo: Path | None, report: Path | None) -> None:
    """Say what is to be done next, unless ``--quiet``.

    Args:
        judged: what the camera is worth.
        camera: its file.
        photo: one of those that it was made from.
        report: the page about it, where there is one.

    """
    from cubicfish_cli.words.finding import asks_for_photos

    if verbosity() < 0:
        return
    result()
    if judged.level == "bad":
        result(f"Next: {judged.reasons[0].do}")
        if asks_for_photos(judged.reasons[:1]):
            result(f"      cubicfish advise{_folder(camera)}", whole=True)
    else:
        name = "PHOTO" if photo is None else shlex.quote(str(photo))
        flat = f"flat{photo.suffix.lower()}" if photo is not None else "flat.png"
        option = f" --model{_folder(camera)}" if camera != DEFAULT_MODEL else ""
        result(f"Next: cubicfish undistort {name} {flat}{option}", whole=True)
    if report is not None:
        result(f"      open {shlex.quote(str(report))}", whole=True)


def _folder(camera: Path) -> str:
    return "" if camera == DEFAULT_MODEL else f" {shlex.quote(str(camera.parent))}"
