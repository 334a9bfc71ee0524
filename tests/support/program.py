"""Fixtures of tests that run the program."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from running import MISSING, Run, run_cli
from samples import SAMPLE

from cubicfish_cli.render import drawing as extra

if TYPE_CHECKING:
    from cubicfish.fit.calibration import Calibration


@pytest.fixture
def run() -> Run:
    return run_cli


@pytest.fixture(scope="session", autouse=True)
def no_report() -> Iterator[None]:
    """As if the extra 'report' were absent: what writes pages takes its time, and says so."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            extra, "missing", lambda of: ["jinja2"] if of == extra.REPORT else MISSING(of)
        )
        yield


@pytest.fixture
def with_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra 'report' as it is here; without it the test is skipped."""
    for library in extra.REPORT:
        pytest.importorskip(library)
    monkeypatch.setattr(extra, "missing", MISSING)


@pytest.fixture
def quick_fit(fitted: Calibration, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ``cubicfish calibrate`` give that fit at once, whatever its input."""
    from cubicfish.fit import calibrate

    monkeypatch.setattr(calibrate, "calibrate", lambda pairs, **options: fitted)


@pytest.fixture(scope="session")
def calibrated(fitted: Calibration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the calibration of the sample's exact corners. Do not write into it."""
    from cubicfish.fit import calibrate

    folder = tmp_path_factory.mktemp("calibrated") / "calibration"
    corners, target = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
    with pytest.MonkeyPatch.context() as patch:  # that fit is what the command would find
        patch.setattr(calibrate, "calibrate", lambda pairs, **options: fitted)
        run_cli("calibrate", corners, "--target", target, "--no-hold-out", "-o", folder)
    return folder
