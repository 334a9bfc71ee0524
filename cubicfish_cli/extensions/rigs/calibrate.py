"""``cubicfish rig calibrate``: photos of several cameras on one body to where each stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import Event, Run, UsageError, quoted
from cubicfish.files import Content, StrPath
from cubicfish_cli.extensions.rigs.options import times_option
from cubicfish_cli.extensions.rigs.printed import print_rig
from cubicfish_cli.films import MOST
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
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import Calibration, CameraFile, Rig, Target
    from cubicfish.fit import RefineTarget
    from cubicfish.rigs import CornerMotion
    from cubicfish_cli.extensions.rigs.films import ShotFrame
    from cubicfish_cli.observe import Inputs


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
    lenses: Mapping[str, Calibration | CameraFile | StrPath] | Sequence[Path] = option(
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

    Everything is written together at the end, or nothing is, but for frames of films.

    Raises:
        UsageError: the options do not go together.
        CubicfishError: an input cannot be used, a file exists and may not be replaced, or no rig
            can be fitted.

    """
    from cubicfish.files import write_files
    from cubicfish_cli.extensions.rigs.films import keeping_frames
    from cubicfish_cli.extensions.rigs.words import rig_with_texts

    plan = _plan(options, run)
    seen = _observe(plan, run)
    with keeping_frames(seen.frames, plan.frames):
        rig = rig_with_texts(_fit(plan, seen, run))
        contents = _make_contents(plan, rig, seen, run)
        run.listener.progress("Writing")
        files = write_files(contents, overwrite=run.overwrite, folder=plan.folder)
    return RigFiles(rig=rig, files=files)


@dataclass(frozen=True, kw_only=True, eq=False)
class _RigPlan:
    """What is read, and what will be written.

    Attributes:
        options: the options.
        cameras: of each camera by name, its input.
        lenses: by name, those that are calibrated already, or their files.
        target: what the cameras see.
        are_films: whether the inputs are films.
        folder: where files go.
        page: the page, if one is made.
        register: of all that is read and written.

    """

    options: RigOptions
    cameras: Mapping[str, Path]
    lenses: Mapping[str, Calibration | CameraFile | Path]
    target: TargetSource
    are_films: bool
    folder: Path
    page: Path | None
    register: Plan

    @property
    def frames(self) -> Path:
        """Where chosen frames of films go."""
        return self.folder / "frames"

    @property
    def corners(self) -> dict[str, Path]:
        """Of each camera, its corners.csv."""
        return {name: self.folder / name / "corners.csv" for name in self.cameras}

    @property
    def refine_target(self) -> RefineTarget:
        """What of the target is fitted."""
        return self.options.refine_target or "auto"

    @property
    def matching(self) -> str:
        """By what photos are said to be of one shot."""
        options = self.options
        by = str(options.shots or ("time" if options.tolerance else "name"))
        return "films" if self.are_films else by


def _plan(options: RigOptions, run: Run) -> _RigPlan:
    from cubicfish_cli.core_table import CALIBRATION_FILES
    from cubicfish_cli.extensions.rigs.inputs import check_camera_inputs, is_calibrated, read_for
    from cubicfish_cli.extensions.rigs.naming import named_cameras, named_lenses
    from cubicfish_cli.observe import films_among
    from cubicfish_cli.render import drawing as extra

    target, folder = TargetSource.of(options.target), Path(options.folder)
    cameras = named_cameras(options.cameras, options.names)
    lenses, inputs = named_lenses(options.lenses, cameras), list(cameras.values())
    films = films_among(inputs)
    _refuse_unused(options, inputs, films)
    if films:
        target.check()
    elif check_camera_inputs(inputs, target, run) and options.refine_target is not None:
        raise UsageError("--refine-target is of a target, and 2D-3D pairs have none: leave it out")
    if all(name in lenses or is_calibrated(path) for name, path in cameras.items()):
        for name, given in (
            ("--hold-lenses", options.hold_lenses),
            ("--refine-target", options.refine_target is not None),
        ):
            if given:
                raise UsageError(f"{name} is of cameras that are calibrated here: leave it out")
    run.date()  # said before the work if it cannot be
    with_page = options.report and not extra.missing(extra.REPORT)
    plan = _RigPlan(
        options=options,
        cameras=cameras,
        lenses=lenses,
        target=target,
        are_films=bool(films),
        folder=folder,
        page=folder / PAGE if with_page else None,
        register=Plan(run).reads(read_for(inputs), target, options.shots, options.times, lenses),
    )
    pages = [] if plan.page is None else [plan.page]
    own_files = [folder / name / "camera.yaml" for name in cameras]
    refined = [] if options.refine_target == "off" else [folder / CALIBRATION_FILES["target"]]
    plan.register.writes(folder / "rig.yaml", *pages, *own_files, *plan.corners.values(), *refined)
    return plan


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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """What the cameras saw.

    Attributes:
        inputs: of each camera by name, its corners or points.
        lenses: of those that are calibrated already.
        frames: of films, those that were chosen.
        motion: of films, how corners move.

    """

    inputs: Mapping[str, Inputs]
    lenses: Mapping[str, Calibration | CameraFile]
    frames: Sequence[ShotFrame]
    motion: Mapping[str, CornerMotion]


def _observe(plan: _RigPlan, run: Run) -> _Seen:
    from cubicfish import load_camera
    from cubicfish_cli.extensions.rigs.films import keeping_frames, measure_motion, rig_frames
    from cubicfish_cli.extensions.rigs.inputs import load_camera_inputs
    from cubicfish_cli.films.scan import room_for_frames

    lenses: dict[str, Calibration | CameraFile] = {
        name: load_camera(one) if isinstance(one, Path) else one
        for name, one in plan.lenses.items()
    }
    inputs, motion = {}, {}
    frames: list[ShotFrame] = []
    with room_for_frames(plan.frames) as room:
        if plan.are_films:
            frames = rig_frames(
                plan.cameras,
                plan.frames,
                room,
                plan.target.load(),
                run,
                plan.register,
                most=plan.options.most or MOST,
                tolerance=plan.options.tolerance,
            )
        with keeping_frames(frames, plan.frames):
            for name, path in plan.cameras.items():
                run.listener.tell(Event.CAMERA, name=name, path=path)
                shown = [frame for frame in frames if frame.camera == name]
                photos = [frame.picture for frame in shown] or [path]
                inputs[name], camera = load_camera_inputs(photos, plan.target, run)
                if camera is not None:
                    lenses.setdefault(name, camera)
                if shown:
                    motion[name] = measure_motion(shown, inputs[name].pairs, run.listener)
    return _Seen(inputs=inputs, lenses=lenses, frames=frames, motion=motion)


def _fit(plan: _RigPlan, seen: _Seen, run: Run) -> Rig:
    from cubicfish import calibrate_rig
    from cubicfish.rigs import load_shots, load_times

    options, first = plan.options, next(iter(seen.inputs.values()))
    rows = [(one.shot, one.camera, one.picture.name) for one in seen.frames]
    if options.shots is not None:
        rows = load_shots(Path(options.shots))
    times = None
    if options.times is not None:
        times = load_times(Path(options.times), list(plan.cameras))
    rig = calibrate_rig(
        {name: own.given for name, own in seen.inputs.items()},
        first.pairs.target,
        shots=rows or plan.matching,
        tolerance=options.tolerance,
        times=times,
        moving=seen.motion,
        known=seen.lenses,
        hold_lenses=options.hold_lenses,
        refine_target=plan.refine_target,
        listener=run.listener,
    )
    asked_for = {
        "hold_lenses": options.hold_lenses,
        "refine_target": plan.refine_target,
        "shots": plan.matching,
    }
    files = [file for own in seen.inputs.values() for file in own.files]
    return replace(rig, made_by=run.made_by(asked_for, first.target_file, files))


def _make_contents(plan: _RigPlan, rig: Rig, seen: _Seen, run: Run) -> dict[Path, Content]:
    """The contents of all files, rig.yaml first: it is written last."""
    from cubicfish_cli.stages import corners_content

    contents: dict[Path, Content] = {plan.folder / name: text for name, text in rig.texts().items()}
    for name, path in plan.corners.items():
        contents[path] = corners_content(seen.inputs[name].pairs)
    if plan.page is not None:
        from cubicfish_cli.extensions.rigs.page import rig_html

        run.listener.progress("Making the report")
        contents[plan.page] = rig_html(rig)
    return contents


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
