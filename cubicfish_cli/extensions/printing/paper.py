"""Sizes of paper in millimetres."""

import re
from dataclasses import dataclass

from cubicfish import TargetError, did_you_mean, quoted
from cubicfish_cli.inputs.target_source import length_mm

# Width and height in millimetres, upright: ISO 216 and ANSI.
PAPERS: dict[str, tuple[float, float]] = {
    "A0": (841, 1189),
    "A1": (594, 841),
    "A2": (420, 594),
    "A3": (297, 420),
    "A4": (210, 297),
    "A5": (148, 210),
    "Letter": (215.9, 279.4),
    "Legal": (215.9, 355.6),
    "Tabloid": (279.4, 431.8),
}
# The ruler of 100 mm must have its place; PDF readers take pages of up to 200 inches.
SMALLEST, LARGEST = (100.0, 140.0), 5080.0


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A size of paper, upright.

    Attributes:
        name: as a user would know it.
        short, long: its sides in millimetres.

    """

    name: str
    short: float
    long: float


def paper(text: str) -> Paper:
    """Parse a size of paper: ``A4``, ``letter``, ``600x400mm`` or ``24x36in``.

    Raises:
        TargetError: the text is no size of paper, or too small or too large a one.

    """
    for name, (short, long) in PAPERS.items():
        if name.lower() == text.strip().lower():
            return Paper(name=name, short=short, long=long)
    match = re.fullmatch(r"([0-9.]+)[x×]([0-9.]+)([a-z]*)", re.sub(r"\s", "", text.lower()))
    if match is None:
        raise TargetError(
            f"{quoted(text)} is no size of paper: write a name or WIDTHxHEIGHT such as 600x400mm; "
            f"{did_you_mean(text, PAPERS)}"
        )
    short, long = sorted(length_mm(side + match[3]) for side in match.group(1, 2))
    if short < SMALLEST[0] or long < SMALLEST[1] or long > LARGEST:
        raise TargetError(
            f"paper of {short:g} x {long:g} mm is of no use here: it must be at least "
            f"{SMALLEST[0]:g} x {SMALLEST[1]:g} mm and at most {LARGEST:g} mm long"
        )
    return Paper(name=f"{short:g} x {long:g} mm", short=short, long=long)
