"""``cubicfish calibrate --lift point``: what it writes and prints."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.figures import count, hold_gate, print_errors, print_photos
from cubicfish_cli.cli.inputs import Pairs
from cubicfish_cli.cli.terminal import print_json, result, say

if TYPE_CHECKING:
    from cubicfish_cli.fitting.point_fit import PointCalibration


def run(
    loaded: Pairs,
    outputs: Mapping[str, Path],
    made_by: Mapping[str, Any],
    *,
    hold_out: bool,
    as_json: bool,
    max_rms: float | None,
    overwrite: bool,
) -> None:
    """Fit, write the camera (and the corners) and print; see ``cubicfish calibrate``.

    Args:
        loaded: the pairs.
        outputs: where ``camera``, and ``corners`` if they are to be written, go.
        made_by: goes into the camera's file.
        hold_out: also measure the held-out error.
        as_json: print one JSON object.
        max_rms: the user's gate.
        overwrite: replace files that exist.

    """
    from cubicfish_cli.correspondences import save_corners
    from cubicfish_cli.files import whole_files
    from cubicfish_cli.fitting.point_fit import calibrate_points
    from cubicfish_cli.formats.camera_yaml import save_camera

    calibration = calibrate_points(loaded.pairs, hold_out=hold_out)
    record = calibration.as_record()
    names = [name for name in ("camera", "corners") if name in outputs]
    if loaded.corners is None:
        names = ["camera"]
    with whole_files([outputs[name] for name in names], overwrite=overwrite) as temporary:
        save_camera(temporary[0], calibration.camera, fit=record, made_by=made_by, overwrite=False)
        if len(temporary) > 1 and loaded.corners is not None:
            save_corners(temporary[1], loaded.corners, overwrite=False)
    if as_json:
        print_json({**record, "model": str(outputs["camera"])})
    else:
        _print(calibration, record)
        result()
        for name in names:
            result(f"wrote {outputs[name]}")
        result(f"\nNext: cubicfish project POINTS --model {outputs['camera']}")
    for photo, reason in calibration.unfit.items():
        say(f"left out: {photo}: {reason}")
    hold_gate(calibration.errors.rms_px, max_rms)


def _print(calibration: PointCalibration, record: Mapping[str, Any]) -> None:
    camera = calibration.camera
    result(
        f"{count(record['images'], 'photo')}, {count(record['corners'], 'corner')} used, "
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
    print_photos(record["per_image"])
