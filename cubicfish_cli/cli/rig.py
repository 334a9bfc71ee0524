"""``cubicfish rig``: photos of several cameras on one body to where each of them stands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count, hold_gate, mark_of, print_errors, print_verdict, px
from cubicfish_cli.cli.options import (
    FILE,
    IntRange,
    Seconds,
    as_command,
    option,
    record,
    target_options,
)
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.report import FitOptions, fit_options
from cubicfish_cli.cli.terminal import apart, print_json, print_table, print_wrote, result, say
from cubicfish_cli.films import MOST

if TYPE_CHECKING:
    from cubicfish_cli.fitting.climb import RefineTarget
    from cubicfish_cli.library.asked import TargetSource


@record
class Asked:
    """What is asked of ``cubicfish rig``."""

    cameras: tuple[Path, ...] = options.argument(
        "For each camera a folder of photos, a film, a corners.csv, or the folder that calibrate "
        "wrote (camera.yaml and corners.csv), whose lens stays as it is. The first camera's frame "
        "is the rig's.",
        nargs=-1,
        metavar="CAMERA CAMERA...",
    )
    target: TargetSource = target_options
    folder: Path = options.output_option(
        "Where rig.yaml goes, and each camera's camera.yaml in a folder of its name.",
        default="rig",
        folder=True,
    )
    names: str | None = option(
        "--names NAME,NAME...", "Names of the cameras. [default: those of their folders or files]"
    )
    lenses: tuple[Path, ...] = option(
        "--lens NAME=FILE",
        "A camera that is calibrated already: its name and its file or folder. Its lens stays as "
        "it is. Once for each such camera.",
        FILE,
        multiple=True,
    )
    shots: Path | None = option(
        "--shots FILE",
        "Which photos are of one shot: a CSV file with the columns shot,camera,image, or "
        "camera,image,time (seconds) for photos of one time. [default: photos of the same name]",
        FILE,
    )
    tolerance: float | None = option(
        "--tolerance TIME",
        "Photos taken within this are one shot, by the times in their names or in --shots, such "
        "as 5ms. [default for films: half a frame]",
        Seconds(),
    )
    most: int = option(
        "--most N", "Choose no more shots of films than these.", IntRange(min=1), MOST
    )
    hold_lenses: bool = option(
        "--hold-lenses",
        "Leave the lenses as each camera alone has them, and fit their places only.",
    )
    refine_target: RefineTarget = options.refine_target_option(
        "Fit the target too, as 'cubicfish calibrate' does."
    )
    fit: FitOptions = fit_options


@as_command(
    "rig",
    "Photos of several cameras on one body to where each camera stands.",
    "cubicfish rig left/ right/ --target target.yaml",
    "cubicfish rig left.csv right.csv rear.csv --target target.yaml -o rig",
    "cubicfish rig left/ right/ --lens left=left_calibration --lens right=right_calibration",
    "cubicfish rig cam0.mp4 cam1.mp4 cam2.mp4 cam3.mp4 --target target.yaml",
    "cubicfish rig run.bag:/cam0/image_raw run.bag:/cam1/image_raw --names cam0,cam1",
)
def command(given: Asked) -> None:
    """Calibrate several cameras on one body: their lenses, and where each stands.

    Move the rig about the target, or the target about the rig. Photos of one shot have the same
    name in each camera's folder. Of films, moments are chosen at which several cameras see the
    target sharply, and how far their clocks differ is fitted. The cameras' fields need not overlap:
    two cameras are connected where each sees some board of the target in the same shot.
    """
    from cubicfish_cli.library.rig_files import calibrate_rig_files

    names = None if given.names is None else given.names.split(",")
    lenses = dict(map(_lens, given.lenses))
    made = call(calibrate_rig_files, given, names=names, lenses=lenses)
    if given.fit.as_json:
        print_json(made.as_record())
    for finding in made.rig.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    if not given.fit.as_json:
        apart()
        print_rig(made.record)
        result()
        print_verdict(made.verdict)
        result()
        print_wrote(made.files)
    hold_gate(made.rig.errors.rms_px, given.fit.max_rms)


def _lens(text: Path) -> tuple[str, Path | str]:
    """``left=left_calibration`` -> its parts."""
    name, separator, path = str(text).partition("=")
    return (name, Path(path)) if separator else (str(text), "")


def print_rig(record: Mapping[str, Any]) -> None:
    """Print where the cameras stand, and how well it fits."""
    from cubicfish_cli.assess.fit_record import ErrorStatistics
    from cubicfish_cli.assess.records import read_record

    units, fit = record["units"] or "", record["fit"]
    result(
        f"{count(len(record['cameras']), 'camera')}, {count(fit['shots'], 'shot')}, "
        f"{count(fit['corners'], 'corner')} used\n"
    )
    out, errors = fit["held_out_rms_px"], read_record(ErrorStatistics, fit) or ErrorStatistics()
    meaning = "shots judged by rigs that never saw them" if out else ""
    print_errors(errors, [("held-out RMS", out or math.nan, meaning)])
    result()
    print_table(
        ("camera", f"x {units}".strip(), "y", "z", "± shift", "turned °", "± turn °", "photos",
         "RMS px", "alone px"),
        [
            (
                one["name"],
                *(f"{value:.2f}" for value in one["position"]),
                f"{one['shift_sigma']:.3f}",
                f"{_turn_deg(one['camera_from_rig']['rotation']):.3f}",
                f"{one['turn_sigma_deg']:.4f}",
                str(one["fit"]["images"]),
                px(one["fit"]["rms_px"]),
                px(one["fit"]["alone_rms_px"]),
            )
            for one in record["cameras"]
        ],
    )  # fmt: skip
    print_pairs(record)


def print_pairs(record: Mapping[str, Any]) -> None:
    """Print what connects every two cameras."""
    result()
    print_table(
        ("cameras", "shots in common", "RMS px"),
        [
            (" + ".join(one["cameras"]), str(one["shots"]), px(one["rms_px"]))
            for one in record["pairs"]
        ],
    )


def _turn_deg(rotation: Sequence[Sequence[float]]) -> float:
    """By how much a camera is turned against the first, degrees."""
    from math import acos, degrees

    trace = sum(rotation[axis][axis] for axis in range(3))
    return degrees(acos(max(-1.0, min(1.0, (trace - 1) / 2))))
