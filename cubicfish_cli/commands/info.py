"""``cubicfish info``: what a camera is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.asked import RUN, Run, StrPath, in_folder
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import print_verdict, px
from cubicfish_cli.app.terminal.options import as_command, record
from cubicfish_cli.app.terminal.progress import How
from cubicfish_cli.app.terminal.terminal import result
from cubicfish_cli.app.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish_cli.core.assess.camera_facts import CameraFacts
    from cubicfish_cli.core.assess.verdict import Verdict


@record
class InfoOptions:
    """A camera: its file, or the folder of that."""

    camera: StrPath = options.camera_options


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """What the file of a camera says.

    Attributes:
        model: the file.
        verdict: what the camera is worth; None of a camera that was not fitted.
        facts: the camera in the figures that people ask for first.

    """

    model: Path
    verdict: Verdict | None
    facts: CameraFacts

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish info --json`` prints."""
        return {"model": self.model, **self.facts.as_record()}


def info_files(asked: InfoOptions, *, run: Run = RUN) -> CameraInfo:
    """Say what a camera is, as ``cubicfish info`` does.

    Raises:
        CameraFileError: the file cannot be used.

    """
    from cubicfish_cli.core.io.camera_yaml import load_any_camera

    path = in_folder(Path(asked.camera))
    facts = load_any_camera(path).facts
    return CameraInfo(model=path, verdict=facts.verdict, facts=facts)


@as_command(
    "info",
    "What a camera is: focal length, field of view, how far to trust it.",
    "cubicfish info",
    "cubicfish info lens_a/",
    "cubicfish info camera.yaml --json",
    do=info_files,
    how=("as_json",),
)
def command(made: CameraInfo, given: InfoOptions, how: How) -> None:
    """Say what the camera in FOLDER (by default: calibration) is.

    Size, focal length and principal point with one standard deviation, the field of view that a
    photo shows, how far from the axis corners reach, the errors, the verdict, and when and from
    what it was made. The focal length is in pixels per radian, on the axis.
    """
    if how.print(made):
        return
    result(made.facts.line + "\n")
    for name, words in _rows(made.facts):
        result(f"{name:<18}{words}")
    if made.verdict is not None:
        result()
        print_verdict(made.verdict)


def _rows(facts: CameraFacts) -> list[tuple[str, str]]:
    """(what, in words) of all that is known."""
    fit, origin = facts.fit, facts.origin
    rows = [("size", "{} x {} px".format(*facts.camera.image_size)), *facts.lens]
    if facts.max_angle_deg is not None:
        reach = f"; corners reach {fit.covered_deg:.1f}°" if fit.covered_deg > 0 else ""
        rows.append(("trusted", f"to {facts.max_angle_deg:.1f}° from the axis{reach}"))
    if math.isfinite(fit.rms_px):
        out = fit.held_out_rms_px
        left_out = f", {px(out)} px on photos left out" if math.isfinite(out) else ""
        rows.append(("error", f"{px(fit.rms_px)} px RMS{left_out}"))
    if facts.pictures is not None and fit.corners:
        rows.append(("from", f"{facts.pictures}, {plural(fit.corners, 'corner')}"))
    if origin.target is not None:
        rows.append(("target", origin.target.file))
    if origin.date is not None:
        by = f", by cubicfish {origin.version}" if origin.version else ""
        rows.append(("date", origin.date + by))
    if origin.command is not None:
        rows.append(("command", origin.command))
    return rows
