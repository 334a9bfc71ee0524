"""``cubicfish rig calibrate``: photos of several cameras on one body to where each stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import Event, Run, UsageError, quoted
from cubicfish.files import Content, StrPath
from cubicfish_cli.core_table import CALIBRATION_FILES, FRAMES
from cubicfish_cli.extension_guard import Place
from cubicfish_cli.extensions.rigs.options import times_option
from cubicfish_cli.extensions.rigs.printed import print_rig
from cubicfish_cli.films import MOST
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.render.pages import PAGE
from cubicfish_cli.stages import camera_files, origin, page
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
from cubicfish_cli.terminal.terminal import apart, print_message, print_removed, print_wrote, result
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import Calibration, CameraFile, Rig, Target
    from cubicfish.fit import RefineTarget
    from cubicfish_cli.extensions.rigs.films import ShotFrame
    from cubicfish_cli.observe import Inputs


# What there is of each camera.
_OF_CAMERA = ("camera", "corners")


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
        "Fit the target too, as 'cubicfish calibrate' does. [default: auto]"
    )
    report: bool = parameters.report_option

    @cached_property
    def source(self) -> TargetSource:
        """The target, or where it is."""
        return TargetSource.of(self.target)

    @cached_property
    def inputs(self) -> dict[str, Path]:
        """The cameras' inputs, by name."""
        from cubicfish_cli.extensions.rigs.naming import named_cameras

        return named_cameras(self.cameras, self.names)

    @cached_property
    def known(self) -> dict[str, Calibration | CameraFile | Path]:
        """Cameras that are calibrated already, or their files, by name."""
        from cubicfish_cli.extensions.rigs.naming import named_lenses

        return named_lenses(self.lenses, self.inputs)

    @cached_property
    def films(self) -> list[Path]:
        """The inputs that are films."""
        from cubicfish_cli.observe import films_among

        return films_among(list(self.inputs.values()))

    @property
    def how(self) -> dict[str, Any]:
        """The options of the fit."""
        return {"hold_lenses": self.hold_lenses, "refine_target": self.refine_target or "auto"}

    @property
    def matching(self) -> str:
        """By what photos are said to be of one shot."""
        if self.films:
            return "films"
        return str(self.shots or ("time" if self.tolerance else "name"))

    @property
    def has_page(self) -> bool:
        """Whether a page is made."""
        return self.report and not extra.missing(extra.REPORT)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFiles:
    """What became of :func:`calibrate_rig_files`.

    Attributes:
        rig: the rig.
        files: what was written, rig.yaml first.
        removed: files of an earlier rig that were removed.

    """

    rig: Rig
    files: list[Path]
    removed: list[Path]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig calibrate --json`` prints.

        Keys:
            units: of lengths: the target's; null for pairs that came without one
            cameras: a record per camera: name, camera (its file), camera_from_rig, position,
                covariance, turn_sigma_deg, shift_sigma, fit (its errors in pixels)
            pairs: a record for every two cameras: cameras, shots (in common), rms_px
            fit: of all: errors in pixels, held_out_rms_px, shots, refine_target, held_lenses,
                findings (with the keys of everything that is told, cameras, shots and line),
                per_shot
            model: the rig's file
            verdict: level (good, care or bad), words, figures, and reasons, a record each, with
                why: what and evidence in one

        """
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
    from cubicfish_cli.extensions.rigs.films import keeping_frames

    folder, plan = Path(options.folder), _plan(options, run)
    observed = _observe(options, plan, run)
    with keeping_frames(observed.frames, folder / FRAMES):
        rig = _fit(options, observed, run)
        contents = _make_contents(options, rig, observed, run)
        run.listener.progress("Writing")
        files = plan.write({folder / name: content for name, content in contents.items()})
    return RigFiles(rig=rig, files=files, removed=plan.removed)


def _plan(options: RigOptions, run: Run) -> Plan:
    """Say what is read, and what may be written."""
    from cubicfish_cli.extensions.rigs.inputs import check_camera_inputs, is_calibrated, read_for

    cameras, lenses, source = options.inputs, options.known, options.source
    _refuse_unused(options)
    if options.films:
        source.check()
    elif check_camera_inputs([*cameras.values()], source, run) and options.refine_target:
        raise UsageError("--refine-target is of a target, and 2D-3D pairs have none: leave it out")
    if all(name in lenses or is_calibrated(path) for name, path in cameras.items()):
        _refuse_options_of_fits(options)
    run.date()  # said before the work if it cannot be
    plan = Plan(run).reads(
        read_for([*cameras.values()]), source, options.shots, options.times, lenses
    )
    folder = Path(options.folder)
    refined, page_file = folder / CALIBRATION_FILES["target"], folder / PAGE
    plan.leaves(refined, page_file)
    plan.writes(
        folder / "rig.yaml",
        *(path for name in cameras for path in camera_files(folder, name, _OF_CAMERA).values()),
        *([refined] if options.refine_target != "off" else []),
        *([page_file] if options.has_page else []),
    )
    return plan


def _refuse_unused(options: RigOptions) -> None:
    """Refuse inputs that do not go together, and options that say nothing of them."""
    films = options.films
    if films and len(films) < len(options.inputs):
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


def _refuse_options_of_fits(options: RigOptions) -> None:
    """Refuse what says how cameras are calibrated, where all of them are already."""
    for name, given in (
        ("--hold-lenses", options.hold_lenses),
        ("--refine-target", options.refine_target is not None),
    ):
        if given:
            raise UsageError(f"{name} is of cameras that are calibrated here: leave it out")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Observed:
    """What the cameras saw.

    Attributes:
        inputs: of each camera by name, its corners or points.
        frames: of films, those that were chosen.
        known: what is known of cameras and photos, as :func:`calibrate_rig` takes it.

    """

    inputs: Mapping[str, Inputs]
    frames: Sequence[ShotFrame]
    known: Mapping[str, Any]


def _observe(options: RigOptions, plan: Plan, run: Run) -> _Observed:
    from cubicfish import load_camera
    from cubicfish_cli.extensions.rigs.films import keeping_frames, measure_motion, rig_frames
    from cubicfish_cli.extensions.rigs.inputs import load_camera_inputs
    from cubicfish_cli.films.scan import room_for_frames

    matching, source, folder = _read_matching(options), options.source, Path(options.folder)
    lenses = {
        name: load_camera(one) if isinstance(one, Path) else one
        for name, one in options.known.items()
    }
    inputs, motion = {}, {}
    frames: list[ShotFrame] = []
    with room_for_frames(folder / FRAMES) as room:
        if options.films:
            frames = rig_frames(
                options.inputs,
                folder / FRAMES,
                room,
                source.load(),
                run,
                plan,
                most=options.most or MOST,
                tolerance=options.tolerance,
            )
            matching["shots"] = [(one.shot, one.camera, one.picture.name) for one in frames]
        with keeping_frames(frames, folder / FRAMES):
            for name, path in options.inputs.items():
                run.listener.tell(Event.CAMERA, name=name, path=path)
                shown = [frame for frame in frames if frame.camera == name]
                photos = [frame.picture for frame in shown] or [path]
                inputs[name], camera = load_camera_inputs(photos, source, run)
                if camera is not None:
                    lenses.setdefault(name, camera)
                if shown:
                    motion[name] = measure_motion(shown, inputs[name].pairs, run.listener)
    known = {**matching, "known": lenses, "moving": motion}
    return _Observed(inputs=inputs, frames=frames, known=known)


def _read_matching(options: RigOptions) -> dict[str, Any]:
    """Which photos are of one shot, and when they were taken: before these are searched."""
    from cubicfish_cli.extensions.rigs.tables import load_shots, load_times

    shots, times = options.shots, options.times
    return {
        "shots": options.matching if shots is None else load_shots(Path(shots)),
        "tolerance": options.tolerance,
        "times": None if times is None else load_times(Path(times), list(options.inputs)),
    }


def _fit(options: RigOptions, observed: _Observed, run: Run) -> Rig:
    from cubicfish import calibrate_rig
    from cubicfish_cli.extensions.rigs.words import rig_with_texts

    inputs = list(observed.inputs.values())
    rig = calibrate_rig(
        {name: own.given for name, own in observed.inputs.items()},
        inputs[0].pairs.target,
        listener=run.listener,
        **observed.known,
        **options.how,
    )
    made_by = origin(inputs, {**options.how, "shots": options.matching}, run)
    return rig_with_texts(replace(rig, made_by=made_by))


def _make_contents(
    options: RigOptions, rig: Rig, observed: _Observed, run: Run
) -> dict[str, Content | None]:
    """What files hold, by their names in the folder; rig.yaml, which is first, is written last."""
    from cubicfish_cli.stages import corners_content

    contents: dict[str, Content | None] = {**rig.texts()}
    for name, own in observed.inputs.items():
        contents[f"{name}/{CALIBRATION_FILES['corners']}"] = corners_content(own.pairs)
    if options.has_page:
        contents[PAGE] = page(Place("rigs", f"{__package__}.page:rig_html"), rig, run=run)
    return contents


@as_command(
    "calibrate",
    "Calibrate several cameras on one body.",
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
    cameras are connected where each sees some board of the target in the same shot. --overwrite
    also removes what an earlier rig left in the folder.
    """
    printed = how.print(made)
    for finding in made.rig.fit.findings:
        print_message(f"{mark_of(finding)}: {render(finding).line}")
    if not printed:
        apart()
        print_rig(made.rig)
        result()
        print_wrote(made.files)
    print_removed(made.removed)
    enforce_max_rms(made.rig.fit.rms_px, how.max_rms)
