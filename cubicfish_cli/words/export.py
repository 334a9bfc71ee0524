"""What a camera loses in another tool's lens, in words."""

import math
from collections.abc import Mapping, Sequence

from cubicfish import listed
from cubicfish.fit import Conversion
from cubicfish_cli.words.phrases import length_words, two_digits

_BEHIND_DEG = 90.0


def cost(conversion: Conversion, held_out_px: float, units: str | None, travels: bool) -> str:
    """Return what an export says first: ``loses 0.226 px, 5.8 times this camera's ...``.

    Args:
        conversion: the lens, and how near it is.
        held_out_px: the camera's held-out error; NaN where it is not known.
        units: of the camera; None where not known.
        travels: whether its entrance pupil does, so that the distance of things matters.

    """
    error = conversion.error
    if not error.max_px < math.inf:
        return f"does not see all that the camera sees up to {error.max_angle_deg:.0f}°"
    return (
        f"loses {error.rms_px:.3f} px{_of_what(conversion, units) if travels else ''}"
        f"{_times(error.rms_px, held_out_px)}, up to {error.max_angle_deg:.0f}°"
    )


def alternatives(nearer: tuple[str, float] | None, exact: Sequence[str]) -> str:
    """Return what loses less: a format of the same tool with its loss, and those without any.

    Args:
        nearer: the format, with options, and the loss in pixels; None where there is none.
        exact: those that lose nothing.

    """
    less = "" if nearer is None else f"{nearer[0]} loses {nearer[1]:.3f} px; "
    return f"{less}{listed(exact)} lose nothing"


def _times(rms_px: float, held_out_px: float) -> str:
    if not held_out_px > 0:
        return ""
    times = two_digits(rms_px / held_out_px)
    return f", {times} times this camera's held-out error ({held_out_px:.3f} px)"


def _of_what(conversion: Conversion, units: str | None) -> str:
    if conversion.distance is None:
        return " for distant things"
    return f" for things about {length_words(conversion.distance, units or '')} away"


def comparison_rows(
    found: Sequence[tuple[str, Conversion | None]],
    exact: Sequence[str],
    held_out_px: float,
    units: str | None,
) -> tuple[tuple[str, ...], ...]:
    """Return a table of what each format loses: its titles, then a row a format, the best first."""
    titles = ("format", "loses px", "× held-out", "largest px", "up to", "for things")
    *at_any, maps = exact
    rows = [
        (-1.0, (", ".join(at_any), "0", "0", "0", "", "at any distance")),
        (-1.0, (maps, "0", "0", "0", "", "distant")),
    ]
    for to, made in found:
        if made is None or not made.error.max_px < max(made.lens.image_size):
            rows.append((math.inf, (to, "-", "-", "-", "", "no lens of its kind is near")))
            continue
        error, away = made.error, "distant"
        if made.distance is not None:
            away = f"about {length_words(made.distance, units or '')} away"
        times = two_digits(error.rms_px / held_out_px) if held_out_px > 0 else "-"
        figures = (f"{error.rms_px:.3f}", times, f"{error.max_px:.3f}")
        rows.append((error.rms_px, (to, *figures, f"{error.max_angle_deg:.0f}°", away)))
    return (titles, *(cells for _, cells in sorted(rows, key=lambda row: row[0])))


def note_lines(
    conversion: Conversion, units: str | None, trusted: str, front_only: str | None
) -> list[str]:
    """Return what a written file says of its lens, a line each.

    Args:
        conversion: the lens, and how near it is.
        units: of the camera; None where not known.
        trusted: how far the camera is, a line that is read back.
        front_only: the format's reader, where it sees nothing behind.

    """
    error, far = conversion.error, conversion.distant
    of_what = "" if far is None else f",{_of_what(conversion, units)}"
    lines = [
        f"conversion error: RMS {error.rms_px:.4f} px, largest {error.max_px:.4f} px, up to "
        f"{error.max_angle_deg:.1f} degrees from the axis{of_what}"
    ]
    if far is not None:
        lines.append(f"for distant things (--distance far): {_write_px(vars(far))}")
    farthest = error.max_angle_deg
    if error.beyond is not None:
        farthest = error.beyond["to_deg"]
        lines.append(
            f"from there to {farthest:.1f} degrees, where no corner was: {_write_px(error.beyond)}"
        )
    lines += [f"{way}: {_write_px(figures)}" for way, figures in error.also.items()]
    lines.append(trusted)
    if farthest >= _BEHIND_DEG and front_only is not None:
        lines.append(f"{front_only} itself sees nothing at 90 degrees from the axis or more")
    if conversion.turned_deg > 0:
        turn = " ".join(f"{value:.8f}" for value in conversion.lens_from_camera.ravel())
        lines.append(
            f"the frame is turned by {conversion.turned_deg:.3f} degrees; lens_from_camera: {turn}"
        )
    return lines


def near_line(rim_px: float, distance: float, units: str | None) -> str:
    """Return what a lens for distant things is not for."""
    away = length_words(distance, units or "")
    return (
        f"things {away} away, as near as the boards, are seen {abs(rim_px):.2f} px off at the rim: "
        "--distance boards is for these"
    )


def beyond_line(beyond: Mapping[str, float]) -> str:
    """Return a warning on the field where no corner was."""
    start = beyond["from_deg"]
    return (
        f"beyond {start:.1f}°, where no corner was, {_write_px(beyond)}: do not rely on it "
        f"there, or leave that out with --max-angle {start:.1f}"
    )


def too_far(
    name: str,
    conversion: Conversion,
    bound: str,
    *,
    angle: int | None,
    others: str,
) -> str:
    """Return why a lens is not written, and what to do.

    Args:
        name: of the format.
        conversion: the lens, and how near it is.
        bound: what it is more than.
        angle: degrees up to which the lens is near enough; None where it is nowhere.
        others: what loses less.

    """
    error, ways = conversion.error, []
    if angle is not None:
        ways.append(f"leave the rim out with --max-angle {angle}")
    what = f"does not see all that the camera sees up to {error.max_angle_deg:.0f}°"
    if error.max_px < math.inf:
        ways.append(f"write it all the same with --max-error {round_up(error.max_px)}")
        what = (
            f"misses the camera by up to {error.max_px:.2f} px (RMS {error.rms_px:.2f} px up to "
            f"{error.max_angle_deg:.0f}°), more than {bound}"
        )
    ways.append("take another format")
    return f"the lens of {name} {what}: {' or '.join(ways)}: {others}"


def round_up(value: float) -> str:
    """Round to two digits, and no less: what ``--max-error`` takes is what is written here."""
    scale = 10.0 ** (1 - math.floor(math.log10(value)))
    return f"{math.ceil(value * scale) / scale:g}"


def _write_px(figures: Mapping[str, float]) -> str:
    if figures["max_px"] == float("inf"):
        return "the lens does not see all of it"
    return f"RMS {figures['rms_px']:.4f} px, largest {figures['max_px']:.4f} px"


def printed(line: str, *texts: str) -> str:
    """Return a line of the note as it is printed: numbers for programs stay in the written texts.

    They are printed where the format holds no comments, which is where no text has them.
    """
    before, _, matrix = line.partition("; lens_from_camera: ")
    in_file = matrix and any(matrix in text for text in texts)
    return f"{before}: lens_from_camera is in the file" if in_file else line
