"""Numbers on the command line: what is refused, and in which words."""

import click
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from cubicfish_cli.app.terminal.options import FloatRange, IntRange

ANGLE = FloatRange(0, 360, min_open=True)


def converted(kind: click.ParamType, text: str) -> object:
    return kind.convert(text, None, None)


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        (ANGLE, "abc", "'abc' is not a number above 0 and up to 360"),
        (ANGLE, "400", "'400' is not a number above 0 and up to 360"),
        (ANGLE, "0", "'0' is not a number above 0 and up to 360"),
        (FloatRange(0, 0.8), "", "'' is not a number from 0 to 0.8"),
        (FloatRange(0, min_open=True), "-1", "'-1' is not a number above 0"),
        (FloatRange(min=0), "x\x1b", "'x\\x1b' is not a number from 0 on"),
        (IntRange(1, 10_000), "1.5", "'1.5' is not a whole number from 1 to 10,000"),
        (IntRange(min=1), "0", "'0' is not a whole number from 1 on"),
    ],
)
def test_the_bounds_are_said(kind: click.ParamType, text: str, said: str) -> None:
    with pytest.raises(click.BadParameter) as refused:
        converted(kind, text)
    assert refused.value.message == said


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999"])
def test_what_is_not_finite_is_no_number(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not a number from 0 on"):
        converted(FloatRange(min=0), text)


@given(st.floats(0, 360, exclude_min=True))
def test_what_is_within_is_taken_as_it_is(number: float) -> None:
    assert converted(ANGLE, repr(number)) == number


@given(st.integers(1, 10_000))
def test_whole_numbers_are_taken_as_they_are(number: int) -> None:
    assert converted(IntRange(1, 10_000), str(number)) == number


def test_help_shows_the_range_as_click_does() -> None:
    command = click.Command("c", params=[click.Option(["--angle"], type=ANGLE, metavar="DEG")])
    assert "[0<x<=360]" in CliRunner().invoke(command, ["--help"]).output
