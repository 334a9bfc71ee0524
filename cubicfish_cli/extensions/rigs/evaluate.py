"""``cubicfish rig evaluate``: how well a rig explains other shots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import Event, Run, UsageError
from cubicfish.files import StrPath
from cubicfish_cli.commands.evaluate import report_unplaced
from cubicfish_cli.extensions.rigs.options import times_option
from cubicfish_cli.extensions.rigs.printed import print_evaluation
from cubicfish_cli.inputs.paths import paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import enforce_max_rms
from cubicfish_cli.terminal.parameters import as_command, record, target_options
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_json, print_message
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish.rigs import RigEvaluation


@record
class RigEvaluateOptions:
    """What a rig is measured on.

    Attributes:
        rig: its rig.yaml, or the folder of that.
        cameras: photos or a corners.csv of each camera, in the rig's order or called as they are.
        target: the calibration target, or its file.
        times: a table that says when each photo was taken.

    """

    rig: StrPath = parameters.argument(
        "The folder that 'cubicfish rig calibrate' wrote, or its rig.yaml.",
        metavar="RIG",
    )
    cameras: Sequence[StrPath] = parameters.argument(
        "Photos (a folder or a glob) or a corners.csv of each camera: called as the cameras are, "
        "or in the rig's order.",
        nargs=-1,
        metavar="CAMERA CAMERA...",
    )
    target: TargetSource | Target | StrPath | None = target_options
    times: StrPath | None = times_option


def evaluate_rig_files(options: RigEvaluateOptions, *, run: Run = Run()) -> RigEvaluation:
    """Measure a rig on files of its cameras, as ``cubicfish rig evaluate`` does.

    Raises:
        UsageError: it is not known which camera an input is of.
        CubicfishError: an input cannot be used, or no shot can be placed.

    Keys:
        those of :class:`~cubicfish.judge.fit_record.ErrorStatistics`
        model: the rig's file
        alone_rms_px: of the same corners with each photo's own pose, pixels
        cameras: a record per camera: name, images, its errors, alone_rms_px, outside_field,
            unplaced
        pairs: a record for every two cameras: cameras, shots (in common), rms_px
        per_shot: a record per shot: shot, rms_px, corners, cameras, rig_from_world

    """
    from cubicfish import evaluate_rig, load_rig
    from cubicfish_cli.core_table import CALIBRATION_FILES
    from cubicfish_cli.extensions.rigs.inputs import check_camera_inputs, load_camera_inputs
    from cubicfish_cli.extensions.rigs.naming import owners_of
    from cubicfish_cli.extensions.rigs.tables import load_times

    known, inputs = load_rig(options.rig), paths_of(options.cameras)
    names = [one.name for one in known.cameras]
    own = owners_of(inputs, names)
    if len(set(own)) < max(2, len(own)):
        raise UsageError(
            f"name photos or a corners.csv of two or more of the cameras {', '.join(names)}"
        )
    source = TargetSource.of(options.target)
    check_camera_inputs(inputs, source, run)
    times = None if options.times is None else load_times(Path(options.times), own)
    loaded = {
        name: load_camera_inputs([one], source, run)[0]
        for name, one in zip(own, inputs, strict=True)
    }
    first, nominal = loaded[own[0]], known.origin.target
    refined, given = known.files[0].with_name(CALIBRATION_FILES["target"]), first.target_file
    if nominal and given and given.sha256 == nominal.sha256 and refined.is_file():
        run.listener.tell(Event.MEASURED_AS_DRAWN, refined=refined)
    run.listener.progress("Placing shots")
    pairs = {name: one.given for name, one in loaded.items()}
    return evaluate_rig(known, pairs, first.pairs.target, times=times)


@as_command(
    "evaluate",
    "Measure a rig on other shots.",
    "cubicfish rig evaluate rig left/ right/ --target target.yaml",
    "cubicfish rig evaluate rig/rig.yaml left.csv right.csv --target target.yaml --max-rms 0.5",
    do=evaluate_rig_files,
    how=("max_rms", "as_json", "jobs", "no_cache"),
)
def command(evaluation: RigEvaluation, given: RigEvaluateOptions, how: How) -> None:
    """Measure the reprojection error of RIG on photos or corners of each of its cameras.

    The rig stays as it is; only where it was in each shot is fitted. No corner is dropped.
    """
    for one in evaluation.cameras:
        if one.outside_field:
            corners = plural(one.outside_field, "corner")
            print_message(f"camera {one.name}: {corners} not counted: beyond its field.")
        report_unplaced(one.unplaced, f"camera {one.name}: ")
    if how.as_json:
        print_json({"model": str(given.rig), **evaluation.as_record()})
    else:
        print_evaluation(evaluation)
    enforce_max_rms(evaluation.rms_px, how.max_rms)
