"""Units of length that people write in target.yaml."""

from cubicfish.wording import quoted

_PREFIXES = {"milli": 1.0, "centi": 10.0, "": 1000.0}
MILLIMETRES = {
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "um": 1e-3,
    "µm": 1e-3,
    "μm": 1e-3,
    "in": 25.4,
    "inch": 25.4,
    "inches": 25.4,
    "ft": 304.8,
    **{
        prefix + word: size
        for prefix, size in _PREFIXES.items()
        for word in ("metre", "metres", "meter", "meters")
    },
}

_NAMELESS = ("square", "squares", "square side", "unit", "units")


def explain_unknown(units: str) -> str:
    """What to write in place of units that are not known, or "" for those that are.

    Where nobody has measured, lengths may be counted in squares.
    """
    if units.lower() in (*MILLIMETRES, *_NAMELESS):
        return ""
    return f"{quoted(units)} is not known: write mm, cm, m, in or ft, or squares if none is known"


def times(units: str | None, others: str | None) -> float | None:
    """How many of the others one unit is; None where both are named and one is not known."""
    if units is None or others is None or units == others:
        return 1.0
    one, other = (MILLIMETRES.get(name.lower()) for name in (units, others))
    return one / other if one and other else None
