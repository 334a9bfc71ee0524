"""``cubicfish rig calibrate``: photos of several cameras on one body to where each stands."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import Event, Run, UsageError, quoted
from cubicfish.files import StrPath
from cubicfish_cli.extensions.rigs.options import times_option
from cubicfish_cli.extensions.rigs.printed import print_rig
from cubicfish_cli.films import MOST
from cubicfish_cli.inputs.paths import in_folder, paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.render.pages import PAGE
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import enforce_max_rms, mark_of
from cubicfish_cli.terminal.parameters import (
    FILE,
    SECONDS,
    as_command,
    option,
    record,
    target_options,
)
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import apart, print_message, print_wrote, result
from cubicfish_cli.words.phrases import plural
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import Rig, Target
    from cubicfish.fit.model_selection import RefineTarget
    from cubicfish.io.camera_yaml import Calibrated
    from cubicfish_cli.extensions.rigs.films import ShotFrame


@record
class RigOptions:
    """What a rig is calibrated from, how, and what is written.

    Attributes:
        cameras: of each camera, by name or not, a folder of photos, a film, a corners.csv, or the
            folder of its calibration, whose lens stays as it is.
        target: the calibration target, or its file.
        folder: where rig.yaml goes, and each camera's camera.yaml in a folder of its name.
        names: of cameras without; by default those of their folders or files.
        lenses: by name, or as ``name=file``, cameras that are calibrated already, or their files.
        shots: a table that says which photos are of one shot.
        times: a table that says when each was taken.
        tolerance: how far apart photos of a shot may be, seconds; by default 5 ms, and half a frame
            of films.
        most: how many moments of films are chosen at most; by default 60.
        hold_lenses: leaves the lenses as each camera alone has them.
        refine_target: as in :func:`calibrate`; by default ``auto``.
        report: also writes report.html, where the extra ``report`` is installed.

    """

    cameras: Mapping[str, StrPath] | Sequence[StrPath] = parameters.argument(
        "For each camera a folder of photos, a film, a corners.csv, or the folder that calibrate "
        "wrote (camera.yaml and corners.csv), whose lens stays as it is. The first camera's frame "
        "is the rig's.",
        nargs=-1,
        metavar="CAMERA CAMERA...",
    )
    target: TargetSource | Target | StrPath | None = target_options
    folder: StrPath = parameters.output_option(
        "Where rig.yaml goes, and each camera's camera.yaml in a folder of its name.",
        default="rig",
        folder=True,
    )
    names: str | None = option(
        "--names NAME,NAME...", "Names of the cameras. [default: those of their folders or files]"
    )
    lenses: Mapping[str, Calibrated | StrPath] | Sequence[Path] = option(
        "--lens NAME=FILE",
        "A camera that is calibrated already: its name and its file or folder. Its lens stays as "
        "it is. Once for each such camera.",
        FILE,
        multiple=True,
    )
    shots: StrPath | None = option(
        "--shots FILE",
        "Which photos are of one shot: a CSV file with the columns shot,camera,image. [default: "
        "photos of the same name]",
        FILE,
    )
    times: StrPath | None = times_option
    tolerance: float | None = option(
        "--tolerance TIME",
        "Photos taken within this are one shot, by the times in their names or in --times, such "
        "as 5ms. [default for films: half a frame]",
        SECONDS,
    )
    most: int | None = option(
        "--most N",
        f"Choose no more shots of films than these. [default: {MOST}]",
        click.IntRange(min=1),
    )
    hold_lenses: bool = option(
        "--hold-lenses",
        "Leave the lenses as each camera alone has them, and fit their places only.",
    )
    refine_target: RefineTarget | None = parameters.refine_target_option(
        "Fit the target too, as 'cubicfish calibrate' does. [default: auto]", default=None
    )
    report: bool = parameters.report_option


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFiles:
    """What became of :func:`calibrate_rig_files`.

    Attributes:
        rig: the rig.
        files: what was written, rig.yaml first.

    """

    rig: Rig
    files: list[Path]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig calibrate --json`` prints."""
        from cubicfish_cli.words.camera import verdict_record

        return {
            **self.rig.as_record(),
            "model": str(self.files[0]),
            "verdict": verdict_record(self.rig.verdict),
        }


def calibrate_rig_files(options: RigOptions, *, run: Run = Run()) -> RigFiles:
    """Calibrate several cameras on one body from files, as ``cubicfish rig calibrate`` does.

    Raises:
        UsageError: the options do not go together.
        CubicfishError: an input cannot be used, a file exists and may not be replaced, or no rig
            can be fitted.

    """
    from cubicfish import calibrate_rig, load_camera, load_rig, save_corners, save_rig
    from cubicfish.rigs.rig import REFINED
    from cubicfish.rigs.shots import TOLERANCE, load_shots, load_times
    from cubicfish_cli.extensions.rigs.films import keeping_frames, moving_corners, rig_frames
    from cubicfish_cli.extensions.rigs.inputs import (
        check_camera_inputs,
        is_calibrated,
        load_camera_inputs,
        read_for,
    )
    from cubicfish_cli.extensions.rigs.report import write_rig_page
    from cubicfish_cli.extensions.rigs.words import rig_with_texts
    from cubicfish_cli.films.scan import room_for_frames
    from cubicfish_cli.observe import films_among
    from cubicfish_cli.render import drawing as extra

    source, cameras, names = TargetSource.of(options.target), options.cameras, options.names
    if isinstance(cameras, Mapping):
        names, cameras = ",".join(cameras), list(cameras.values())
    inputs = paths_of(cameras)
    called = _name_cameras(inputs, names)
    lenses = _name_lenses(options.lenses, called)
    films = films_among(inputs)
    _refuse_unused(options, inputs, films)
    if films:
        source.check()
    elif check_camera_inputs(inputs, source, run) and options.refine_target is not None:
        raise UsageError("--refine-target is of a target, and 2D-3D pairs have none: leave it out")
    kept = {name for name, path in zip(called, inputs, strict=True) if is_calibrated(path)}
    for name, given in (
        ("--hold-lenses", options.hold_lenses),
        ("--refine-target", options.refine_target is not None),
    ):
        if given and len(kept | {*lenses}) == len(called):
            raise UsageError(f"{name} is of cameras that are calibrated here: leave it out")
    run.date()  # said before the work if it cannot be
    place, listener = Path(options.folder), run.listener
    pages = [place / PAGE] if options.report and not extra.missing(extra.REPORT) else []
    own_files = [place / name / "camera.yaml" for name in called]
    corners = [place / name / "corners.csv" for name in called]
    refined = [place / REFINED] if options.refine_target != "off" else []
    plan = Plan(run).reads(read_for(inputs), source, options.shots, options.times, lenses)
    plan.writes(place / "rig.yaml", *pages, *own_files, *corners, *refined)
    known: dict[str, Calibrated] = {
        name: load_camera(one) if isinstance(one, Path) else one for name, one in lenses.items()
    }
    by = "films" if films else str(options.shots or ("time" if options.tolerance else "name"))
    refine_target = options.refine_target or "auto"
    frames: list[ShotFrame] = []
    loaded, moving = {}, {}
    with room_for_frames(place / "frames") as room:
        if films:
            frames = rig_frames(
                dict(zip(called, inputs, strict=True)),
                place / "frames",
                room,
                source.load(),
                run,
                plan,
                most=options.most or MOST,
                tolerance=options.tolerance,
            )
        with keeping_frames(frames, place / "frames"):
            for name, path in zip(called, inputs, strict=True):
                listener.tell(Event.CAMERA, name=name, path=path)
                shown = [frame for frame in frames if frame.camera == name]
                photos = [frame.picture for frame in shown] or [path]
                loaded[name], camera = load_camera_inputs(photos, source, run)
                if camera is not None:
                    known.setdefault(name, camera)
                if shown:
                    moving[name] = moving_corners(shown, loaded[name].pairs, listener)
            first = loaded[called[0]]
            rows = [(one.shot, one.camera, one.picture.name) for one in frames]
            rig = calibrate_rig(
                {name: own.given for name, own in loaded.items()},
                first.pairs.target,
                shots=rows or (load_shots(Path(options.shots)) if options.shots else by),
                tolerance=options.tolerance or TOLERANCE,
                times=None if options.times is None else load_times(Path(options.times), called),
                moving=moving,
                known=known,
                hold_lenses=options.hold_lenses,
                refine_target=refine_target,
                listener=listener,
            )
            rig = rig_with_texts(rig)
            files = [file for own in loaded.values() for file in own.files]
            asked_for = {
                "hold_lenses": options.hold_lenses,
                "refine_target": refine_target,
                "shots": by,
            }
            made_by = run.made_by(asked_for, first.target_file, files)
            listener.progress("Writing")
            written = save_rig(place, rig, made_by=made_by, overwrite=run.overwrite)
            for path, own in zip(corners, loaded.values(), strict=True):
                save_corners(path, own.pairs, overwrite=run.overwrite)
            for page in pages:
                write_rig_page(load_rig(written[0]), page, run)
    return RigFiles(rig=rig, files=[*written, *corners, *pages])


def _refuse_unused(options: RigOptions, inputs: Sequence[Path], films: Sequence[Path]) -> None:
    """Refuse inputs that do not go together, and options that say nothing of them."""
    if films and len(films) < len(inputs):
        raise UsageError(
            f"{quoted(str(films[0]))} is a film, and other cameras have none: give a film of each "
            "camera, or take its frames with 'cubicfish frames'"
        )
    if films and (options.shots or options.times):
        raise UsageError("--shots and --times go with photos: films are matched by time")
    if options.most is not None and not films:
        raise UsageError("--most goes with films: photos are all taken")
    if options.shots and options.tolerance:
        raise UsageError(f"--shots {options.shots} says what is a shot: leave --tolerance out")


def _name_lenses(
    lenses: Mapping[str, Calibrated | StrPath] | Sequence[Path], called: Sequence[str]
) -> Mapping[str, Calibrated | Path]:
    """Cameras that are calibrated already, or their files, by name."""
    if not isinstance(lenses, Mapping):  # left=left_calibration
        lenses = {name: path for name, _, path in (str(one).partition("=") for one in lenses)}
    for name in lenses:
        if name not in called:
            raise UsageError(
                f"--lens {quoted(name)} names no camera: write NAME=FILE with one of "
                f"{', '.join(called)}"
            )
    return {
        name: in_folder(Path(one)) if isinstance(one, str | os.PathLike) else one
        for name, one in lenses.items()
    }


def _name_cameras(inputs: Sequence[Path], given: str | None) -> list[str]:
    """What the cameras are called."""
    from cubicfish.rigs.rig import refuse_name
    from cubicfish_cli.extensions.rigs.inputs import named_by

    if len(inputs) < 2:
        raise UsageError("name two cameras or more: a folder of photos each, or a corners.csv")
    names = [*map(named_by, inputs)] if given is None else [*map(str.strip, given.split(","))]
    if len(names) != len(inputs):
        named = plural(len(names), "name")
        raise UsageError(f"--names has {named}, and there are {len(inputs)} cameras")
    if len(set(names)) < len(names) or not all(names):
        raise UsageError(
            f"the cameras would be called {', '.join(names)}: give each a name of its own with "
            "--names"
        )
    for name in names:
        refuse_name(name, "camera", UsageError)
    return names


@as_command(
    "calibrate",
    "Find where cameras stand on one body, from photos of all of them.",
    "cubicfish rig calibrate left/ right/ --target target.yaml",
    "cubicfish rig calibrate left.csv right.csv rear.csv --target target.yaml -o rig",
    "cubicfish rig calibrate left/ right/ --lens left=left_calibration",
    "cubicfish rig calibrate cam0.mp4 cam1.mp4 cam2.mp4 cam3.mp4 --target target.yaml",
    "cubicfish rig calibrate run.bag:/cam0/image_raw run.bag:/cam1/image_raw --names a,b",
    do=calibrate_rig_files,
    how=("max_rms", "overwrite", "as_json", "jobs", "no_cache"),
)
def command(made: RigFiles, given: RigOptions, how: How) -> None:
    """Calibrate several cameras on one body: their lenses, and where each stands.

    Move the rig about the target, or the target about the rig. Photos of one shot have the same
    name in each camera's folder. From films it chooses moments at which several cameras see the
    target sharply, and fits how far their clocks differ. The cameras' fields need not overlap: two
    cameras are connected where each sees some board of the target in the same shot.
    """
    printed = how.print(made)
    for finding in made.rig.fit.findings:
        print_message(f"{mark_of(finding)}: {render(finding).line}")
    if not printed:
        apart()
        print_rig(made.rig)
        result()
        print_wrote(made.files)
    enforce_max_rms(made.rig.fit.rms_px, how.max_rms)
