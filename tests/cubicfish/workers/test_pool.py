"""Worker processes, wherever temporary files are."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest
from samples import SAMPLE

from cubicfish.errors import DetectionError, PhotoError
from cubicfish.workers import pool
from cubicfish.workers.pool import workers_for
from cubicfish.workers.processes import by_processes


@pytest.mark.slow
@pytest.mark.parametrize("letters", [0, 90])
def test_workers_start_however_long_the_name_of_the_temporary_folder_is(
    tmp_path: Path, letters: int
) -> None:
    """A socket's name is at most a hundred letters long, and a job's folder may be longer."""
    folder = tmp_path / ("x" * letters)
    folder.mkdir(exist_ok=True)
    work = (
        "from cubicfish.workers.processes import by_processes; "
        "print(*by_processes(abs, [-1, 2], 2))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", work],
        env={**os.environ, "TMPDIR": str(folder)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.stdout.strip(), done.stderr) == ("1 2", "")
    assert list(folder.iterdir()) == []


def test_processes_are_as_many_as_are_asked_for_or_as_processors_have_work(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pool, "_ITEMS_FOR_POOL", 4)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    assert [workers_for(None, items) for items in (0, 3, 4, 9)] == [1, 1, 3, 3]
    assert [workers_for(2, items) for items in (0, 1, 9)] == [1, 1, 2]


def dies(fate: str) -> str:
    if fate == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    return fate


def refuses(name: str) -> str:
    if name == "bad":
        raise PhotoError("bad is no photo")
    if name == "odd":
        raise KeyError("odd")
    return name


def cannot_travel(name: str) -> Callable[[], str]:
    return lambda: name


def outcome(work: Callable[[str], object], items: list[str]) -> BaseException | list[object]:
    """What becomes of the work, by two processes; that it ends at all."""
    outcomes: list[BaseException | list[object]] = []

    def run() -> None:
        try:
            outcomes.append(list(by_processes(work, items, 2)))
        except BaseException as problem:
            outcomes.append(problem)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(120)
    assert outcomes, "it hangs"
    assert multiprocessing.active_children() == []
    return outcomes[0]


@pytest.mark.slow
def test_a_request_to_end_waits_until_a_process_has_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else a process is told by half what it is to do, and prints what it thinks of it."""
    started = []
    start = SpawnProcess.start

    def interrupted(process: SpawnProcess) -> None:
        signal.raise_signal(signal.SIGINT)
        start(process)
        started.append(process)

    monkeypatch.setattr(SpawnProcess, "start", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        list(by_processes(abs, [-1, 2], 2))
    assert len(started) == 2
    assert not any(process.is_alive() for process in started)
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.slow
def test_answers_come_in_order() -> None:
    assert outcome(refuses, list("abcdefgh")) == list("abcdefgh")


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 3])
def test_a_process_that_is_killed_is_an_error_and_no_hang(place: int) -> None:
    items = list("abcd")
    items[place] = "dies"
    problem = outcome(dies, items)
    assert isinstance(problem, DetectionError)
    assert "ended from outside" in str(problem)


BARE = """
import sys
import numpy as np
from cubicfish import Run, Target, detect
grey = np.zeros((64, 64), np.uint8)
detect([grey, grey], Target.load(sys.argv[1]), Run(jobs=2))
"""


@pytest.mark.slow
@pytest.mark.parametrize("way", ["file", "standard input"])
def test_a_script_that_works_as_it_is_loaded_is_told_so(tmp_path: Path, way: str) -> None:
    script = tmp_path / "script.py"
    script.write_text(BARE)
    done = subprocess.run(
        [sys.executable, script if way == "file" else "-", SAMPLE / "target.yaml"],
        input=BARE, capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = done.stderr.splitlines()[-1]
    assert said.startswith("cubicfish.errors.DetectionError: ")
    assert "__name__" in said
    assert "jobs=1" in said
    assert "memory" not in done.stderr
    if way == "file":
        assert "script.py" in done.stderr
        assert "bootstrapping" not in done.stderr
        assert done.stderr.count("line 6, in <module>") == 1  # of the other processes nothing


@pytest.mark.slow
def test_what_the_work_raises_is_raised() -> None:
    problem = outcome(refuses, ["a", "bad", "c"])
    assert isinstance(problem, PhotoError)
    assert str(problem) == "bad is no photo"
    problem = outcome(refuses, ["a", "odd", "c"])
    assert isinstance(problem, KeyError)
    assert "in refuses" in str(problem.__cause__)  # of that process: --debug shows it
    assert "local object" in str(outcome(cannot_travel, ["a", "b"]))


@pytest.mark.slow
def test_leaving_early_ends_the_processes() -> None:
    answers = by_processes(refuses, list("abcdefgh"), 2)
    assert next(answers) == "a"
    answers.close()
    assert multiprocessing.active_children() == []
