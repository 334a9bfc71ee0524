"""What speaks against a camera that was fitted to points that somebody marked: no boards."""

from cubicfish.judge import Code
from cubicfish.judge import FindingText as Said
from cubicfish_cli.words.phrases import whole
from cubicfish_cli.words.table import Words

_MARK = "mark more points, out to the rim on all sides"
WORDS = Words(
    findings={
        (Code.NOT_HELD_OUT, "points"): Said(
            "no error was measured on photos not used in the fit",
            do="mark points in three or more photos",
        )
    }
)


@WORDS.finding(Code.LARGE_ERRORS, "points")
def _large_errors(error_px: float) -> Said:
    return Said(
        f"points are off by {error_px:.2f} px",
        do="if they were marked no better than that, say so, as in --noise 1.5; otherwise look for "
        "points with wrong coordinates X, Y, Z",
    )


@WORDS.finding(Code.FEW_CORNERS, "points")
def _few_points(corners: int) -> Said:
    return Said(
        f"{corners} points are enough for a radial lens, but not for its asymmetry",
        do="mark more than 30 points",
    )


@WORDS.finding(Code.OVERFITTED, "points")
def _overfitted(held_out_px: float, times: float) -> Said:
    return Said(
        f"the camera is off by {held_out_px:.2f} px on photos not used in the fit, {times:.1f} "
        "times as much as on the others",
        do="mark more points in each photo",
    )


@WORDS.finding(Code.UNCERTAIN, "points")
def _uncertain(median_px: float = 0.0, p95_px: float = 0.0, goal_px: float = 0.0) -> Said:
    parts = [f"{median_px:.2f} px (1σ, median over the field)"] * bool(median_px)
    parts += [f"{p95_px:.2f} px over 95 % of the field"] * bool(p95_px)
    goal = f"; the goal is {goal_px:.2g} px" * bool(goal_px)
    return Said(f"uncertainty is {' and '.join(parts)}{goal}", do=_MARK)


@WORDS.finding(Code.LOW_COVERAGE, "points")
def _low_coverage(share: float) -> Said:
    what = f"points cover {whole(share)} of the field; the rest is unchecked"
    return Said(what, do="mark points in the empty parts")


@WORDS.finding(Code.SMALL_FIELD, "points")
def _small_field(share: float) -> Said:
    return Said(
        f"only {whole(share)} of the photo is calibrated: beyond, the points say too little",
        do="mark points nearer to the rim, if the lens shows more than that",
    )


@WORDS.finding(Code.EXTRAPOLATED, "points")
def _extrapolated(covered_deg: float, around_deg: float, edge_px: float) -> Said:
    return Said(
        f"points lie all round only to {around_deg:.0f}° from the axis (to {covered_deg:.0f}° on "
        "the best side); beyond that the camera is extrapolated, with an uncertainty of "
        f"{edge_px:.2g} px at the edge",
        do="mark points at the rim on the other sides",
    )


@WORDS.finding(Code.MANY_OUTLIERS, "points")
def _many_outliers(dropped: int, corners: int) -> Said:
    return Said(
        f"{dropped} of {corners} points are outliers and were left out",
        do="look for points with wrong coordinates X, Y, Z",
    )
