"""What ``cubicfish calibrate`` says of a camera, and what to do next with it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.figures import (
    count,
    print_errors,
    print_figure,
    print_models,
    print_verdict,
    px,
)
from cubicfish_cli.cli.inputs import Pairs, mark_of, why_lost
from cubicfish_cli.cli.options import DEFAULT_MODEL, verbosity
from cubicfish_cli.cli.photo_table import corners_by_board, fitted_rows, print_photo_table
from cubicfish_cli.cli.terminal import detail, print_table, print_wrote, result, say

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.fitting.calibrate import Calibration
    from cubicfish_cli.fitting.point_fit import PointCalibration


def say_findings(calibration: Calibration, record: Mapping[str, Any]) -> None:
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
    for departure in calibration.departures:
        for doubt in departure.doubts:
            say(f"warning: board {departure.board} seems {doubt.what}: {doubt.do}")


def print_calibration(
    calibration: Calibration,
    record: Mapping[str, Any],
    models: Sequence[Mapping[str, Any]],
    outputs: Mapping[str, Path],
    loaded: Pairs,
) -> None:
    """The figures that the verdict rests on, the photos, and what was written."""
    camera, pairs = calibration.camera, calibration.pairs
    _print_figures(calibration, record)
    result()
    lost = dict.fromkeys(calibration.unfit, "left out")  # lines on stderr say more
    if loaded.detection is not None:
        lost |= why_lost(loaded.detection)
    rows = fitted_rows(record, camera.image_size, corners_by_board(pairs), lost)
    print_photo_table(rows, pairs.boards, record, everything=str(outputs["camera"]))
    result()
    _print_object(calibration)
    if models:
        print_models(models)
        result()
    print_wrote(outputs.values())


def _print_figures(calibration: Calibration, record: Mapping[str, Any]) -> None:
    from cubicfish_cli.assess.field_uncertainty import recorded
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
    uncertainty = recorded(record)
    if uncertainty is not None:
        print_figure("uncertainty", px(uncertainty.median_px), meaning=uncertainty.meaning)


def _print_object(calibration: Calibration) -> None:
    """Say in one line per board what was found of the object, where any of it was fitted."""
    if not calibration.departures or calibration.target is None:
        return
    units = calibration.target.units
    what = {"shape": "boards' shapes and places", "points": "shapes, places and single corners"}
    tried = ", ".join(f"{level} {px(rms)}" for level, rms in calibration.held_out_by_level.items())
    result(
        f"target fitted too: {what[calibration.refined]}" + f" (held-out: {tried})" * bool(tried)
    )
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


def print_points(
    calibration: PointCalibration,
    record: Mapping[str, Any],
    judged: Verdict,
    outputs: Mapping[str, Path],
) -> None:
    """Print the photos, the errors, what P means and what was written."""
    camera, pairs = calibration.camera, calibration.pairs
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
    print_verdict(judged)
    result()
    print_wrote(outputs.values())
    result(f"\nNext: cubicfish project POINTS --model {outputs['camera']}", whole=True)


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
