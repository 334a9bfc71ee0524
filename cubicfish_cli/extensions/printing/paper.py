"""Sizes of paper in millimetres."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.units import MILLIMETRES, NUMBER, UNITS
from cubicfish_cli.core.wording import did_you_mean, quoted

# Width and height in millimetres, upright: ISO 216 and ANSI/ASME Y14.1.
PAPERS: dict[str, tuple[float, float]] = {
    "A0": (841, 1189),
    "A1": (594, 841),
    "A2": (420, 594),
    "A3": (297, 420),
    "A4": (210, 297),
    "A5": (148, 210),
    "B0": (1000, 1414),
    "B1": (707, 1000),
    "B2": (500, 707),
    "B3": (353, 500),
    "B4": (250, 353),
    "Letter": (215.9, 279.4),
    "Legal": (215.9, 355.6),
    "Tabloid": (279.4, 431.8),
    "Ledger": (279.4, 431.8),
    "ANSI C": (431.8, 558.8),
    "ANSI D": (558.8, 863.6),
    "ANSI E": (863.6, 1117.6),
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
    """``A4``, ``letter``, ``600x400mm`` or ``24x36in`` -> Paper.

    Raises:
        TargetError: the text is no size of paper, or too small or too large a one.

    """
    known = {name.lower().replace(" ", ""): name for name in PAPERS}
    name = known.get(re.sub(r"[\s_-]", "", text).lower())
    if name is not None:
        short, long = PAPERS[name]
        return Paper(name=name, short=short, long=long)
    side = rf"\s*({NUMBER})\s*({UNITS})?\s*"
    match = re.fullmatch(rf"{side}[x×]{side}", text, re.I)
    if match is None:
        raise TargetError(
            f"{quoted(text)} is no size of paper: write a name or WIDTHxHEIGHT such as 600x400mm; "
            f"{did_you_mean(text, PAPERS)}"
        )
    units = (match[2] or match[4] or "mm", match[4] or match[2] or "mm")
    short, long = sorted(
        float(number) * MILLIMETRES[unit.lower()]
        for number, unit in zip(match.group(1, 3), units, strict=True)
    )
    if short < SMALLEST[0] or long < SMALLEST[1] or long > LARGEST:
        raise TargetError(
            f"paper of {short:g} x {long:g} mm is of no use here: it must be at least "
            f"{SMALLEST[0]:g} x {SMALLEST[1]:g} mm and at most {LARGEST:g} mm long"
        )
    return Paper(name=f"{short:g} x {long:g} mm", short=short, long=long)


def millimetres_per(units: str) -> float:
    """How many millimetres a target's unit is.

    Raises:
        TargetError: the unit is not known.

    """
    factor = MILLIMETRES.get(units.strip().lower().rstrip("."))
    if factor is None:
        raise TargetError(
            f"units {quoted(units)} cannot be printed at true scale: write mm, cm, m or in"
        )
    return factor
