"""``cubicfish calibrate --lift point``: what it writes and prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli import report_step
from cubicfish_cli.cli.calibration_folder import of_earlier, say_removed
from cubicfish_cli.cli.figures import count, hold_gate, print_errors, print_verdict
from cubicfish_cli.cli.inputs import Pairs, photo_remarks
from cubicfish_cli.cli.photo_table import corners_by_board, fitted_rows, print_photo_table
from cubicfish_cli.cli.terminal import print_json, result, say, working

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.fitting.point_fit import PointCalibration


def run(
    loaded: Pairs,
    outputs: dict[str, Path],
    made_by: Mapping[str, Any],
    *,
    hold_out: bool,
    as_json: bool,
    max_rms: float | None,
    overwrite: bool,
    report: bool,
    given: Sequence[Path | None],
) -> None:
    """Fit, write the camera (and the corners) and print; see ``cubicfish calibrate``.

    Args:
        loaded: the pairs.
        outputs: where ``camera``, and ``corners`` and ``report`` if they are to be written, go.
        made_by: goes into the camera's file.
        hold_out: also measure the held-out error.
        as_json: print one JSON object.
        max_rms: the user's gate.
        overwrite: replace files that exist.
        report: whether the user wants a report, where the libraries for one are there.
        given: the inputs, which stay where they are.

    """
    from cubicfish_cli.assess.camera_facts import camera_facts
    from cubicfish_cli.assess.verdict import verdict
    from cubicfish_cli.correspondences import save_corners
    from cubicfish_cli.files import whole_files, write_text
    from cubicfish_cli.fitting.point_fit import calibrate_points
    from cubicfish_cli.formats.camera_writer import camera_text
    from cubicfish_cli.formats.target_yaml import target_text

    with working("Fitting"):
        calibration = calibrate_points(loaded.pairs, hold_out=hold_out)
    record = calibration.as_record()
    camera = calibration.camera
    facts = camera_facts(camera, record, made_by)
    page = report_step.make_page(outputs, camera, record, made_by, loaded, loaded.target)
    names = [name for name in ("camera", "drawn", "corners", "report") if name in outputs]
    written: dict[str, Path] = {name: outputs[name] for name in names}
    paths = list(written.values())
    earlier = of_earlier(written, given) if overwrite else []
    with whole_files(paths, overwrite=overwrite, obsolete=earlier) as temporary:
        places = dict(zip(names, temporary, strict=True))
        text = camera_text(camera, fit=record, made_by=made_by, comment=facts.line)
        write_text(places["camera"], text, overwrite=False)
        if "corners" in places and loaded.corners is not None:
            save_corners(places["corners"], loaded.corners, overwrite=False)
        if "drawn" in places and loaded.target is not None:
            write_text(places["drawn"], target_text(loaded.target), overwrite=False)
        if "report" in places and page is not None:
            write_text(places["report"], page, overwrite=False)
    judged = verdict(record, camera.image_size, camera.valid)
    if as_json:
        files = report_step.as_record(judged, {name: outputs[name] for name in names})
        photos = photo_remarks(loaded.detection, calibration.remarks)
        model = str(outputs["camera"])
        print_json({"summary": facts.line, **record, **photos, **files, "model": model})
    else:
        result(facts.line)
        _print(calibration, record, judged)
        result()
        for name in names:
            result(f"wrote {outputs[name]}")
        result(f"\nNext: cubicfish project POINTS --model {outputs['camera']}", whole=True)
    for photo, reason in calibration.unfit.items():
        say(f"left out: {photo}: {reason}")
    say_removed(earlier)
    report_step.say_if_missing(outputs, wanted=report)
    hold_gate(calibration.errors.rms_px, max_rms)


def _print(calibration: PointCalibration, record: Mapping[str, Any], judged: Verdict) -> None:
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
    result(f"{'rank':<24}{camera.rank:>7}     of 20: {meaning}")
    result(f"{'frame':<24}{camera.frame:>7}     of the points that it takes\n")
    print_verdict(judged)
