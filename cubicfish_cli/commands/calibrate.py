"""``cubicfish calibrate``: photos of a known target to a camera."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from cubicfish import Event, Run, UsageError
from cubicfish.files import Content, Fingerprint, StrPath
from cubicfish_cli.core_table import FRAMES
from cubicfish_cli.films import MOST
from cubicfish_cli.inputs.paths import InputKind, check_inputs, kind_of_inputs, paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.render.pages import PAGE
from cubicfish_cli.stages import (
    camera_files,
    corners_content,
    extension_outputs,
    origin,
    page,
    photos_of,
)
from cubicfish_cli.terminal import figures, parameters
from cubicfish_cli.terminal.parameters import (
    DEFAULT_MODEL,
    as_command,
    option,
    record,
    target_options,
)
from cubicfish_cli.terminal.progress import How, report_left_out
from cubicfish_cli.terminal.terminal import (
    apart,
    detail,
    print_message,
    print_next,
    print_removed,
    print_wrote,
    result,
)
from cubicfish_cli.words.phrases import counted, plural, shell_line
from cubicfish_cli.words.sentences import render, with_texts

if TYPE_CHECKING:
    from cubicfish import Calibration, CubicCamera, Target, Verdict
    from cubicfish.fit import PointCalibration, RefineTarget
    from cubicfish.judge import FitRecord
    from cubicfish_cli.observe import Inputs

_LONGEST_TITLE = 100
# The case of a finding: boards' places were measured, which the target's file did not know.
_PLACED = "found"

# Only a calibration makes them, for its own camera. A corners.csv may be the user's own.
_ITS_OWN = ("map", "target")


@record
class CalibrateOptions:
    """Options of :func:`calibrate_files`: the inputs, the fit, and what is written.

    Attributes:
        inputs: photos (files, folders and globs), films, or one corners.csv or correspondences.csv.
        target: the calibration target, or its file; 2D-3D pairs have none.
        correspondences: a table of 2D-3D pairs in the place of ``inputs``.
        image_size: (width, height) of the photos, for tables that do not say.
        noise: standard deviation of the points of 2D-3D pairs along x and along y, pixels.
        folder: where camera.yaml and what goes with it is written.
        title: what the camera is called.
        refine_target: as in :func:`calibrate`; by default ``auto``.
        hold_out: as in :func:`calibrate`.
        lift: the argument of the cubics: the viewing ray, or the 3D point itself.
        goal_px: the uncertainty wanted over 95 % of the field, by which the verdict goes then; None
            for what is usual.
        most: calibrate from at most so many photos or frames, those that add most; None means 60
            frames of films, and all photos.
        exclude: photos that are left out, by their names or by patterns.
        report: also write report.html, if the extra ``report`` is installed.

    Raises:
        UsageError: the options do not go together.

    """

    inputs: StrPath | Sequence[StrPath] = parameters.argument(
        "Photos (files, folders or globs), films, or one corners.csv or correspondences.csv.",
        nargs=-1,
        metavar="[PHOTOS|FILM|CSV]...",
    )
    target: TargetSource | Target | StrPath | None = target_options
    correspondences: StrPath | None = option(
        "--correspondences FILE",
        "2D-3D pairs instead of photos: a CSV file with the columns image,X,Y,Z,x,y.",
        parameters.FILE,
    )
    image_size: tuple[int, int] | None = parameters.size_option
    noise: float | None = option(
        "--noise PX",
        "How exact the points of 2D-3D pairs are: one standard deviation along x and along y. "
        "Errors that this explains do not count against the camera.",
        parameters.FloatRange(min=0, min_open=True),
    )
    folder: StrPath = parameters.output_option(
        "Where camera.yaml, undistort_map.npz, corners.csv and report.html go.",
        default="calibration",
        folder=True,
    )
    title: str | None = option("--title TEXT", "What to call this camera in its file and report.")
    refine_target: RefineTarget | None = parameters.refine_target_option(
        "Fit the target too: the shapes and places of its boards (shape), or also the place of "
        "each corner (points). auto goes on as long as the held-out error falls. [default: auto]",
    )
    hold_out: bool = option(
        "--hold-out/--no-hold-out",
        "Measure the error on photos that are left out of the fit. This takes five more fits, and "
        "--refine-target auto needs it.",
        default=True,
    )
    lift: Literal["ray", "point"] = option(
        "--lift",
        "What the cubics are functions of: the viewing ray, as most commands need it, or the 3D "
        "point itself, as the paper has it, which holds only where the corners were.",
        parameters.Choice(["ray", "point"]),
        "ray",
    )
    goal_px: float | None = option(
        "--goal PX",
        "The uncertainty wanted over 95 % of the field. The verdict goes by it: good within it, "
        "not to be trusted where half of the field is beyond it. [default: 0.2 px is good, and 1 "
        "px not to be trusted; more in photos above 2000 pixels]",
        parameters.FloatRange(min=0, min_open=True),
    )
    most: int | None = option(
        "--most N",
        "Calibrate from at most N photos or frames, those that add most. [default: all "
        f"photos, and of films {MOST} frames]",
        click.IntRange(min=1),
    )
    exclude: StrPath | Sequence[StrPath] = parameters.exclude_option
    report: bool = parameters.report_option

    @cached_property
    def source(self) -> TargetSource:
        """The target, or where it is."""
        return TargetSource.of(self.target)

    @cached_property
    def paths(self) -> list[Path]:
        """The inputs."""
        if self.correspondences is None:
            return paths_of(self.inputs)
        return [Path(self.correspondences)]

    @cached_property
    def kind(self) -> InputKind:
        """What the inputs are."""
        return kind_of_inputs(self.paths) if self.correspondences is None else "points"

    @property
    def how(self) -> dict[str, Any]:
        """The options of the fit, as the camera's file has them."""
        if self.lift == "point":
            return {"lift": self.lift}
        return {"hold_out": self.hold_out, "refine_target": self.refine_target or "auto"}

    def __post_init__(self) -> None:
        if self.correspondences is not None and paths_of(self.inputs):
            raise UsageError("give photos (or corners.csv) or --correspondences, not both")
        title = self.title
        if title is not None and (
            not title.strip() or not title.isprintable() or len(title) > _LONGEST_TITLE
        ):
            raise UsageError(
                f"--title must be a line of plain text, of at most {_LONGEST_TITLE} characters"
            )
        for name, given in (("--refine-target", self.refine_target), ("--goal", self.goal_px)):
            if self.lift == "point" and given is not None:
                raise UsageError(f"{name} goes with --lift ray: leave it out")
        if self.refine_target == "auto" and not self.hold_out:
            raise UsageError(
                "--refine-target auto goes by photos that are held out, and not with "
                "--no-hold-out: choose off, shape or points"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedFiles:
    """Result of :func:`calibrate_files`.

    Attributes:
        fitted: the fit; a :class:`PointCalibration` where the lift was ``point``.
        inputs: what it was fitted to.
        files: what was written, by what it holds, such as ``camera``.
        removed: files of an earlier calibration that were removed.
        advice: one line on what to photograph next; None for the lift ``point``.

    """

    fitted: Calibration | PointCalibration
    inputs: Inputs
    files: dict[str, Path]
    removed: list[Path]
    advice: str | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish calibrate --json`` prints.

        Keys:
            those of :class:`~cubicfish.judge.fit_record.FitRecord`
            photo_problems: photos that gave nothing and grids that were left out, a line each;
                null where no photos were searched
            remarks: what else is told, a record each: photos and grids that were left out
            verdict: level (good, care or bad), words, figures, and reasons, a record each, with
                why: what and evidence in one
            advice: whether more photos are needed, and of what, in a line; not with --lift
                point
            summary: the camera in one line
            chosen: why no more photos or frames were chosen, in a sentence; null where all were
                taken
            report: the page; null where none was written
            model: the camera's file
            files: every file that was written, by its kind

        """
        from cubicfish_cli.words.camera import verdict_record

        return {
            **self.fitted.as_record(),
            **self.inputs.remarks(self.fitted.unfit.values()),
            **({} if self.advice is None else {"advice": self.advice}),
            "summary": self.fitted.line,
            "chosen": self.fitted.made_by.get("chosen"),
            "verdict": verdict_record(self.fitted.verdict),
            "report": self.files.get("report"),
            "files": self.files,
            "model": self.files["camera"],
        }


def calibrate_files(options: CalibrateOptions, *, run: Run = Run()) -> CalibratedFiles:
    """Calibrate a camera from files into a folder, as ``cubicfish calibrate`` does.

    Everything is written together at the end, or nothing is, but for frames of films.

    Raises:
        UsageError: the options do not go together.
        CubicfishError: an input cannot be used, a file exists and may not be replaced, or no camera
            can be fitted.

    """
    plan, goals = _plan(options, run)
    observed = _observe(options, run)
    nominal = observed.nominal(options.source)
    fitted, observed = _fit(observed, options, run)
    made_by = _explain_origin(observed, nominal, goals, options, run)
    if fitted.fit.marked is not None and options.noise is not None:
        marked = replace(fitted.fit.marked, noise_px=options.noise)
        fitted = replace(fitted, fit=replace(fitted.fit, marked=marked))
    fitted = replace(fitted, fit=with_texts(fitted.fit), made_by=made_by)
    contents = _make_contents(fitted, observed, goals, nominal, run)
    run.listener.progress("Writing")
    written = plan.write({goals[kind]: content for kind, content in contents.items()})
    from cubicfish_cli.words.sufficiency import summary

    return CalibratedFiles(
        fitted=fitted,
        inputs=observed,
        files={kind: path for kind, path in goals.items() if path in written},
        removed=plan.removed,
        advice=summary(fitted, fitted.pairs),
    )


def _plan(options: CalibrateOptions, run: Run) -> tuple[Plan, dict[str, Path]]:
    """Say what is read, and where each result goes that may be written, by its kind."""
    kind, inputs = options.kind, options.paths
    check_inputs(kind, inputs, options.source, run, image_size=options.image_size)
    if kind == "points" and options.refine_target is not None:
        raise UsageError("--refine-target does not go with 2D-3D pairs, which have no target")
    if kind != "points" and options.noise is not None:
        raise UsageError("--noise is of 2D-3D pairs: corners show by themselves how exact they are")
    if kind != "photos" and options.most is not None:
        raise UsageError("--most goes with photos and films, not with CSV files")
    run.date()  # an unusable date is an error before the work, not after
    plan, folder = Plan(run).reads(inputs, options.source), Path(options.folder)
    pages = extension_outputs()
    goals = camera_files(folder) | {name: folder / one.file for name, (_, one) in pages.items()}
    plan.leaves(*(goals[name] for name in (*_ITS_OWN, *pages)))
    needless = {
        # Corners that were read from this very file need not be written again.
        "corners": kind == "points" or plan.is_read(goals["corners"]),
        "drawn": not options.source.needs_file,
        "target": options.refine_target == "off" and plan.is_read(goals["target"]),
        **{
            name: not options.report or extra.missing(one.needs) for name, (_, one) in pages.items()
        },
    }
    goals = {name: path for name, path in goals.items() if not needless.get(name)}
    plan.writes(*goals.values())
    return plan, goals


def _observe(options: CalibrateOptions, run: Run) -> Inputs:
    """Find or read the corners, or the points."""
    from cubicfish_cli.observe import load_inputs

    source, most, size = options.source, options.most, options.image_size
    frames = Path(options.folder) / FRAMES
    photos, made, chosen = photos_of(options.paths, frames, source, most, run)
    observed = load_inputs(
        options.kind,
        photos,
        source,
        run,
        image_size=size,
        most=most,
        exclude=paths_of(options.exclude),
        unplaced=True,
        made=made,
    )
    run.listener.found(observed.photo_findings)
    return replace(observed, chosen=observed.chosen or chosen)


def _fit(
    observed: Inputs, options: CalibrateOptions, run: Run
) -> tuple[Calibration | PointCalibration, Inputs]:
    """Fit a camera, which may also tell the corners' names."""
    uncertain = set(observed.pairs.image[~observed.pairs.certain].tolist())
    if options.refine_target in (None, "auto") and uncertain:
        run.listener.tell(Event.NOT_CERTAIN, photos=len(uncertain))
    points = {"points": True} if options.kind == "points" else {}
    run.listener.tell(Event.FITTING, corners=len(observed.pairs.pixel), **points)
    if options.lift == "point":
        from cubicfish.fit import calibrate_points

        run.listener.progress("Fitting")
        return calibrate_points(observed.pairs, hold_out=options.hold_out), observed
    from cubicfish import calibrate

    how, goal = options.how, options.goal_px
    fitted = calibrate(observed.given, **how, goal_px=goal, listener=run.listener)
    return fitted, observed.named_by(fitted)


def _explain_origin(
    observed: Inputs,
    nominal: str | None,
    goals: Mapping[str, Path],
    options: CalibrateOptions,
    run: Run,
) -> dict[str, Any]:
    """Say where a camera comes from, as its file does; ``nominal`` is a target without a file."""
    drawn = None if nominal is None else Fingerprint.of_text(goals["drawn"], nominal)
    return {
        **({} if options.title is None else {"title": options.title}),
        **origin([observed], options.how, run, drawn),
        **({} if observed.chosen is None else {"chosen": observed.chosen}),
    }


def _make_contents(
    fitted: Calibration | PointCalibration,
    observed: Inputs,
    goals: Mapping[str, Path],
    nominal: str | None,
    run: Run,
) -> dict[str, Content | None]:
    """Return what the planned files hold, by their kind; None for those that are not to be."""
    from cubicfish import Calibration

    contents: dict[str, Content | None] = {"camera": fitted.text()}
    if "corners" in goals and observed.corners is not None:
        contents["corners"] = corners_content(observed.corners)
    if nominal is not None:
        contents["drawn"] = nominal
    if isinstance(fitted, Calibration):
        contents["map"] = _make_map(fitted.camera)
        if contents["map"] is None:
            width, height = fitted.camera.image_size
            run.listener.tell(Event.NO_MAP, width=width, height=height)
        measured = any(one.case == _PLACED for one in fitted.fit.findings)
        if (fitted.refined != "off" or measured) and fitted.target is not None:
            contents["target"] = fitted.target.text()
    for name, (maker, _) in extension_outputs().items():
        if name in goals:
            contents[name] = page(maker, fitted, observed.pairs, observed.photos, run=run)
    return contents


def _make_map(camera: CubicCamera) -> Content | None:
    from cubicfish import build_view
    from cubicfish.photos import PictureFile
    from cubicfish.views import MapInBands

    if math.prod(camera.image_size) > PictureFile.MAX_PIXELS:
        return None
    return MapInBands.of_camera(camera, build_view(camera)).write


@as_command(
    "calibrate",
    "Calibrate a camera from photos of a target.",
    "cubicfish calibrate photos/ --target target.yaml",
    "cubicfish calibrate photos/ --board 9x6 --square 25mm --title 'front left'",
    "cubicfish calibrate film.mp4 --target target.yaml",
    "cubicfish calibrate corners.csv --target target.yaml -o lens_a --max-rms 0.5",
    "cubicfish calibrate --correspondences pairs.csv --size 1280x800",
    do=calibrate_files,
    how=("max_rms", "overwrite", "as_json", "jobs", "no_cache"),
)
def command(made: CalibratedFiles, given: CalibrateOptions, how: How) -> None:
    """Calibrate a camera from PHOTOS (files, folders or globs) of the target in target.yaml.

    One flat checkerboard needs no file: give --board 9x6 --square 25mm instead. A corners.csv, from
    'cubicfish detect' or any other detector, may take the place of the photos. From films, frames
    are chosen and kept in the folder, as 'cubicfish frames' does. All other files are written
    together at the end, or none is. --overwrite also removes what an earlier calibration left in
    the folder.
    """
    fitted, printed = made.fitted, how.print(made)
    report_left_out(fitted.unfit)
    _report_findings(fitted.fit)
    print_removed(made.removed)
    _report_missing_page(made.files, wanted=given.report)
    if not printed:
        apart()
        _print_calibration(made, given.source.path)
    figures.enforce_max_rms(fitted.fit.rms_px, how.max_rms)


def _report_missing_page(files: Mapping[str, Path], *, wanted: bool) -> None:
    """Say how to get a page if there is none, and that an old page is out of date."""
    if "report" in files:
        return
    old = files["camera"].with_name(PAGE)
    if old.exists():
        print_message(f"note: {old} is of an earlier calibration")
    if wanted and extra.missing(extra.REPORT):
        report = shell_line("cubicfish", "report", old.parent)
        print_message(f"No {PAGE} was written: {extra.INSTALL}, then {report!r}, makes it.")


def _report_findings(fit: FitRecord) -> None:
    """Say what is odd about a fit, on stderr."""
    for one in fit.dropped_corners:
        place = f"{one.image} {one.board} column {one.column} row {one.row}"
        detail(f"dropped: {place}: {one.error_px:.1f} px off")
    for finding in fit.findings:
        print_message(f"{figures.mark_of(finding)}: {render(finding).line}")


def _print_calibration(made: CalibratedFiles, target: Path | None) -> None:
    """Print the figures, the photos, the files, the verdict, and what to do next."""
    from cubicfish_cli.words.camera import headline

    fitted, fit, detection = made.fitted, made.fitted.fit, made.inputs.detection
    judged, first = fitted.verdict, headline(fitted)
    result(f"{first}: {judged.words}", mark=(judged.words, judged.level))
    result(f"{fitted.title}: {fitted.lens_line}\n" if fitted.title else f"{fitted.lens_line}\n")
    _print_figures(fitted)
    lost = dict.fromkeys(fitted.unfit, "left out")  # stderr has the reasons
    lost |= figures.why_lost(detection)
    by_board = figures.corners_by_board(fitted.pairs)
    rows = figures.fitted_rows(fitted, by_board, lost)
    everything = str(made.files["camera"])
    figures.print_photo_table(
        rows, fitted.pairs.boards, everything=everything, apart=True, fold=True
    )
    result()
    _print_object(fit)
    print_wrote(made.files.values())
    result(f"\n{first}")
    figures.print_verdict(judged, alone=True)
    if judged.level == "care" and any(reason.asks_for_photos for reason in judged.reasons):
        result(f"advice: {made.advice}")
    if fit.lift == "point":
        camera = made.files["camera"]
        print_next(shell_line("cubicfish", "project", "POINTS", "--model", camera))
        return
    used = {Path(name).name for name in fitted.pairs.images}
    photo = next((photo for photo in made.inputs.photos if photo.name in used), None)
    print_next_steps(judged, made.files["camera"], photo, target, made.files.get("report"))


def _print_figures(fitted: Calibration | PointCalibration) -> None:
    from cubicfish_cli.words.camera import scope

    fit, more = fitted.fit, list[tuple[str, float, str]]()
    result(
        f"{counted(fitted.pairs.images)}, "
        f"{plural(fit.corners, 'point' if fit.marked else 'corner')} used, "
        f"{plural(fit.dropped, 'outlier')}{' (-v lists them)' * bool(fit.dropped_corners)}\n"
    )
    if fit.lift == "point":
        judged = "poses by a radial lens"
        more += [
            ("  linear, plain", fit.plain_rms_px, "Eq. 8 and 9"),
            ("  linear, reweighted", fit.reweighted_rms_px, "over its denominators"),
        ]
    else:
        judged = "photos not used in the fit"
        more.append(
            ("  radial reference", fit.radial_rms_px, "a Kannala–Brandt lens, same corners")
        )
    if math.isnan(fit.held_out_rms_px):
        judged = "not measured"
    more.append(("held-out RMS", fit.held_out_rms_px, judged))
    if fit.held_out_folds:
        more.append(("  radial reference", fit.radial_held_out_rms_px, ""))
    figures.print_errors(fit, more)
    for figure in scope(fitted):
        figures.print_figure(*figure)
    if fit.lift == "point":
        meaning = "P means something on the boards only; points off them are refused"
        if fit.rank == 20:
            meaning = "the corners determine P in the volume that they fill"
        figures.print_figure("rank", str(fit.rank), "", f"of 20: {meaning}")
        figures.print_figure("frame", fit.frame or "", "", "of the points that it takes")


def _print_object(fit: FitRecord) -> None:
    """Say what of the target was refined, if anything; the report has the boards."""
    if not fit.departures:
        return
    what = {"shape": "boards' shapes and places", "points": "shapes, places and single corners"}
    levels = {"off": "as drawn", "shape": "shapes", "points": "corners too"}
    tried = ", ".join(
        f"{levels[name]} {figures.px(rms)}" for name, rms in fit.held_out_by_level.items()
    )
    result(
        f"target fitted too: {what[fit.refine_target or '']}"
        + f" (held-out error px: {tried})" * bool(tried)
    )
    if fit.renamed_images:
        photos = plural(len(fit.renamed_images), "photo")
        result(f"corners counted from the other end in {photos}, as the board's shape tells")
    result()


def print_next_steps(
    judged: Verdict, camera: Path, photo: Path | None, target: Path | None, report: Path | None
) -> None:
    """Say what to do next, unless ``--quiet``.

    Args:
        judged: the camera's verdict.
        camera: its file.
        photo: one of the photos of the calibration.
        target: the target's file, if there is one.
        report: the page about it, if there is one.

    """
    lines, first = [], next(iter(judged.reasons), None)
    if judged.level == "care" or (first is not None and first.asks_for_photos):
        lines.append(shell_line("cubicfish", "advise", *_name_folder(camera)))
    elif first is not None and first.remedy == "correct_target" and target is not None:
        lines.append(shell_line("cubicfish", "target", "check", target))
    elif judged.level == "bad" and report is not None:
        lines.append(shell_line("open", report))
    if judged.level != "bad":
        flat = f"flat{photo.suffix.lower()}" if photo is not None else "flat.png"
        option = ("--model", *_name_folder(camera)) if camera != DEFAULT_MODEL else ()
        lines.append(shell_line("cubicfish", "undistort", photo or "PHOTO", flat, *option))
    print_next(*lines)


def _name_folder(camera: Path) -> list[Path]:
    return [] if camera == DEFAULT_MODEL else [camera.parent]
