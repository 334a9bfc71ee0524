"""``cubicfish info``: what a camera is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import count, print_verdict, px
from cubicfish_cli.app.terminal.options import as_command, record
from cubicfish_cli.app.terminal.terminal import print_json, result

if TYPE_CHECKING:
    from cubicfish_cli.core.assess.camera_facts import CameraFacts


@record
class Asked:
    """What is asked of ``cubicfish info``."""

    calibration: Path | None = options.calibration_argument
    model: Path | None = options.model_option
    as_json: bool = options.json_option


@as_command(
    "info",
    "What a camera is: focal length, field of view, how far to trust it.",
    "cubicfish info",
    "cubicfish info lens_a/",
    "cubicfish info camera.yaml --json",
)
def command(given: Asked) -> None:
    """Say what the camera in FOLDER (by default: calibration) is.

    Size, focal length and principal point with one standard deviation, the field of view that a
    photo shows, how far from the axis corners reach, the errors, the verdict, and when and from
    what it was made. The focal length is in pixels per radian, on the axis.
    """
    from cubicfish_cli.commands.describing import info_files

    made = info_files(options.model_path(given.calibration or given.model))
    if given.as_json:
        print_json(made.as_record())
        return
    result(made.facts.line + "\n")
    for name, words in _rows(made.facts):
        result(f"{name:<18}{words}")
    if made.verdict is not None:
        result()
        print_verdict(made.verdict)


def _rows(facts: CameraFacts) -> list[tuple[str, str]]:
    """(what, in words) of all that is known."""
    fit, rows = facts.fit, [("size", "{} x {} px".format(*facts.image_size)), *facts.lens]
    if facts.max_angle_deg is not None:
        reach = f"; corners reach {fit.covered_deg:.1f}°" if fit.covered_deg > 0 else ""
        rows.append(("trusted", f"to {facts.max_angle_deg:.1f}° from the axis{reach}"))
    if math.isfinite(fit.rms_px):
        out = fit.held_out_rms_px
        left_out = f", {px(out)} px on photos left out" if math.isfinite(out) else ""
        rows.append(("error", f"{px(fit.rms_px)} px RMS{left_out}"))
    if facts.pictures is not None and fit.corners:
        rows.append(("from", f"{facts.pictures}, {count(fit.corners, 'corner')}"))
    if facts.target is not None:
        rows.append(("target", facts.target))
    if facts.date is not None:
        by = f", by cubicfish {facts.version}" if facts.version else ""
        rows.append(("date", facts.date + by))
    if facts.command is not None:
        rows.append(("command", facts.command))
    return rows
