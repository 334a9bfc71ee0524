"""What speaks against a camera, its boards or the photos of its fit, and what photos leave open."""

from collections.abc import Sequence

from cubicfish import listed
from cubicfish.judge import Code
from cubicfish.judge import FindingText as Said
from cubicfish_cli.words.phrases import pick, plural, whole
from cubicfish_cli.words.set_up import CORRECT
from cubicfish_cli.words.table import Words

Names = Sequence[str]

_GOOD = "good photos of a well-measured target give 0.1 to 0.2 px"
_NOT_WHERE = ", so advice says where corners are missing, but not where to put the target"
_UNEXPLAINED = "more than is normal for a printed board"
WORDS = Words(
    findings={
        (Code.NO_FIGURES, ""): Said(
            "the file does not say how well the camera fits", do="calibrate again"
        ),
        (Code.NO_FIGURES, "elsewhere"): Said(
            "accuracy is not known: the camera's file does not say how it was calibrated",
            do="measure it on photos of a target: cubicfish evaluate PHOTOS --target target.yaml "
            "--model CAMERA",
        ),
        (Code.LARGE_ERRORS, "photo"): Said("large errors"),
        (Code.FEW_CORNERS, "photo"): Said("few corners"),
        (Code.NOT_HELD_OUT, ""): Said(
            "no error was measured on photos not used in the fit",
            do="calibrate with --hold-out; if it was on, take more photos, from other places",
        ),
        (Code.TOO_FEW_CORNERS, ""): Said("too few corners to find its pose"),
        (Code.NO_ERROR, ""): Said(
            "cannot tell which corners of the board these are",
            do="show more of the board",
        ),
        (Code.NO_ERROR, "short"): Said("no error known"),
        (Code.NO_POSES, ""): Said(
            "the camera file has no poses of these photos, so the gain from more photos is unknown"
        ),
        (Code.NO_TARGET, ""): Said(f"the pairs came without a target{_NOT_WHERE}"),
        (Code.NO_SIDE, ""): Said(
            f"a list of points does not tell from which side it can be seen{_NOT_WHERE}"
        ),
        (Code.NO_VIEW, ""): Said(
            "no pose was found from which this camera would see a whole board with squares large "
            "enough to be found"
        ),
    }
)


@WORDS.finding(Code.LARGE_ERRORS)
def _large_errors(error_px: float) -> Said:
    return Said(
        f"corners are off by {error_px:.2f} px; {_GOOD}",
        do="compare target.yaml with the real target (inner corners, square, places: 'cubicfish "
        "target check --draw'), and look at the photos with the largest errors",
    )


@WORDS.finding(Code.LARGE_ERRORS, "evaluation")
def _large_errors_elsewhere(error_px: float) -> Said:
    what = f"the camera is off by {error_px:.2f} px; {_GOOD}"
    return Said(what, do="check that camera, target and photos belong together")


@WORDS.finding(Code.FEW_CORNERS)
def _few_corners(corners: float) -> Said:
    what = (
        f"{plural(corners, 'corner')} {pick(corners, 'is', 'are')} too few; aim for several hundred"
    )
    return Said(what, do="take more photos, or use boards with more squares")


@WORDS.finding(Code.NOT_HELD_OUT, "few")
def _not_held_out_of_few(photos: int) -> Said:
    few = f"{plural(photos, 'photo')} {pick(photos, 'is', 'are')} too few"
    what = f"{few} to hold any out of the fit and measure the error on them"
    return Said(what, do="take three or more photos")


@WORDS.finding(Code.OVERFITTED)
def _overfitted(held_out_px: float, times: float) -> Said:
    return Said(
        f"the camera is off by {held_out_px:.3f} px on photos not used in the fit, {times:.1f} "
        "times as much as on the others",
        do="take more photos, and show each part of the picture in several of them",
    )


@WORDS.finding(Code.RADIAL_IS_NEARER)
def _radial_is_nearer(radial_px: float, held_out_px: float) -> Said:
    return Said(
        "a plain radial lens does better on photos not used in the fit "
        f"({radial_px:.3f} px against {held_out_px:.3f} px): too few corners for so rich a model",
        do="take more photos, with corners out to the rim",
    )


@WORDS.finding(Code.FEW_PHOTOS_OF_A_PLANE)
def _few_photos_of_a_plane(photos: int, bad: bool) -> Said:
    few = f"{plural(photos, 'photo')} of one flat board {pick(photos, 'is', 'are')} too few"
    what = few + " to separate the lens from the board's poses" * bad
    return Said(what, do="take ten: tilted, near and far, out to the rim")


@WORDS.finding(Code.WORSE_AT_THE_RIM)
def _worse_at_the_rim(middle_px: float, rim_px: float, from_deg: float) -> Said:
    return Said(
        f"the camera is off by {middle_px:.2g} px in the middle and by {rim_px:.2g} px beyond "
        f"{from_deg:.0f}° from the axis",
        do="take more photos with corners out there, or trust it less there",
    )


@WORDS.finding(Code.EXTRAPOLATED)
def _extrapolated(covered_deg: float, around_deg: float, edge_px: float) -> Said:
    return Said(
        f"the field is covered all round only to {around_deg:.0f}° (to {covered_deg:.0f}° on the "
        "best side); beyond that the camera is extrapolated, with an uncertainty of "
        f"{edge_px:.2g} px at the edge",
        do="take photos with the target at the rim on the other sides",
    )


@WORDS.finding(Code.LOW_COVERAGE)
def _low_coverage(share: float) -> Said:
    what = f"corners cover {whole(share)} of the field; the rest is unchecked"
    return Said(what, do="take photos with the target in the empty parts")


@WORDS.finding(Code.SMALL_FIELD)
def _small_field(share: float) -> Said:
    return Said(
        f"only {whole(share)} of the photo is calibrated, as far as corners reach",
        do="if the lens shows more than that, take photos with the target near the rim",
    )


@WORDS.finding(Code.LOW_RANK, "", "point")
def _low_rank(case: str, rank: float, full: int) -> Said:
    where, do = "where the corners lie", "take photos with the target in other parts of the picture"
    if case == "point":
        where, do = "on the boards", "add boards in other planes, or calibrate with --lift ray"
    what = f"the corners determine {rank:.0f} of {full} cubics: the camera is valid only"
    return Said(f"{what} {where}", do=do)


@WORDS.finding(Code.UNCERTAIN)
def _uncertain(median_px: float) -> Said:
    return Said(
        f"uncertainty is {median_px:.2f} px (1σ, median over the field)",
        do="take more photos with tilted boards, take sharper ones, or use boards with more "
        "squares",
    )


@WORDS.finding(Code.UNCERTAIN, "evaluation")
def _uncertain_elsewhere(median_px: float) -> Said:
    return Said(
        f"the camera's own uncertainty at these corners is {median_px:.2f} px (1σ, median); the "
        "poses fitted here hide it",
        do="calibrate from more photos with tilted boards or from sharper ones, or use boards "
        "with more squares",
    )


@WORDS.finding(Code.UNCERTAIN, "rim")
def _uncertain_rim(p95_px: float, goal_px: float) -> Said:
    what = f"uncertainty is {p95_px:.2f} px over 95 % of the field, where {goal_px:.2g} px is good"
    return Said(what, do="take more photos with tilted boards and corners out to the rim")


@WORDS.finding(Code.UNCERTAIN, "goal")
def _above_goal(median_px: float, p95_px: float, goal_px: float) -> Said:
    return Said(
        f"uncertainty is {median_px:.2g} px (1σ, median over the field) and {p95_px:.2g} px over "
        f"95 % of it; the goal is {goal_px:g} px",
        do="take more photos with tilted boards and with corners out to the rim",
    )


@WORDS.finding(Code.MANY_OUTLIERS)
def _many_outliers(dropped: float, corners: float) -> Said:
    return Said(
        f"{dropped:.0f} of {corners:.0f} corners are outliers and are left out",
        do="see which boards or photos they belong to: a board moved, inner corners were counted "
        "wrongly, or names in corners.csv are wrong",
    )


@WORDS.finding(Code.MANY_UNFIT)
def _many_unfit(left_out: int, photos: float) -> Said:
    do = "take them again: sharp, unedited, with the target still"
    return Said(f"{left_out} of {photos:.0f} photos do not fit and are left out", do=do)


@WORDS.finding(Code.A_FEW_FAR_OFF)
def _a_few_far_off(p95_px: float, rms_px: float, before_px: float) -> Said:
    return Said(
        f"most corners are within {p95_px:.3f} px, and a few are far off (RMS {rms_px:.3f} px, "
        f"against {before_px:.3f} px when it was calibrated)",
        do="look at the photos with the largest errors",
    )


@WORDS.finding(Code.A_FEW_FAR_OFF, "photos")
def _a_few_photos_far_off(images: Names, rms_px: float, rest_px: float, others: int) -> Said:
    it, are = pick(images, "it", "they"), pick(images, "is", "are")
    return Said(
        f"{listed(images, 'photos')} {are} off by {rms_px:.3f} px, and the other {others} photos "
        f"by {rest_px:.3f} px",
        do=f"see whether {it} {are} mirrored, turned, cropped or of another camera; --exclude "
        f"leaves {pick(images, 'it', 'them')} out",
    )


@WORDS.finding(Code.WORSE_THAN_BEFORE)
def _worse_than_before(rms_px: float, times: float, before_px: float) -> Said:
    return Said(
        f"the camera is off by {rms_px:.3f} px, {times:.1f} times as much as when it was "
        f"calibrated ({before_px:.3f} px)",
        do="if lens, focus, zoom and target are still the same, calibrate again and see what has "
        "moved ('cubicfish compare')",
    )


@WORDS.finding(Code.BENT)
def _bent(board: str, size: float, units: str) -> Said:
    what = f"board {board} seems bent by {size:.3g} {units}, {_UNEXPLAINED}"
    return Said(what, do=f"check that it is flat, measure its place again, {CORRECT}")


@WORDS.finding(Code.BENT, "wavy")
def _wavy(board: str, size: float, units: str, aside: float) -> Said:
    return Said(
        f"board {board} is wavy: its corners are {size:.2g} {units} (RMS) out of the plane",
        f"and {aside:.2g} {units} off within it, normal for a printed board",
        "the fit accounts for this as long as the board keeps its shape; glue it to a flat plate",
    )


@WORDS.finding(Code.STRETCHED)
def _stretched(board: str, percent: float) -> Said:
    what = f"board {board} seems stretched by {percent:.1f} %, {_UNEXPLAINED}"
    return Said(what, do=f"measure ten of its squares, {CORRECT}")


@WORDS.finding(Code.MOVED)
def _moved(board: str, size: float, units: str, turn_deg: float) -> Said:
    what = f"board {board} seems {size:.3g} {units} and {turn_deg:.1f}° off its place"
    return Said(what, do=f"measure its origin and axes again, {CORRECT}")


@WORDS.finding(Code.CORNERS_OFF)
def _corners_off(board: str, size: float, units: str) -> Said:
    return Said(
        f"the corners of board {board} seem to be off by {size:.3g} {units} within its plane, "
        f"{_UNEXPLAINED}",
        do="check with 'cubicfish detect --draw' that they are found and named right, or measure "
        f"the target again, {CORRECT}",
    )


@WORDS.finding(Code.DOES_NOT_FIT)
def _does_not_fit(images: Names, error_px: float) -> Said:
    return Said(
        f"{pick(images, 'its', 'their')} corners are off by {pick(images, '', 'up to ')}"
        f"{error_px:.1f} px in the median, while the other photos agree: the target moved, the "
        "zoom changed, or corners are misnamed"
    )


@WORDS.finding(Code.NOISY)
def _noisy(images: Names, times: float) -> Said:
    return Said(
        f"{pick(images, 'its', 'their')} corners are {pick(images, '', 'up to ')}{times:.0f} times "
        "noisier than those of the other photos: blurred, moving or badly lit",
        do=f"take {pick(images, 'it', 'them')} again",
    )


@WORDS.finding(Code.STANDS_OUT)
def _stands_out(times: float) -> Said:
    return Said(f"{times:.0f} times the others' error", do="look at it, or --exclude it")


@WORDS.finding(Code.STANDS_OUT, "short")
def _stands_out_shortly(times: float) -> Said:
    return Said(f"{times:.0f}× the others")


@WORDS.finding(Code.OUTLIERS)
def _outliers(dropped: int) -> Said:
    return Said(f"{dropped} dropped")


@WORDS.finding(Code.NOT_CERTAIN)
def _not_certain(p95_px: float, goal_px: float) -> Said:
    return Said(
        f"uncertainty is {p95_px:.3f} px over 95 % of the field; the goal is {goal_px:g} px"
    )


@WORDS.finding(Code.NOT_TRUSTED)
def _not_trusted(reason: Said) -> Said:
    return Said(f"the camera is not to be trusted: {reason.why}; fix this first: {reason.do}")


@WORDS.finding(Code.MIDDLE_UNSEEN)
def _middle_unseen(blind_deg: float) -> Said:
    return Said(
        f"no corner lies within {blind_deg:.0f}° of the axis, as when a camera looks into a mirror "
        "and sees itself, so no photo is proposed there; if the camera does see the target there, "
        "put it there first"
    )
