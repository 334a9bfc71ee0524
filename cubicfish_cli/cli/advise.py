"""``cubicfish advise``: what to photograph next."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import FloatRange, IntRange, as_command, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say

if TYPE_CHECKING:
    from cubicfish_cli.advice.advise import Advice
    from cubicfish_cli.advice.proposals import Proposal
    from cubicfish_cli.assess.verdict import Verdict

_MOST_PARTS = 4


@record
class Asked:
    """What is asked of ``cubicfish advise``."""

    calibration: Path | None = options.calibration_argument
    model: Path | None = options.model_option
    target: Path | None = options.target_option
    corners: Path | None = option(
        "--corners FILE",
        "The corners.csv that the camera was calibrated from, where it is not beside it.",
        options.FILE,
    )
    picture: Path | None = options.output_option(
        "Also draw where the target should appear: a picture (.svg, .png, .pdf). Needs pip install "
        "'cubicfish[report]'.",
        metavar="FILE",
    )
    poses: Path | None = option(
        "--poses FILE",
        "Also write the proposed poses, for 'cubicfish simulate --poses'.",
        options.FILE,
    )
    goal_px: float | None = option(
        "--goal PX",
        "The uncertainty wanted over the field. [default: 0.2, more for photos of more than 2000 "
        "pixels per side]",
        FloatRange(min=0, min_open=True),
    )
    seed: int = option(
        "--seed N", "Other poses are tried; the same seed gives the same proposals.", IntRange(0), 0
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "advise",
    "What to photograph next, and how much it would help.",
    "cubicfish advise",
    "cubicfish advise calibration/ -o advice.svg",
    "cubicfish advise --model camera.yaml --corners corners.csv --target target.yaml",
    "cubicfish advise --goal 0.05 --poses next.csv",
)
def command(given: Asked) -> None:
    """Say what the photos of a calibration leave open, and what to photograph next.

    Reads FOLDER (by default: calibration): the camera, its poses, and the corners beside it. Says
    which parts of the picture are empty and how many more photos it takes, and proposes the three
    that would help most: where the target should be in the picture, and how far that lowers the
    camera's uncertainty, worked out from the fit's own equations. Says "enough" when it is.
    """
    from cubicfish_cli.library.report_files import advise_files

    camera = options.model_path(given.calibration or given.model)
    made = call(advise_files, given, camera=camera)
    if given.as_json:
        print_json(made.as_record())
        return
    _print(made.advice, made.verdict)
    print_wrote(made.written)


def _print(advice: Advice, judged: Verdict) -> None:
    from cubicfish_cli.fitting.findings import COVERED

    result(f"{count(advice.photos, 'photo')}, {count(len(advice.pixel), 'corner')}")
    if advice.now is not None:
        result(
            f"{'uncertainty':<12}{advice.now.median_px:.3f} px  {advice.now.meaning} "
            f"(goal: {advice.goal_px:g} px)"
        )
    result(f"{'coverage':<12}{100 * advice.gaps.cells.coverage:>5.0f} %   {COVERED}\n")
    if advice.enough:
        if judged.asks_for_photos:
            result(f"Heed the verdict first: {judged.line}.")
            result("By the uncertainty alone more photos are not needed.")
        else:
            result("Enough: more photos are not needed.")
        result("Smaller uncertainty can be asked for with --goal.\n")
    else:
        result("Not enough: " + "; ".join(reason.line for reason in advice.reasons) + ".")
        result(_how_many(advice))
        _print_gaps(advice)
        if advice.proposals:
            result("Take these next; what each brings counts those before it:")
        for number, proposal in enumerate(advice.proposals, start=1):
            _print_proposal(number, proposal)
        if advice.proposals:
            result()
    for note in advice.notes:
        say(f"note: {note}")


def _how_many(advice: Advice) -> str:
    from cubicfish_cli.advice.proposals import MOST_PHOTOS

    if advice.photos_needed is not None:
        more = count(advice.photos_needed, "more photo")
        return f"About {more} such as proposed here should do.\n"
    if advice.proposals:
        return (
            f"More than {MOST_PHOTOS} photos would be needed: sharper photos, or boards with more "
            "squares, bring more.\n"
        )
    return ""


def _print_gaps(advice: Advice) -> None:
    parts = advice.gaps.parts
    if parts:
        result("No corners here:")
        for part in parts[:_MOST_PARTS]:
            result(f"  {part.words}")
        if len(parts) > _MOST_PARTS:
            result(f"  and {count(len(parts) - _MOST_PARTS, 'smaller part')}")
        result()


def _print_proposal(number: int, proposal: Proposal) -> None:
    result(f"  {number}  Put {proposal.words}.")
    result(
        f"     Lowers the uncertainty over the field from {proposal.before.median_px:.3f} to "
        f"{proposal.after.median_px:.3f} px, by {100 * proposal.gain:.0f} % (medians)."
    )
