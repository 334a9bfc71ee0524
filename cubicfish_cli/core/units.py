"""Units of length that people write in target.yaml."""

import math

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
_IMPERIAL = ("in", "inch", "inches", "ft")


def times(units: str | None, others: str | None) -> float | None:
    """How many of the others one unit is; None where two are named and one is not known."""
    if units is None or others is None or units == others:
        return 1.0
    one, other = (MILLIMETRES.get(name.lower()) for name in (units, others))
    return one / other if one and other else None


def length_words(length: float, units: str) -> str:
    """A length to two digits in a unit that suits it: ``40 cm``; not metric ones stay as they are.

    Args:
        length: in ``units``.
        units: of the length; ``""`` where they are not known.

    """
    size = 0.0 if units in _IMPERIAL else MILLIMETRES.get(units, 0.0)
    if length > 0 and size:
        for name in ("m", "cm", "mm"):
            own = length * size / MILLIMETRES[name]
            if own >= (2 if name == "cm" else 1) or name == "mm":
                return f"{two_digits(own)} {name}"
    return f"{two_digits(length)} {units}".rstrip()


def two_digits(value: float) -> str:
    """A number, 0 or above, to two digits: ``1100``, ``0.41``."""
    digits = 1 - math.floor(math.log10(value)) if value > 0 else 0
    return f"{round(value, digits):.{max(0, digits)}f}"
