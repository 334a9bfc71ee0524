"""``cubicfish calibrate --lift point``: what it prints."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.figures import count, print_errors, print_figure, print_verdict
from cubicfish_cli.cli.photo_table import corners_by_board, fitted_rows, print_photo_table
from cubicfish_cli.cli.terminal import print_wrote, result

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.fitting.point_fit import PointCalibration


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
