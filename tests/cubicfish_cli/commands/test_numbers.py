"""Numbers on the command line: what is refused, and in which words."""

import click
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from cubicfish_cli.terminal.parameters import FloatRange

ANGLE = FloatRange(0, 360, min_open=True)


def converted(kind: click.ParamType, text: str) -> object:
    return kind.convert(text, None, None)


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999"])
def test_what_is_not_finite_is_no_number(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not"):
        converted(FloatRange(min=0), text)


@given(st.floats(0, 360, exclude_min=True))
def test_what_is_within_is_taken_as_it_is(number: float) -> None:
    assert converted(ANGLE, repr(number)) == number


def test_help_shows_the_range_as_click_does() -> None:
    command = click.Command("c", params=[click.Option(["--angle"], type=ANGLE, metavar="DEG")])
    assert "[0<x<=360]" in CliRunner().invoke(command, ["--help"]).output
