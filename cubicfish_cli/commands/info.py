"""``cubicfish info``: a camera's figures, and its origin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import in_folder, refuse_picture
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import print_verdict, px
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import result
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish.judge import CameraFacts


@record
class InfoOptions:
    """Options of :func:`info_files`: the file or folder of a camera."""

    camera: StrPath = parameters.camera_options


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """Result of :func:`info_files`.

    Attributes:
        model: the camera's file.
        known: the camera, its fit and its origin.

    """

    model: Path
    known: CameraFacts

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish info --json`` prints.

        Keys:
            title: what its owner called it with 'cubicfish calibrate --title'
            summary: the camera in one line
            image_size: [width, height]
            focal_px: [x, y] pixels per radian on the axis
            focal_sigma_px: one standard deviation of each
            principal_point: [x, y] the axis's pixel
            principal_point_sigma_px: one standard deviation of each
            horizontal_deg: field of view that a photo shows, along the axis's row
            vertical_deg: along its column
            diagonal_deg: from corner to corner
            max_angle_deg: how far from the axis the camera may be trusted
            covered_deg: how far from it corners reach
            pupil: as in calibrate's; null where it is not known
            rms_px: reprojection error of the fit
            held_out_rms_px: on photos that took no part in it
            images: photos that it was made from
            corners: corners that were used
            verdict: level (good, care or bad), words, figures, and reasons, a record each, with
                why: what and evidence in one
            date: when it was made
            version: of cubicfish, then
            command: that made it
            target: the target's file
            model: the camera's file

        """
        from cubicfish_cli.words.camera import verdict_record

        known = self.known
        fit, seen, origin = known.fit, known.field, known.origin
        focal, centre = known.axis or (None, None)
        focal_sigma, centre_sigma = (sigma and list(sigma) for sigma in known.axis_sigma)
        recorded = fit.as_record()
        return {
            "model": self.model,
            "title": known.title or None,
            "image_size": list(known.camera.image_size),
            "focal_px": focal,
            "principal_point": centre,
            "focal_sigma_px": focal_sigma,
            "principal_point_sigma_px": centre_sigma,
            "max_angle_deg": known.max_angle_deg,
            "covered_deg": recorded.get("covered_deg"),
            "pupil": recorded.get("pupil"),
            "rms_px": recorded.get("rms_px"),
            "held_out_rms_px": recorded.get("held_out_rms_px"),
            "images": fit.images or None,
            "corners": fit.corners or None,
            "date": origin.date,
            "version": origin.version,
            "command": origin.command,
            "target": origin.target and origin.target.file,
            "summary": known.line,
            "horizontal_deg": seen and seen.horizontal,
            "vertical_deg": seen and seen.vertical,
            "diagonal_deg": seen and seen.diagonal,
            "verdict": verdict_record(known.verdict) if known.is_measured else None,
        }


def info_files(options: InfoOptions, *, run: Run = Run()) -> CameraInfo:
    """Read a camera's figures, as ``cubicfish info`` does.

    Raises:
        CameraFileError: the file cannot be used.

    """
    from cubicfish import load_camera

    path = in_folder(Path(options.camera))
    refuse_picture(path)
    return CameraInfo(model=path, known=load_camera(path, any_lift=True))


@as_command(
    "info",
    "Show a camera: focal length, field of view, errors, verdict.",
    "cubicfish info",
    "cubicfish info lens_a/",
    "cubicfish info camera.yaml --json",
    do=info_files,
    how=("as_json",),
)
def command(made: CameraInfo, given: InfoOptions, how: How) -> None:
    """Describe the camera in FOLDER (by default: calibration).

    Shows its size, focal length and principal point with one standard deviation, the field of view
    that a photo shows, how far from the axis corners reach, the errors, the verdict, and when and
    from what it was made. The focal length is in pixels per radian, on the axis.
    """
    if how.print(made):
        return
    result(made.known.line + "\n")
    for name, words in _list_rows(made.known):
        result(f"{name:<18}{words}")
    if made.known.is_measured:
        result()
        print_verdict(made.known.verdict)


def _list_rows(known: CameraFacts) -> list[tuple[str, str]]:
    """Return rows (name, words) of all known figures."""
    from cubicfish_cli.words.camera import lens_rows, pictures_of, reach_words

    fit, origin, pictures = known.fit, known.origin, pictures_of(known.fit)
    rows = [("size", "{} x {} px".format(*known.camera.image_size)), *lens_rows(known)]
    if known.max_angle_deg is not None:
        rows.append(("calibrated to", f"{known.max_angle_deg:.1f}° {reach_words(known)}"))
    if known.is_measured:
        out = fit.held_out_rms_px
        left_out = f", {px(out)} px on photos left out" if math.isfinite(out) else ""
        rows.append(("error", f"{px(fit.rms_px)} px RMS{left_out}"))
    if pictures is not None and fit.corners:
        rows.append(("from", f"{pictures}, {plural(fit.corners, 'corner')}"))
    if origin.target is not None:
        rows.append(("target", origin.target.file))
    if origin.date is not None:
        by = f", by cubicfish {origin.version}" if origin.version else ""
        rows.append(("date", origin.date + by))
    if origin.command is not None:
        rows.append(("command", origin.command))
    return rows
