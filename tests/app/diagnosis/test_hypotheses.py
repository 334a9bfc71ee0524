"""The table of hypotheses: what is tried first, what is told first, and what is looked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from cubicfish_cli.app.diagnosis import diagnose
from cubicfish_cli.app.diagnosis.diagnose import HYPOTHESES, Cost, Hypothesis, find_faults
from cubicfish_cli.core.codes import Code
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.calibration import Evidence


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen(Evidence):
    """Evidence of a kind of its own."""


def hypothesis(code, cost, tried, **more):
    def explain(evidence):
        tried.append(code)
        return [Finding(code=code)]

    return Hypothesis(Seen, (code,), cost, explain, **more)


@pytest.fixture
def table(monkeypatch):
    return lambda *rows: monkeypatch.setattr(diagnose, "HYPOTHESES", rows)


def codes(found):
    return [finding.code for finding in found]


def test_the_cheapest_is_tried_first_and_the_first_of_the_table_told_first(table):
    tried: list[Code] = []
    table(
        hypothesis(Code.ZOOM, Cost.TRIALS, tried),
        hypothesis(Code.REPEATS, Cost.TABLES, tried),
        hypothesis(Code.SCALED, Cost.PASS, tried),
    )
    known = [Finding(code=Code.MIRRORED)]
    assert codes(find_faults(Seen(), known)) == ["mirrored", "zoom", "repeats", "scaled"]
    assert tried == [Code.REPEATS, Code.SCALED, Code.ZOOM]


def test_what_does_not_apply_is_not_tried(table):
    tried: list[Code] = []

    def without_zoom(evidence, found):
        return Code.ZOOM not in codes(found)

    table(
        hypothesis(Code.SCALED, Cost.TRIALS, tried, applies=without_zoom),
        hypothesis(Code.ZOOM, Cost.PASS, tried),
    )
    assert codes(find_faults(Seen())) == tried == [Code.ZOOM]
    tried.clear()
    assert codes(find_faults(Evidence())) == tried == []  # that is evidence of another kind


@pytest.mark.parametrize("error", [FitError("no fit"), np.linalg.LinAlgError("singular")])
def test_what_cannot_be_tried_explains_nothing(table, error):
    def fail(evidence):
        raise error

    tried: list[Code] = []
    table(
        Hypothesis(Seen, (Code.ZOOM,), Cost.TABLES, fail),
        hypothesis(Code.SCALED, Cost.TABLES, tried),
    )
    assert codes(find_faults(Seen())) == [Code.SCALED]


def test_all_that_may_be_wrong_with_a_set_up_is_looked_for():
    known = list(Code)
    of_a_set_up = known[known.index(Code.BOARD_ORDER) : known.index(Code.ONE_PLACE) + 1]
    assert set(of_a_set_up) <= {code for row in HYPOTHESES for code in row.codes}
