"""A command is ended at a random moment: what must hold then, and after a second run."""

import os
import random
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from fault_scenarios import LONGEST_S, Scenario, clear, contents, finished, start

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
# What is left of a run's processes must go by itself within this time.
_GRACE_S = 20.0
_STEP_S = 0.0005


@dataclass(frozen=True, kw_only=True)
class Undisturbed:
    """What the command does when it is left alone.

    Attributes:
        files: path below ``out/`` -> SHA-256.
        inputs: path below ``in/`` -> SHA-256, before any run.
        seconds: how long it takes.

    """

    files: dict[str, str]
    inputs: dict[str, str]
    seconds: float


def run_undisturbed(scenario: Scenario, folder: Path) -> Undisturbed:
    """Run it to the end."""
    inputs = contents(folder / "in")
    clear(folder)
    begin = time.monotonic()
    code = start(scenario, folder).wait(LONGEST_S)
    seconds = time.monotonic() - begin
    assert code == 0, said(folder)
    files = contents(folder / "out")
    assert files
    assert finished(files) == files, "a temporary file stayed behind"
    return Undisturbed(files=files, inputs=inputs, seconds=seconds)


def kill_once(
    scenario: Scenario,
    folder: Path,
    usual: Undisturbed,
    number: signal.Signals,
    random_: random.Random,
) -> list[str]:
    """End the command at a random moment and run it again.

    Half of the moments lie anywhere in the run, half right after a file appears.

    Returns:
        What is wrong, one line each.

    """
    clear(folder)
    process = start(scenario, folder)
    if random_.random() < 0.5:
        _wait(process, random_.uniform(0, usual.seconds))
    else:
        _wait_for_file(process, folder / "out", 2 * usual.seconds)
        _wait(process, random_.uniform(0, 0.02))
    if process.poll() is None:
        # A terminal sends Ctrl-C to every process, a shell job's kill to one.
        if number == signal.SIGINT and random_.random() < 0.5:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
    wrong = []
    try:
        code = process.wait(LONGEST_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return ["it hangs"]
    if code not in (0, -number, 128 + number):
        wrong.append(f"exit code {code}")
    wrong += _left_alone(process.pid)
    after = contents(folder / "out")
    wrong += [
        f"{name} is not what it should be"
        for name, digest in finished(after).items()
        if usual.files.get(name) != digest
    ]
    if number != signal.SIGKILL and finished(after) != after:
        wrong.append(f"temporary files stay: {sorted(set(after) - set(finished(after)))}")
    wrong += traces(folder)
    wrong += [f"the first run: {line}" for line in changed(folder, usual)]
    return wrong + run_again(scenario, folder, usual)


def run_again(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str]:
    """The second run finishes the work, and nobody can tell."""
    more = ("--skip-existing",) if scenario.skips else ("--overwrite",)
    wrong = []
    code = start(scenario, folder, *more).wait(LONGEST_S)
    if code != 0:
        wrong.append(f"the second run ends with {code}: {said(folder)}")
    if finished(contents(folder / "out")) != usual.files:
        wrong.append("the second run's result differs")
    wrong += [f"the second run: {line}" for line in (*traces(folder), *changed(folder, usual))]
    return wrong


def changed(folder: Path, usual: Undisturbed) -> list[str]:
    """Inputs that are not what they were, and files where none should be."""
    wrong = [] if contents(folder / "in") == usual.inputs else ["an input changed"]
    wrong += [f"{name} in the home folder" for name in contents(folder / "home")]
    return wrong


def said(folder: Path) -> str:
    """What the last run said."""
    return (folder / "said.txt").read_text(errors="replace")


def traces(folder: Path) -> list[str]:
    """Tracebacks among what was said."""
    text = said(folder)
    return (
        [f"traceback: {text[-1500:]}"] if "Traceback" in text or "Exception ignored" in text else []
    )


def _wait(process: subprocess.Popen[bytes], seconds: float) -> None:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return


def _wait_for_file(process: subprocess.Popen[bytes], folder: Path, longest: float) -> None:
    """Until a file is there, temporary or final."""
    until = time.monotonic() + longest
    while process.poll() is None and time.monotonic() < until:
        if any(files for _, _, files in os.walk(folder)):
            return
        time.sleep(_STEP_S)


def _left_alone(session: int) -> list[str]:
    """Processes of a session whose leader has ended and that do not end by themselves."""
    until = time.monotonic() + _GRACE_S
    while alive := _of_session(session):
        if time.monotonic() > until:
            for pid in alive:
                os.kill(pid, signal.SIGKILL)
            return [f"{len(alive)} processes stay behind"]
        time.sleep(0.05)
    return []


def _of_session(session: int) -> list[int]:
    alive = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue  # ended meanwhile
            if int(fields[3]) == session and fields[0] not in "ZX":
                alive.append(int(entry.name))
    return alive
