"""A few of the faults that try_faults.py tries by hundreds, through the real program."""

import random
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_kills import SIGNALS, Undisturbed, kill_once, run_undisturbed
from fault_places import PROBLEMS
from fault_scenarios import SCENARIOS, Scenario, prepared

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are followed in /proc")


@pytest.fixture(scope="module", params=["undistort folder", "undistort formats"])
def work(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Scenario, Path, Undisturbed]]:
    scenario = SCENARIOS[request.param]
    with prepared(scenario, tmp_path_factory.mktemp("faults")) as folder:
        yield scenario, folder, run_undisturbed(scenario, folder)


@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
def test_a_run_that_is_ended_can_be_finished(
    work: tuple[Scenario, Path, Undisturbed], number: signal.Signals
) -> None:
    assert kill_once(*work, number, random.Random(number.name)) == []


@pytest.mark.parametrize("what", ["full disk", "read-only folder", "results exist"])
def test_places_that_take_no_results(work: tuple[Scenario, Path, Undisturbed], what: str) -> None:
    wrong = PROBLEMS[what](*work)
    if wrong is None:
        pytest.skip("a file system of its own takes root")
    assert wrong == []


def test_a_parent_that_is_killed_takes_its_workers_along(tmp_path: Path) -> None:
    scenario = SCENARIOS["calibrate photos"]
    usual = Undisturbed(files={}, inputs={}, seconds=1.0)
    with prepared(scenario, tmp_path):
        wrong = kill_once(scenario, tmp_path, usual, signal.SIGKILL, _Late())
    assert [line for line in wrong if "processes stay" in line] == []


class _Late(random.Random):
    """A moment at which workers look for corners."""

    def random(self) -> float:
        return 0.0

    def uniform(self, a: float, b: float) -> float:
        return 0.8
