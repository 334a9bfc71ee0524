"""Plurals, lists and shares in sentences."""

from string import Formatter
from typing import Any

from cubicfish_cli.core.wording import listed


def percent(share: float) -> str:
    """A share as a signed percentage of two digits or more: 0.0123 -> ``+1.2 %``."""
    return f"{100 * share:+.0f} %" if abs(share) >= 0.995 else f"{100 * share:+.2g} %"


def plural(number: float, what: str) -> str:
    """``1 photo``, ``2 photos``, ``1,200 photos``."""
    return f"{number:,.0f} {what}{'' if number == 1 else 's'}"


class Sentences(Formatter):
    """Templates of ``str.format`` with a few more ways to write a value.

    ``{n:#photo}`` is a count with its noun, ``{names:&photos}`` a list, ``{n:?it|them}`` the first
    of two words where the value is 1 or true (or a list of one), ``{share:%}`` whole percents and
    ``{share:+%}`` a signed percentage.
    """

    def format_field(self, value: Any, format_spec: str) -> str:
        """One value of a template."""
        kind, rest = format_spec[:1], format_spec[1:]
        if kind == "?":
            one, other = rest.split("|", 1)
            number = len(value) if isinstance(value, tuple | list) else value
            return one if number == 1 else other
        if kind == "#":
            return plural(value, rest)
        if kind == "&":
            return listed(value, rest)
        if format_spec == "%":
            return f"{100 * value:.0f} %"
        if format_spec == "+%":
            return percent(value)
        return str(format(value, format_spec))
