"""Numbers with bounds on the command line, and in words what is wrong with one."""

from __future__ import annotations

import math
import re
from typing import Any, NoReturn

import click

from cubicfish_cli.wording import quoted


class FloatRange(click.FloatRange):
    """A finite number within bounds.

    Args:
        least, most: the bounds.
        min_open: whether it must be more than ``least``.
        unit: what it counts, in the plural.

    """

    def __init__(
        self,
        min: float | None = None,
        max: float | None = None,
        *,
        min_open: bool = False,
        unit: str = "",
    ) -> None:
        super().__init__(min=min, max=max, min_open=min_open)
        self.unit = unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse, or fail as a usage error that says the bounds."""
        try:
            number: float = super().convert(value, param, ctx)
        except click.BadParameter:
            number = math.nan
        if not math.isfinite(number):
            _fail(self, "a number", self.unit, value, param, ctx)
        return number


class IntRange(click.IntRange):
    """A whole number within bounds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse, or fail as a usage error that says the bounds."""
        try:
            number: int = super().convert(value, param, ctx)
        except click.BadParameter:
            _fail(self, "a whole number", "", value, param, ctx)
        return number


class Seconds(click.ParamType):
    """A length of time with its unit, such as 5ms, as seconds."""

    name = "time"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse, or fail as a usage error."""
        if isinstance(value, float):
            return value
        found = re.fullmatch(r"([0-9]*\.?[0-9]+) *(us|ms|s)", str(value).strip())
        if found is None or not float(found[1]) > 0:
            self.fail(f"{quoted(str(value))} is no time: write 5ms, 200us or 0.01s", param, ctx)
        return float(found[1]) * {"us": 1e-6, "ms": 1e-3, "s": 1.0}[found[2]]


def _fail(
    kind: click.FloatRange | click.IntRange,
    what: str,
    unit: str,
    value: Any,
    param: click.Parameter | None,
    ctx: click.Context | None,
) -> NoReturn:
    of = f" of {unit}" if unit else ""
    kind.fail(f"{quoted(str(value))} is not {what}{of} {_bounds(kind)}".rstrip(), param, ctx)


def _bounds(kind: click.FloatRange | click.IntRange) -> str:
    low, high = (None if end is None else f"{end:,}" for end in (kind.min, kind.max))
    if low is None:
        return "" if high is None else f"up to {high}"
    if high is None:
        return f"above {low}" if kind.min_open else f"from {low} on"
    return f"above {low} and up to {high}" if kind.min_open else f"from {low} to {high}"
