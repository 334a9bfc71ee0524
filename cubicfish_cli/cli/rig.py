"""``cubicfish rig``: photos of several cameras on one body to where each of them stands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.choosing import films_among
from cubicfish_cli.cli.figures import count, hold_gate, print_errors, print_verdict, px
from cubicfish_cli.cli.inputs import load_pairs, mark_of, say_photo_problems
from cubicfish_cli.cli.numbers import IntRange, Seconds
from cubicfish_cli.cli.options import FILE, as_command, option
from cubicfish_cli.cli.provenance import made_at, made_by_record
from cubicfish_cli.cli.rendering_options import is_video_name
from cubicfish_cli.cli.report import PAGE, can_make_pages, report_option, write_rig_page
from cubicfish_cli.cli.target_choice import TargetChoice, target_options
from cubicfish_cli.cli.terminal import (
    apart,
    print_json,
    print_table,
    print_wrote,
    result,
    say,
    stages,
    working,
)
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.films import MOST
from cubicfish_cli.wording import quoted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cubicfish_cli.cli.inputs import Pairs
    from cubicfish_cli.cli.rig_films import RigFrames
    from cubicfish_cli.fitting.calibrate import RefineTarget
    from cubicfish_cli.formats.camera_yaml import CameraFile


@as_command(
    "rig",
    "Photos of several cameras on one body to where each camera stands.",
    "cubicfish rig left/ right/ --target target.yaml",
    "cubicfish rig left.csv right.csv rear.csv --target target.yaml -o rig",
    "cubicfish rig left/ right/ --lens left=left_calibration --lens right=right_calibration",
    "cubicfish rig cam0.mp4 cam1.mp4 cam2.mp4 cam3.mp4 --target target.yaml",
    "cubicfish rig run.bag:/cam0/image_raw run.bag:/cam1/image_raw --names cam0,cam1",
)
@options.argument(
    "inputs",
    "For each camera a folder of photos, a film, a corners.csv, or the folder that calibrate wrote "
    "(camera.yaml and corners.csv), whose lens stays as it is. The first camera's frame is the "
    "rig's.",
    nargs=-1,
    metavar="CAMERA CAMERA...",
)
@target_options
@options.output_option(
    "Where rig.yaml goes, and each camera's camera.yaml in a folder of its name.",
    default="rig",
    folder=True,
)
@option("--names NAME,NAME...", "Names of the cameras. [default: those of their folders or files]")
@option(
    "--lens NAME=FILE",
    "A camera that is calibrated already: its name and its file or folder. Its lens stays as "
    "it is. Once for each such camera.",
    FILE,
    to="lenses",
    multiple=True,
)
@option("--by-order", "The first photos of all cameras are one shot.")
@option(
    "--shots FILE",
    "Which photos are of one shot: a CSV file with the columns shot,camera,image, or "
    "camera,image,time (seconds) for photos of one time. [default: photos of the same name]",
    FILE,
)
@option(
    "--tolerance TIME",
    "Photos taken within this are one shot, by the times in their names or in --shots, such "
    "as 5ms. [default for films: half a frame]",
    Seconds(),
)
@option("--most N", "Choose no more shots of films than these.", IntRange(min=1), MOST)
@option(
    "--hold-lenses", "Leave the lenses as each camera alone has them, and fit their places only."
)
@options.refine_target_option("Fit the object too, as 'cubicfish calibrate' does.")
@report_option
@options.max_rms_option
@options.overwrite_option
@options.json_option("rig")
@options.jobs_option
@options.no_cache_option
def command(
    inputs: tuple[Path, ...],
    target: TargetChoice,
    output: Path,
    names: str | None,
    lenses: tuple[Path, ...],
    by_order: bool,
    shots: Path | None,
    tolerance: float | None,
    most: int,
    hold_lenses: bool,
    refine_target: RefineTarget,
    report: bool,
    max_rms: float | None,
    overwrite: bool,
    as_json: bool,
    jobs: int | None,
    no_cache: bool,
) -> None:
    """Calibrate several cameras on one body: their lenses, and where each stands.

    Move the rig about the target, or the target about the rig. Photos of one shot have the same
    name in each camera's folder. Of films, moments are chosen at which several cameras see the
    target sharply, and how far their clocks differ is fitted. The cameras' fields need not overlap:
    two cameras are connected where each sees some board of the target in the same shot.
    """
    if len(inputs) < 2:
        raise click.UsageError(
            "name two cameras or more: a folder of photos each, or a corners.csv"
        )
    if by_order and shots is not None:
        raise click.UsageError("--shots lists the shots: leave --by-order out")
    if by_order and tolerance is not None:
        raise click.UsageError("--tolerance matches by time: leave --by-order out")
    target.check()
    called = _names(inputs, names)
    films = films_among(inputs)
    if films and (len(films) < len(inputs) or by_order or shots is not None):
        raise click.UsageError(
            f"{quoted(str(films[0]))} is a film: films are matched by time, and with films alone"
            " (without --by-order and --shots); of some calibrated cameras say --lens"
            if len(films) == len(inputs)
            else f"{quoted(str(films[0]))} is a film, and other cameras have none: give a film of "
            "each camera, or take its frames with 'cubicfish frames'"
        )
    from cubicfish_cli.assess.rig_verdict import rig_verdict
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.library.rigs import calibrate_rig, rig_record, save_rig

    made_at()  # said before the work if it cannot be
    pages = [output / PAGE] if report and can_make_pages() else []
    cameras = [output / name / "camera.yaml" for name in called]
    refuse_existing(output / "rig.yaml", *pages, *cameras, overwrite=overwrite)
    loaded, known = {}, _lenses(lenses, called)
    frames = None
    if films:
        from cubicfish_cli.cli.rig_films import rig_frames

        frames = rig_frames(
            dict(zip(called, inputs, strict=True)),
            output / "frames",
            target,
            most=most,
            tolerance=tolerance,
            jobs=jobs,
            no_cache=no_cache,
            overwrite=overwrite,
        )
    for name, path in zip(called, inputs, strict=True):
        say(f"Camera {name}: {path}.")
        sources = (path,) if frames is None else frames.photos[name]
        loaded[name], camera = loaded_camera(sources, target, jobs, no_cache)
        if camera is not None:
            known.setdefault(name, camera)
    moving = None
    if frames is not None:
        moving = {name: frames.moving(name, own.pairs) for name, own in loaded.items()}
    matched, by = _matching(by_order, shots, tolerance, frames)
    one = loaded[called[0]]
    with stages("Fitting") as progress:
        rig = calibrate_rig(
            {name: own.given for name, own in loaded.items()},
            one.pairs.target,
            **matched,
            moving=moving,
            known=known,
            hold_lenses=hold_lenses,
            refine_target=refine_target,
            progress=progress,
        )
    files = [file for own in loaded.values() for file in own.files]
    asked = {"hold_lenses": hold_lenses, "refine_target": refine_target, "shots": by}
    made_by = made_by_record(asked, one.target_file, files)
    with working("Writing"):
        written = save_rig(output, rig, made_by=made_by, overwrite=overwrite)
    if frames is not None:
        frames.say_clocks({one.name: one.late_s for one in rig.cameras})
        frames.done()
    record = rig_record(rig)
    judged = rig_verdict(record)
    if report and can_make_pages():
        page = output / PAGE
        write_rig_page(written[0], page, overwrite=overwrite)
        written.append(page)
    if as_json:
        print_json({**record, "model": str(written[0]), "verdict": judged.as_record()})
    for finding in rig.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    if not as_json:
        apart()
        print_rig(record)
        result()
        print_verdict(judged)
        result()
        print_wrote(written)
    hold_gate(rig.errors.rms_px, max_rms)


def _names(inputs: Sequence[Path], given: str | None) -> list[str]:
    """What the cameras are called."""
    if given is not None:
        names = [name.strip() for name in given.split(",")]
        if len(names) != len(inputs):
            raise click.UsageError(f"--names has {len(names)} names for {len(inputs)} cameras")
    else:
        names = []
        for path in inputs:
            own = path.absolute()
            own = own.parent if own.name in ("corners.csv", "camera.yaml") else own
            names.append(named_by(own))
    if len(set(names)) < len(names) or not all(names):
        raise click.UsageError(
            f"the cameras would be called {', '.join(names)}: give each a name of its own with "
            "--names"
        )
    return names


def named_by(path: Path) -> str:
    """What a camera is called by where its photos are."""
    from cubicfish_cli.films.recordings import is_recording, label_of

    if is_recording(path):
        return label_of(path)
    if has_magic(path.name) and not path.exists():  # left*.png, or left/*.png
        begin = re.split(r"[*?[]", path.name)[0].rstrip("_-. ")
        return begin or path.parent.name
    return path.stem if path.suffix.lower() == ".csv" or is_video_name(path) else path.name


def _lenses(given: Sequence[Path], names: Sequence[str]) -> dict[str, CameraFile]:
    """Cameras that are calibrated already, by name."""
    from cubicfish_cli.formats.camera_yaml import load_camera

    known = {}
    for one in given:
        name, separator, path = str(one).partition("=")
        if not separator or name not in names:
            raise click.UsageError(
                f"--lens {quoted(str(one))} names no camera: write NAME=FILE with one of "
                + ", ".join(names)
            )
        known[name] = load_camera(options.in_folder(Path(path)))
    return known


def loaded_camera(
    sources: tuple[Path, ...], target: TargetChoice, jobs: int | None, no_cache: bool
) -> tuple[Pairs, CameraFile | None]:
    """One camera's pairs, and its lens where it is calibrated already."""
    from cubicfish_cli.files import fingerprint
    from cubicfish_cli.formats.camera_yaml import load_camera

    camera, path = None, sources[0] if sources else Path()
    model = path / "camera.yaml" if path.is_dir() else path
    if model.name.endswith((".yaml", ".yml")) and model.is_file():
        camera = load_camera(model)
        sources = (model.parent / "corners.csv",)
        if not sources[0].is_file():
            raise CorrespondenceError(
                f"{model.parent} has a camera.yaml and no corners.csv: calibrate it again, or name "
                "the camera's photos or its corners.csv"
            )
    loaded = load_pairs(
        sources, correspondences=None, target=target, size=None, jobs=jobs, no_cache=no_cache
    )
    if loaded.detection is not None:
        say_photo_problems(loaded.detection)
    if camera is not None:
        loaded = replace(loaded, files=(*loaded.files, fingerprint(model)))
    return loaded, camera


def _matching(
    by_order: bool, shots: Path | None, tolerance: float | None, frames: RigFrames | None
) -> tuple[dict[str, Any], str]:
    """How photos are matched to shots: as ``calibrate_rig`` takes it, and in a word."""
    from cubicfish_cli.library.rigs import TOLERANCE, load_shots

    wanted: dict[str, Any] = {"tolerance": TOLERANCE if tolerance is None else tolerance}
    if frames is not None:
        return {**wanted, "shots": frames.shots}, "films"
    if shots is None:
        by = "order" if by_order else "name" if tolerance is None else "time"
        return {**wanted, "shots": by}, by
    rows, times = load_shots(shots)
    if rows is not None and tolerance is not None:
        raise click.UsageError(f"{shots} says which photos are a shot: leave --tolerance out")
    return {**wanted, "shots": "time" if rows is None else rows, "times": times}, str(shots)


def print_rig(record: Mapping[str, Any]) -> None:
    """Print where the cameras stand, and how well it fits."""
    units, fit = record["units"] or "", record["fit"]
    result(
        f"{count(len(record['cameras']), 'camera')}, {count(fit['shots'], 'shot')}, "
        f"{count(fit['corners'], 'corner')} used\n"
    )
    out = fit["held_out_rms_px"]
    print_errors(
        fit, [("held-out RMS", out, "shots judged by rigs that never saw them" if out else "")]
    )
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
