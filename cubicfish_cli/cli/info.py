"""``cubicfish info``: what a camera is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count, print_verdict, px
from cubicfish_cli.cli.options import as_command, record
from cubicfish_cli.cli.terminal import print_json, result

if TYPE_CHECKING:
    from cubicfish_cli.assess.camera_facts import CameraFacts


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
    from cubicfish_cli.library.describing import info_files

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
    fit, rows = facts.fit, [("size", "{} x {} px".format(*facts.image_size))]
    if facts.focal_px is not None and facts.principal_point is not None:
        rows += [
            ("focal length", _two(facts.focal_px, facts.focal_sigma_px)),
            ("principal point", _two(facts.principal_point, facts.principal_point_sigma_px)),
        ]
    if facts.field is not None:
        rows.append(("field of view", facts.field.words))
    if facts.max_angle_deg is not None:
        reach = f"; corners reach {fit.covered_deg:.1f}°" if fit.covered_deg > 0 else ""
        rows.append(("trusted", f"to {facts.max_angle_deg:.1f}° from the axis{reach}"))
    if fit.pupil is not None:
        rows.append(("entrance pupil", f"{px(fit.pupil.rim_px)} px {fit.pupil.meaning}"))
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


def _two(value: tuple[float, float], sigma: tuple[float, ...] | None) -> str:
    """``x 277.13 ± 0.02 px, y 277.20 ± 0.02 px``."""
    spread = sigma or (None, None)
    return ", ".join(
        f"{axis} {number:.2f}" + (f" ± {one:.2f}" if one is not None else "") + " px"
        for axis, number, one in zip("xy", value, spread, strict=True)
    )
