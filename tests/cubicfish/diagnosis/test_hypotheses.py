"""The table of hypotheses: what is tried, and in which order it is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from cubicfish.diagnosis import diagnose
from cubicfish.diagnosis.diagnose import Hypothesis, find_faults
from cubicfish.errors import FitError
from cubicfish.fit.calibration import Evidence
from cubicfish.judge.codes import Code
from cubicfish.judge.finding import Finding


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen(Evidence):
    """Evidence of a kind of its own."""


def hypothesis(code, tried, **more):
    def explain(evidence):
        tried.append(code)
        return [Finding(code=code)]

    return Hypothesis(Seen, explain, **more)


@pytest.fixture
def table(monkeypatch):
    return lambda *rows: monkeypatch.setattr(diagnose, "HYPOTHESES", rows)


def codes(found):
    return [finding.code for finding in found]


def test_what_is_known_is_reported_first(table):
    tried: list[Code] = []
    table(hypothesis(Code.ZOOM, tried), hypothesis(Code.REPEATS, tried))
    known = [Finding(code=Code.MIRRORED)]
    assert codes(find_faults(Seen(), known)) == ["mirrored", "zoom", "repeats"]
    assert tried == [Code.ZOOM, Code.REPEATS]


def test_what_does_not_apply_is_not_tried(table):
    tried: list[Code] = []

    def without_zoom(evidence, found):
        return Code.ZOOM not in codes(found)

    table(
        hypothesis(Code.ZOOM, tried),
        hypothesis(Code.SCALED, tried, applies=without_zoom),
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
        Hypothesis(Seen, fail),
        hypothesis(Code.SCALED, tried),
    )
    assert codes(find_faults(Seen())) == [Code.SCALED]
