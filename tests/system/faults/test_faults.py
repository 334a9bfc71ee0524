"""A few of the faults that try_faults.py tries by hundreds, through the real program."""

import random
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from equality import same_files
from fault_kills import SIGNALS, Tally, Undisturbed, kill_once, not_right, run_undisturbed
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


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
def test_a_run_that_is_ended_can_be_finished(
    work: tuple[Scenario, Path, Undisturbed], number: signal.Signals
) -> None:
    assert kill_once(*work, number, random.Random(number.name)) == []


@pytest.mark.slow
@pytest.mark.parametrize("what", ["full disk", "read-only folder"])
def test_places_that_take_no_results(work: tuple[Scenario, Path, Undisturbed], what: str) -> None:
    wrong = PROBLEMS[what](*work)
    if wrong is None:
        pytest.skip("a file system of its own takes root")
    assert wrong == []


@pytest.mark.slow
def test_a_parent_that_is_killed_takes_its_workers_along(tmp_path: Path) -> None:
    scenario = SCENARIOS["calibrate photos"]
    usual = Undisturbed(files={}, inputs={}, seconds=1.0)
    with prepared(scenario, tmp_path):
        wrong = kill_once(scenario, tmp_path, usual, signal.SIGKILL, _Late())
    assert [line for line in wrong if "processes stay" in line] == []


@pytest.mark.slow
def test_ctrl_c_is_heard_wherever_the_tests_were_started(tmp_path: Path) -> None:
    """A shell's background job is deaf to it, and so is what it starts."""
    scenario = SCENARIOS["calibrate photos"]
    tally = Tally()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with prepared(scenario, tmp_path):
            usual = Undisturbed(files={}, inputs={}, seconds=1.0)
            kill_once(scenario, tmp_path, usual, signal.SIGINT, _Late(), tally)
    finally:
        signal.signal(signal.SIGINT, before)
    assert tally.ended["SIGINT"] == 1


class _Late(random.Random):
    """A moment at which workers look for corners."""

    def random(self) -> float:
        return 0.0

    def uniform(self, a: float, b: float) -> float:
        return 0.8


@pytest.mark.parametrize(
    ("there", "killed", "right"),
    [
        ({"camera.yaml": "new", "map": "new"}, True, True),
        ({"camera.yaml": "old", "map": "old", "page": "old"}, True, True),
        ({"map": "new", "page": "old"}, True, True),
        ({"map": "new", "page": "old"}, False, False),
        ({"camera.yaml": "old", "map": "new", "page": "old"}, True, False),
        ({"camera.yaml": "new", "map": "new", "page": "old"}, True, False),
        ({"camera.yaml": "half", "map": "new"}, True, False),
    ],
)
def test_a_mixture_of_old_and_new_is_noticed(
    tmp_path: Path, there: dict[str, str], killed: bool, right: bool
) -> None:
    usual = Undisturbed(
        files={"camera.yaml": "new", "map": "new"},
        before={"camera.yaml": "old", "map": "old", "page": "old"},
        inputs={},
        seconds=1.0,
    )
    wrong = not_right(SCENARIOS["calibrate again"], tmp_path, usual, there, killed=killed)
    assert (wrong == []) is right


@pytest.mark.parametrize(
    ("one", "two", "same"),
    [
        ("a: 1.25, b", "a: 1.25, b", True),
        ("rms: 0.12345678901", "rms: 0.12345678909", True),
        ("rms: 0.1234567", "rms: 0.1234568", False),
        ("rms: 0.5", "max: 0.5", False),
        ("- 1.0\n", "- 1.0\n- 1.0\n", False),
    ],
)
def test_results_are_the_same_to_a_billionth(
    tmp_path: Path, one: str, two: str, same: bool
) -> None:
    (tmp_path / "one.yaml").write_text(one)
    (tmp_path / "two.yaml").write_text(two)
    assert same_files(tmp_path / "one.yaml", tmp_path / "two.yaml") is same
