"""``cubicfish calibrate``: photos of a known object to a camera."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.calibrate_results import (
    print_calibration,
    print_points,
    say_findings,
    say_next,
)
from cubicfish_cli.cli.choosing import films_among, frames_to_calibrate
from cubicfish_cli.cli.figures import (
    count,
    hold_gate,
    print_verdict,
)
from cubicfish_cli.cli.inputs import (
    Pairs,
    check_inputs,
    load_pairs,
    photo_remarks,
    photos_of,
    say_photo_problems,
)
from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.provenance import check_title, made_at, made_by_record
from cubicfish_cli.cli.report import can_make_pages, make_page, report_option, say_if_no_page
from cubicfish_cli.cli.target_choice import (
    DEFAULT_TARGET,
    TargetChoice,
    recorded_as,
    target_options,
)
from cubicfish_cli.cli.terminal import (
    apart,
    print_json,
    result,
    say,
    stages,
    working,
)
from cubicfish_cli.films import MOST

if TYPE_CHECKING:
    from cubicfish_cli.fitting.calibrate import Calibration, RefineTarget
    from cubicfish_cli.target import Target


@as_command(
    "calibrate",
    "Photos of a known target to a camera and its undistortion map.",
    "cubicfish calibrate photos/ --target target.yaml",
    "cubicfish calibrate photos/ --board 9x6 --square 25mm --title 'front left'",
    "cubicfish calibrate film.mp4 --target target.yaml",
    "cubicfish calibrate corners.csv --target target.yaml -o lens_a --max-rms 0.5",
    "cubicfish calibrate --correspondences pairs.csv --size 1280x800",
)
@options.argument(
    "inputs",
    "Photos (files, folders or globs), films, or one corners.csv or correspondences.csv.",
    nargs=-1,
    metavar="[PHOTOS|FILM|CSV]...",
)
@target_options
@option(
    "--correspondences FILE",
    "2D-3D pairs instead of photos: a CSV file with the columns image,X,Y,Z,x,y.",
    options.FILE,
)
@options.size_option
@options.output_option(
    "Where camera.yaml, undistort_map.npz, corners.csv and report.html go.",
    default="calibration",
    folder=True,
)
@option("--title TEXT", "What to call this camera, in its file and report.")
@options.refine_target_option(
    "Fit the target too: boards' shapes and places, or each corner's own place as well; "
    "auto goes as far as it lowers the held-out error.",
)
@option(
    "--hold-out/--no-hold-out",
    "Measure the error on photos left out of the fit (five more fits; "
    "--refine-target auto needs it).",
    default=True,
)
@option(
    "--lift",
    "What the cubics are of: the viewing ray, a camera for everything else here; or the 3D "
    "point itself, as the paper prints it, which holds only where the corners were.",
    click.Choice(["ray", "point"]),
    "ray",
)
@option(
    "--best N",
    "Calibrate from those N of many photos that add most. [default: all photos, and of films "
    f"{MOST} frames]",
    IntRange(min=1),
)
@option("--compare", "Also fit other lens models to the same corners, and print one table.")
@report_option
@options.max_rms_option
@options.overwrite_option
@options.json_option("calibrate")
@options.jobs_option
@options.no_cache_option
def command(
    inputs: tuple[Path, ...],
    target: TargetChoice,
    correspondences: Path | None,
    size: tuple[int, int] | None,
    output: Path,
    title: str | None,
    refine_target: RefineTarget,
    hold_out: bool,
    lift: str,
    best: int | None,
    compare: bool,
    report: bool,
    max_rms: float | None,
    overwrite: bool,
    as_json: bool,
    jobs: int | None,
    no_cache: bool,
) -> None:
    """Calibrate a camera from PHOTOS (files, folders or globs) of the target in target.yaml.

    One flat checkerboard needs no file: --board 9x6 --square 25mm says it all. A corners.csv,
    from 'cubicfish detect' or any other detector, may stand for the photos. Of films, frames are
    chosen and kept in the folder, as 'cubicfish frames' does. Everything else is written together
    at the end, or nothing is. With --overwrite, what an earlier calibration left in the
    folder goes.
    """
    if lift == "point" and compare:
        raise click.UsageError("--compare is of cameras with rays: it goes with --lift ray")
    check_inputs(inputs, correspondences=correspondences, target=target)
    from cubicfish_cli.advice.advise import summary
    from cubicfish_cli.assess.camera_facts import camera_facts
    from cubicfish_cli.assess.verdict import verdict
    from cubicfish_cli.fitting.calibrate import Calibration
    from cubicfish_cli.fitting.point_fit import PointCalibration, calibrate_points
    from cubicfish_cli.library.calibration import calibrate
    from cubicfish_cli.library.calibration_folder import CalibrationFolder, contents_of
    from cubicfish_cli.target import target_text

    made_at()  # said before the work if it cannot be
    if title is not None:
        check_title(title)
    given = [path for path in (*inputs, target.path, correspondences) if path is not None]
    folder = CalibrationFolder(path=output, inputs=given)
    # Corners that were read from this very file need not be written again.
    with_corners = bool(inputs) and not folder.has_input("corners")
    with_page = report and can_make_pages()
    kinds = {"report": with_page, "corners": with_corners, "drawn": target.counts is not None}
    own = [kind for kind, wanted in kinds.items() if wanted]
    folder.refuse("camera", "map", "target", *own, overwrite=overwrite)
    if refine_target != "off":
        folder.refuse_input("target")
    photos = _photos(inputs, output, target, best, jobs, no_cache=no_cache, overwrite=overwrite)
    loaded = load_pairs(
        photos,
        correspondences=correspondences,
        target=target,
        size=size,
        jobs=jobs,
        no_cache=no_cache,
        best=best,
    )
    if loaded.detection is not None:
        say_photo_problems(loaded.detection)
    uncertain = loaded.pairs.uncertain_images
    if refine_target == "auto" and uncertain:
        say(
            f"{count(len(uncertain), 'photo')} show{'s' * (len(uncertain) == 1)} too little of the "
            "board to tell which corners these are: good for the lens, no part of the target's "
            "measurement."
        )
    say(f"Fitting to {count(len(loaded.pairs.pixel), 'corner')}.")
    fitted: Calibration | PointCalibration
    if lift == "point":
        asked: dict[str, Any] = {"lift": lift}
        with working("Fitting"):
            fitted = calibrate_points(loaded.pairs, hold_out=hold_out)
    else:
        asked = {"hold_out": hold_out, "refine_target": refine_target}
        with stages("Fitting") as progress:
            fitted = calibrate(
                loaded.given, refine_target=refine_target, hold_out=hold_out, progress=progress
            )
    drawn = None
    if target.counts is not None and loaded.pairs.target is not None:
        drawn = target_text(loaded.pairs.target)
    made_by = _made_by(asked, loaded, drawn, output, title)
    record, camera = fitted.as_record(), fitted.camera
    facts = camera_facts(camera, record, made_by)
    contents = contents_of(fitted, made_by, loaded.corners if with_corners else None, drawn)
    if isinstance(fitted, Calibration):
        judged, thing = facts.verdict or fitted.verdict, fitted.target
        if contents["map"] is None:
            say(
                "No undistort_map.npz was written: a map of {}x{} pixels takes gigabytes. "
                "'cubicfish map --size' makes a smaller one.".format(*camera.image_size)
            )
    else:
        judged, thing = verdict(record, camera.image_size, fitted.camera.valid), loaded.pairs.target
    if with_page:
        contents["report"] = make_page(camera, record, made_by, loaded, thing)
    with working("Writing"):
        outputs, removed = folder.write(contents, overwrite=overwrite)
    advice, models = {}, []
    if isinstance(fitted, Calibration):
        advice = {"advice": summary(fitted.camera, record, fitted.pairs)}
        models = _compared(fitted, loaded.pairs.target, hold_out=hold_out) if compare else []
    if as_json:
        print_json(
            {
                **record,
                **({"models": models} if compare else {}),
                **photo_remarks(loaded.detection, fitted.remarks),
                **advice,
                "summary": facts.line,
                "verdict": judged.as_record(),
                "report": outputs.get("report"),
                "files": outputs,
                "model": outputs["camera"],
            }
        )
    for photo, reason in fitted.unfit.items():
        say(f"left out: {photo}: {reason}")
    if isinstance(fitted, Calibration):
        say_findings(fitted, record)
    if not as_json:
        apart()
        result(facts.line, mark=(judged.words, judged.level))
        if isinstance(fitted, Calibration):
            print_verdict(judged)
            result(f"advice: {advice['advice']}\n")
            print_calibration(fitted, record, models, outputs, loaded)
            first = loaded.files[0].path if loaded.detection and loaded.files else None
            say_next(judged, outputs["camera"], first, outputs.get("report"))
        else:
            print_points(fitted, record, judged, outputs)
    for path in removed:
        say(f"removed {path}, which was of an earlier calibration")
    say_if_no_page(outputs, wanted=report)
    hold_gate(fitted.errors.rms_px, max_rms)


def _photos(
    inputs: tuple[Path, ...],
    output: Path,
    target: TargetChoice,
    best: int | None,
    jobs: int | None,
    *,
    no_cache: bool,
    overwrite: bool,
) -> tuple[Path, ...]:
    """The inputs, with the frames that are chosen of films in their place."""
    films = films_among(inputs)
    if not films:
        return inputs
    photos = tuple(path for path in inputs if path not in films)
    if photos:
        from cubicfish_cli.library.frames import refuse_other_photos

        refuse_other_photos(photos_of(photos), films)
    return photos + frames_to_calibrate(
        films,
        output / "frames",
        target,
        most=best or MOST,
        jobs=jobs,
        no_cache=no_cache,
        overwrite=overwrite,
    )


def _compared(
    calibration: Calibration, drawn: Target | None, *, hold_out: bool
) -> list[dict[str, Any]]:
    from cubicfish_cli.fitting.model_comparison import compare_models

    say("Fitting other lens models to the same corners.")
    with working("Fitting other lens models"):
        rows = compare_models(calibration, drawn=drawn, hold_out=hold_out)
    return [row.as_record() for row in rows]


def _made_by(
    asked: Mapping[str, Any], loaded: Pairs, drawn: str | None, folder: Path, title: str | None
) -> dict[str, Any]:
    """How it was made; the object too where it came as counts and its file is still to be."""
    record = made_by_record(asked, loaded.target_file, loaded.files)
    if drawn is not None:
        record["target"] = recorded_as(drawn, folder / DEFAULT_TARGET)
    return {**({} if title is None else {"title": title}), **record}
