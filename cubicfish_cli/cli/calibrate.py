"""``cubicfish calibrate``: photos of a known object to a camera."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import calibrate_points, json_keys, options, report_step
from cubicfish_cli.cli.calibration_folder import of_earlier, refuse_inputs, say_removed
from cubicfish_cli.cli.choosing import MOST, films_among, frames_to_calibrate, refuse_other_photos
from cubicfish_cli.cli.figures import (
    count,
    hold_gate,
    print_errors,
    print_models,
    print_verdict,
    px,
)
from cubicfish_cli.cli.inputs import (
    Pairs,
    check_inputs,
    load_pairs,
    mark_of,
    photo_remarks,
    photos_of,
    say_photo_problems,
    why_lost,
)
from cubicfish_cli.cli.next_step import say_next
from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.photo_table import corners_by_board, fitted_rows, print_photo_table
from cubicfish_cli.cli.provenance import check_title, made_at, made_by_record
from cubicfish_cli.cli.target_choice import (
    DEFAULT_TARGET,
    TargetChoice,
    recorded_as,
    target_options,
)
from cubicfish_cli.cli.terminal import (
    apart,
    detail,
    print_json,
    print_table,
    print_wrote,
    result,
    say,
    stages,
    working,
)

if TYPE_CHECKING:
    from cubicfish_cli.assess.camera_facts import CameraFacts
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.fitting.calibrate import Calibration, RefineTarget
    from cubicfish_cli.target import Target

MAP = "undistort_map.npz"


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
@option(
    "--refine-target",
    "Fit the target too: boards' shapes and places, or each corner's own place as well; "
    "auto goes as far as it lowers the held-out error.",
    click.Choice(["off", "shape", "points", "auto"]),
    "auto",
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
@report_step.report_option
@options.max_rms_option
@options.overwrite_option
@options.json_option(json_keys.CALIBRATE)
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
    from cubicfish_cli.advice.summary import summary
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.library.calibration import calibrate
    from cubicfish_cli.photos import MAX_PIXELS

    made_at()  # said before the work if it cannot be
    if title is not None:
        check_title(title)
    outputs = _outputs(output, inputs)
    if target.counts is not None:
        outputs["drawn"] = output / DEFAULT_TARGET
    if not (report and report_step.is_possible()):
        outputs.pop("report")
    refuse_existing(*outputs.values(), overwrite=overwrite)
    given = (*inputs, target.path, correspondences)
    fitted = () if refine_target == "off" else (outputs["target"],)
    refuse_inputs(fitted, given)
    films = films_among(inputs)
    photos = inputs
    if films:
        photos = tuple(path for path in inputs if path not in films)
        if photos:
            refuse_other_photos(photos_of(photos), films)
        photos += frames_to_calibrate(
            films,
            output / "frames",
            target,
            most=best or MOST,
            jobs=jobs,
            no_cache=no_cache,
            overwrite=overwrite,
        )
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
    if loaded.corners is None:  # the input held pairs
        outputs.pop("corners", None)
    uncertain = loaded.pairs.uncertain_images
    if refine_target == "auto" and uncertain:
        say(
            f"{count(len(uncertain), 'photo')} show{'s' * (len(uncertain) == 1)} too little of the "
            "board to tell which corners these are: good for the lens, no part of the target's "
            "measurement."
        )
    say(f"Fitting to {count(len(loaded.pairs.pixel), 'corner')}.")
    if lift == "point":
        calibrate_points.run(
            loaded,
            outputs,
            _made_by({"lift": lift}, loaded, outputs, title),
            hold_out=hold_out,
            as_json=as_json,
            max_rms=max_rms,
            overwrite=overwrite,
            report=report,
            given=given,
        )
        return
    with stages("Fitting") as progress:
        calibration = calibrate(
            loaded.given,
            refine_target=refine_target,
            hold_out=hold_out,
            progress=progress,
        )
    if calibration.refined == "off":
        outputs.pop("target")
    if math.prod(calibration.camera.image_size) > MAX_PIXELS:
        outputs.pop("map")
        say(
            f"No {MAP} was written: a map of {{}}x{{}} pixels takes gigabytes. 'cubicfish map "
            "--size' makes a smaller one.".format(*calibration.camera.image_size)
        )
    asked = {"hold_out": hold_out, "refine_target": refine_target}
    made_by = _made_by(asked, loaded, outputs, title)
    record = calibration.as_record()
    camera = calibration.camera
    calibration = replace(calibration, made_by=made_by)
    facts, judged = calibration.facts, calibration.verdict
    page = report_step.make_page(outputs, camera, record, made_by, loaded, calibration.target)
    earlier = of_earlier(outputs, given) if overwrite else []
    with working("Writing"):
        _write(outputs, calibration, loaded, page, earlier, overwrite=overwrite)
    advice = summary(camera, record, calibration.pairs)
    models = _compared(calibration, loaded.target, hold_out=hold_out) if compare else []
    if as_json:
        compared = {"models": models} if compare else {}
        files = report_step.as_record(judged, outputs)
        said = {
            **photo_remarks(loaded.detection, calibration.remarks),
            "advice": advice,
            "summary": facts.line,
        }
        print_json({**record, **compared, **said, **files, "model": str(outputs["camera"])})
    for corner in record["dropped_corners"]:
        detail(
            "dropped: {image} {board} column {column} row {row}: {error_px:.1f} px off".format(
                **corner
            )
        )
    for photo, reason in calibration.unfit.items():
        say(f"left out: {photo}: {reason}")
    for finding in calibration.findings:
        say(f"{mark_of(finding)}: {finding.line}")
    for note in calibration.notes:
        say(f"note: {note}")
    for departure in calibration.departures:
        for doubt in departure.doubts:
            say(f"warning: board {departure.board} seems {doubt.what}: {doubt.do}")
    if not as_json:
        _print(calibration, facts, record, judged, advice, models, outputs, loaded)
    say_removed(earlier)
    report_step.say_if_missing(outputs, wanted=report)
    hold_gate(calibration.errors.rms_px, max_rms)


def _outputs(folder: Path, inputs: Sequence[Path]) -> dict[str, Path]:
    outputs = {
        "camera": folder / "camera.yaml",
        "map": folder / MAP,
        "target": folder / "target.refined.yaml",
        "report": folder / report_step.NAME,
    }
    corners = folder / "corners.csv"
    # Corners that were read from this very file need not be written again.
    is_input = corners.exists() and any(path.exists() and path.samefile(corners) for path in inputs)
    if inputs and not is_input:
        outputs["corners"] = corners
    return outputs


def _compared(
    calibration: Calibration, drawn: Target | None, *, hold_out: bool
) -> list[dict[str, Any]]:
    from cubicfish_cli.fitting.baselines.compare import compare_baselines

    say("Fitting other lens models to the same corners.")
    with working("Fitting other lens models"):
        rows = compare_baselines(calibration, drawn=drawn, hold_out=hold_out)
    return [row.as_record() for row in rows]


def _write(
    outputs: Mapping[str, Path],
    calibration: Calibration,
    loaded: Pairs,
    page: str | None,
    earlier: Sequence[Path],
    *,
    overwrite: bool,
) -> None:
    """Write every output, all or none; what is of an earlier calibration goes."""
    from cubicfish_cli.correspondences import save_corners
    from cubicfish_cli.files import whole_files, write_text
    from cubicfish_cli.formats.target_yaml import target_text
    from cubicfish_cli.undistortion.maps import build_map, save_map
    from cubicfish_cli.undistortion.views import default_view

    paths = list(outputs.values())
    with whole_files(paths, overwrite=overwrite, obsolete=earlier) as temporary:
        names = dict(zip(outputs, temporary, strict=True))
        calibration.save(names["camera"])
        if "drawn" in names and loaded.target is not None:
            write_text(names["drawn"], target_text(loaded.target), overwrite=False)
        view = default_view(calibration.camera)
        if "map" in names:
            save_map(names["map"], build_map(calibration.camera, view), overwrite=False)
        if "target" in names and calibration.target is not None:
            write_text(names["target"], target_text(calibration.target), overwrite=False)
        if "corners" in names and loaded.corners is not None:
            save_corners(names["corners"], loaded.corners, overwrite=False)
        if "report" in names and page is not None:
            write_text(names["report"], page, overwrite=False)


def _made_by(
    asked: Mapping[str, Any], loaded: Pairs, outputs: Mapping[str, Path], title: str | None
) -> dict[str, Any]:
    """How it was made; the object too where it came as counts and its file is still to be."""
    from cubicfish_cli.formats.target_yaml import target_text

    record = made_by_record(asked, loaded.target_file, loaded.files)
    if "drawn" in outputs and loaded.target is not None:
        record["target"] = recorded_as(target_text(loaded.target), outputs["drawn"])
    return {**({} if title is None else {"title": title}), **record}


def _print(
    calibration: Calibration,
    facts: CameraFacts,
    record: Mapping[str, Any],
    judged: Verdict,
    advice: str,
    models: Sequence[Mapping[str, Any]],
    outputs: Mapping[str, Path],
    loaded: Pairs,
) -> None:
    """The verdict first, then the figures it rests on, the photos, and what to do next."""
    camera, pairs = calibration.camera, calibration.pairs
    apart()
    result(facts.line, mark=(judged.words, judged.level))
    print_verdict(judged)
    result(f"advice: {advice}\n")
    _print_figures(calibration, record)
    result()
    rows = fitted_rows(
        record, camera.image_size, corners_by_board(pairs), _lost(calibration, loaded)
    )
    print_photo_table(rows, pairs.boards, record, everything=str(outputs["camera"]))
    result()
    _print_object(calibration)
    if models:
        print_models(models)
        result()
    print_wrote(outputs.values())
    photo = loaded.files[0].path if loaded.detection is not None and loaded.files else None
    say_next(judged, outputs["camera"], photo, outputs.get("report"))


def _print_figures(calibration: Calibration, record: Mapping[str, Any]) -> None:
    from cubicfish_cli.assess.field_uncertainty import recorded
    from cubicfish_cli.fitting.findings import COVERED
    from cubicfish_cli.frame_names import counted

    dropped = len(calibration.dropped)
    result(
        f"{counted(row['image'] for row in record['per_image'])}, "
        f"{count(record['corners'], 'corner')} used, "
        f"{count(dropped, 'outlier')}{' (-v lists them)' * bool(dropped)}\n"
    )
    held_out = calibration.held_out
    more: list[tuple[str, float | None, str]] = [
        ("  radial reference", calibration.companion_rms_px, "a Kannala–Brandt lens, same corners"),
    ]
    if held_out is None:
        more += [("held-out RMS", None, "not measured")]
    else:
        more += [
            ("held-out RMS", held_out.rms_px, "photos judged by cameras that never saw them"),
            ("  radial reference", held_out.companion_rms_px, ""),
        ]
    print_errors(record, more)
    result(
        f"{'field':<24}{calibration.camera.max_angle_deg:>7.1f} °   from the axis, where the "
        f"camera may be trusted; corners reach {calibration.covered_deg:.1f}°"
    )
    result(f"{'coverage':<24}{100 * calibration.coverage:>7.0f} %   {COVERED}")
    uncertainty = recorded(record)
    if uncertainty is not None:
        result(f"{'uncertainty':<24}{px(uncertainty.median_px):>7} px  {uncertainty.meaning}")


def _lost(calibration: Calibration, loaded: Pairs) -> dict[str, str]:
    """Photos that took no part, and a word for why; lines on stderr say more."""
    lost = dict.fromkeys(calibration.unfit, "left out")
    if loaded.detection is not None:
        lost |= why_lost(loaded.detection)
    return lost


def _print_object(calibration: Calibration) -> None:
    """Say in one line a board what was found of the object, where any of it was fitted."""
    if not calibration.departures or calibration.target is None:
        return
    units = calibration.target.units
    what = {"shape": "boards' shapes and places", "points": "shapes, places and single corners"}
    tried = ", ".join(f"{level} {px(rms)}" for level, rms in calibration.held_out_by_level.items())
    result(
        f"target fitted too: {what[calibration.refined]}" + f" (held-out: {tried})" * bool(tried)
    )
    print_table(
        ("board", f"bend x {units}", f"bend y {units}", f"twist {units}", "stretch x %",
         "stretch y %", f"moved {units}", "turned °", f"corners {units}"),
        [
            (
                part.board,
                *(f"{bend:.2g}" for bend in part.bend),
                f"{part.twist:.2g}",
                *(f"{100 * share:.2f}" for share in part.stretch),
                f"{part.shift:.2g}",
                f"{part.turn_deg:.2f}",
                f"{part.offset_rms:.2g}",
            )
            for part in calibration.departures
        ],
    )  # fmt: skip
    result()
