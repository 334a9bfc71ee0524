"""``cubicfish advise``: what to photograph next."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError, OutputError, Run, UsageError
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import calibration_files, in_folder, path_or_none
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, print_wrote, result
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish_cli.extensions.advice.advise import Advice

_MOST_PARTS = 4
_PICTURES = (".svg", ".png", ".pdf")


@record
class AdviseOptions:
    """Options of :func:`advise_files`.

    Attributes:
        camera: the file or folder of the camera.
        target: the nominal calibration target, if it is not at its recorded place.
        corners: the corners.csv of the fit, if it is not beside the camera.
        picture: also draw where the target should appear into this .svg, .png or .pdf.
        goal_px: the uncertainty wanted over 95 % of the field; without it the verdict decides.

    """

    camera: StrPath = parameters.camera_options
    target: StrPath | None = parameters.target_option
    corners: StrPath | None = option(
        "--corners FILE",
        "The corners.csv that the camera was calibrated from, where it is not beside it.",
        parameters.FILE,
    )
    picture: StrPath | None = parameters.output_option(
        "Also draw where the target should appear: a picture (.svg, .png, .pdf). Needs pip install "
        "'cubicfish[report]'.",
        metavar="FILE",
    )
    goal_px: float | None = option(
        "--goal PX",
        "The uncertainty wanted over 95 % of the field. Without it, photos are enough where the "
        "verdict asks for none.",
        FloatRange(min=0, min_open=True),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class AdviceFiles:
    """Result of :func:`advise_files`.

    Attributes:
        model: the camera's file.
        advice: what photos leave open, and which to take next.
        picture: the file of the drawing; None without one.

    """

    model: Path
    advice: Advice
    picture: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish advise --json`` prints.

        Keys:
            enough: whether more photos are not needed
            reasons: why not, a line each
            findings: the same, a record each, with the keys of findings of calibrate
            photos: how many there are
            photos_needed: about how many more it takes; null where too many, or it cannot be
                said
            goal_px: the uncertainty over 95 % of the field that the proposed photos aim at
            noise_px: of the corners
            now: the uncertainty: median_px over the field, p95_px (95 % of it is within this)
            coverage: share of the field that corners cover: of where the camera may be trusted
                and does not see itself, as in a mirror
            empty: parts of the picture without corners
            proposals: photos to take next, a record each
            notes: remarks, a line each
            remarks: the same, a record each
            model: the camera's file
            picture: the file of --output; null where it was not asked for

        """
        return {**self.advice.as_record(), "model": self.model, "picture": self.picture}


def advise_files(options: AdviseOptions, *, run: Run = Run()) -> AdviceFiles:
    """Find what the photos of a calibration leave open, as ``cubicfish advise`` does.

    Raises:
        UsageError: corners are named without their target, or ``overwrite`` is set though no file
            is written.
        CubicfishError: a file cannot be used, or exists and may not be replaced.

    """
    from cubicfish import CameraFile
    from cubicfish_cli.extensions.advice.advise import advise
    from cubicfish_cli.inputs.calibration_facts import facts_of_files

    drawing, given, drawn = map(path_or_none, (options.picture, options.corners, options.target))
    path = in_folder(Path(options.camera))
    plan = Plan(run).reads(calibration_files(path), drawn, given)
    if drawing is not None and drawing.suffix.lower() not in _PICTURES:
        raise OutputError(f"{drawing}: end the name in {', '.join(_PICTURES)}")
    if run.overwrite and drawing is None:
        raise UsageError("--overwrite goes with -o, which writes a file: leave it out")
    if drawing is not None:
        extra.require(extra.PRINTING, "a picture")
        plan.writes(drawing)
    facts = facts_of_files(path, target=drawn, photos=(), corners=given)
    plan.reads(facts.sources)
    if given is not None and facts.target is None:
        raise UsageError("name the target of these corners with --target target.yaml")
    if not isinstance(facts.known, CameraFile):
        raise CubicfishError(
            f"{path} is of lift 'point', which has no rays: its uncertainty over the field, "
            "and what would lower it, cannot be worked out; calibrate with --lift ray for this"
        )
    if facts.errors is None:
        beside = (path.parent / "corners.csv").is_file() and facts.target is None
        do = "name the target with --target" if beside else "name the corners with --corners"
        raise CubicfishError(f"{path}: {facts.lack}: {do}")
    run.listener.progress("Looking for photos that would help")
    advice = advise(facts.known, facts.errors.pairs, facts.target, goal_px=options.goal_px)
    if drawing is not None:
        with extra.quiet():
            from cubicfish_cli.extensions.advice.picture import advice_picture
        picture = advice_picture(advice, drawing.suffix.lower())
        plan.write({drawing: picture})
    return AdviceFiles(model=path, advice=advice, picture=drawing)


@as_command(
    "advise",
    "Suggest the next photos, and how much they would help.",
    "cubicfish advise",
    "cubicfish advise calibration/ -o advice.svg",
    "cubicfish advise --model camera.yaml --corners corners.csv --target target.yaml",
    "cubicfish advise --goal 0.05",
    do=advise_files,
    how=("overwrite", "as_json"),
)
def command(made: AdviceFiles, given: AdviseOptions, how: How) -> None:
    """Say what the photos of a calibration leave open, and what to photograph next.

    Reads FOLDER (by default: calibration): the camera, its poses, and the corners beside it. Says
    which parts of the picture are empty and how many more photos it takes, and proposes the three
    that would help most: where the target should be in the picture, and how far that lowers the
    camera's uncertainty, worked out from the fit's own equations. Says "enough" where the verdict
    asks for no photos.
    """
    if how.print(made):
        return
    _print(made.advice)
    if made.picture is not None:
        print_wrote([made.picture])


def _print(advice: Advice) -> None:
    from cubicfish_cli.words.camera import COVERED, uncertainty_meaning
    from cubicfish_cli.words.sentences import render

    pairs = advice.pairs
    result(f"{plural(len(pairs.images), 'photo')}, {plural(len(pairs.pixel), 'corner')}")
    if advice.now is not None:
        goal = "" if advice.enough else f" (goal: {advice.goal_px:g} px)"
        meaning = uncertainty_meaning(advice.now)
        result(f"{'uncertainty':<12}{advice.now.median_px:.3f} px  {meaning}{goal}")
    result(f"{'coverage':<12}{100 * advice.gaps.cells.coverage:>5.0f} %   {COVERED}\n")
    if advice.enough:
        result("Enough: more photos are not needed.")
        result("Smaller uncertainty can be asked for with --goal.\n")
    else:
        result("Not enough: " + "; ".join(render(reason).why for reason in advice.reasons) + ".")
        result(_describe_how_many(advice))
        _print_gaps(advice)
        if advice.proposals:
            result("Take these next; what each brings counts those before it:")
        for number, proposal in enumerate(advice.proposals, start=1):
            result(f"  {number}  Put {proposal.words}.")
            result(
                f"     Lowers the uncertainty over the field from {proposal.before.median_px:.3f} "
                f"to {proposal.after.median_px:.3f} px, by {100 * proposal.gain:.0f} % (medians)."
            )
        if advice.proposals:
            result()
    for note in advice.notes:
        print_message(f"note: {render(note).line}")


def _describe_how_many(advice: Advice) -> str:
    from cubicfish_cli.extensions.advice.proposals import MOST_PHOTOS

    if advice.photos_needed is not None:
        more = plural(advice.photos_needed, "more photo")
        return f"About {more} such as proposed here should do.\n"
    if advice.proposals:
        return (
            f"More than {MOST_PHOTOS} photos would be needed: sharper photos, or boards with more "
            "squares, bring more.\n"
        )
    return ""


def _print_gaps(advice: Advice) -> None:
    from cubicfish_cli.words.sufficiency import gap_words

    parts = gap_words(advice.gaps)
    if parts:
        result("No corners here:")
        for part in parts[:_MOST_PARTS]:
            result(f"  {part}")
        if len(parts) > _MOST_PARTS:
            result(f"  and {plural(len(parts) - _MOST_PARTS, 'smaller part')}")
        result()
