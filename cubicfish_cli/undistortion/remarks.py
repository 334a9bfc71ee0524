"""Remarks on a view for people: where the camera's field ends, and what of the photos is lost."""

from cubicfish.views import CentralView, ChosenView

_LEAST_UNSEEN_DEG = 0.05  # printed numbers are rounded to this
_MUCH = 0.1  # of what a photo shows


def view_remarks(chosen: ChosenView) -> list[str]:
    """Say where the camera's field ends before the view's does, and what of the photos is lost."""
    notes = []
    if chosen.at_limit:
        notes.append(
            f"the camera sees more than a {chosen.first.kind} picture can show: its field ends at "
            "the view's own limit, and --view stereographic or equidistant shows all"
        )
    return [*notes, *_empty_parts(chosen), *([] if chosen.given_field else _lost_parts(chosen))]


def _empty_parts(chosen: ChosenView) -> list[str]:
    """Say how much of the view's field the camera sees, where that is not all."""
    view, seen_deg = chosen.first, chosen.seen_field_deg
    if seen_deg is None or not isinstance(view, CentralView):
        return []
    ways = [*zip(seen_deg, (view.hfov_deg, view.vfov_deg), ("across", "down"), strict=True)]
    if all(field - seen < _LEAST_UNSEEN_DEG for seen, field, _ in ways):
        return []
    words = [
        f"all {field:.1f}° {way}"
        if field - seen < _LEAST_UNSEEN_DEG
        else f"{seen:.1f}° of {field:.1f}° {way}"
        for seen, field, way in ways
    ]
    return [f"the camera sees {', '.join(words)}: the rest is empty"]


def _lost_parts(chosen: ChosenView) -> list[str]:
    """Say how much of the photo is not calibrated, and how much lies beyond the view's edges."""
    lost = chosen.lost_shares
    if lost is None:
        return []
    notes = []
    uncalibrated, cut_off = lost
    if chosen.extrapolates and uncalibrated:
        notes.append(
            f"{100 * uncalibrated:.0f} % of the photo is extrapolated, where the camera is "
            "not calibrated: --mask FILE marks what may be trusted"
        )
    elif uncalibrated > _MUCH:
        notes.append(
            f"{100 * uncalibrated:.0f} % of the photo is left out, where the camera is not "
            "calibrated: calibrate again with photos in which the target reaches the photo's "
            "edges, or have it extrapolated by --fit whole"
        )
    if cut_off > _MUCH and not chosen.at_limit:
        notes.append(
            f"{100 * cut_off:.0f} % of the photo lies beyond the picture's edges: "
            "--fit outer or --view equidistant shows more of it"
        )
    return notes
