"""A command is ended at a random moment: what must hold then, and after a second run."""

import os
import random
import shutil
import signal
import subprocess
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from equality import same_files
from fault_process import LONGEST_S, SCHEDULER, printed, said
from fault_scenarios import Scenario, clear, contents, finished, is_temporary, start

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
# What is left of a run's processes must go by itself within this time.
_GRACE_S = 20.0
_STEP_S = 0.0005
# A third of the moments lie anywhere in the run, a third in its last part, in which it writes, and
# a third right after a file appears.
_LAST_PART = 0.3
_AFTER_FILE_S = 0.02
# A run that left nothing at all, or all, is run again less often: nothing is new about that.
_PLAIN_AGAIN = 0.1


@dataclass(frozen=True, kw_only=True)
class Undisturbed:
    """What the command does when it is left alone.

    Attributes:
        files: path below ``out/`` -> SHA-256.
        before: the same of older results, where there are any.
        inputs: path below ``in/`` -> SHA-256, before any run.
        printed: what goes to stdout.
        seconds: how long it takes.

    """

    files: dict[str, str]
    before: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str]
    printed: str = ""
    seconds: float


@dataclass(kw_only=True)
class Tally:
    """What was tried and how it went.

    Attributes:
        ended: runs that a signal ended, by the signal's name.
        late: runs that had ended before the signal.
        early: runs that ended before the first line of the program, while Python started.
        between: runs that left some files of several, temporary or final.
        reruns: second runs.
        close: results that were equal to a billionth, not to the byte.
        seconds: how long a run takes at present, as the machine does other work too.

    """

    ended: Counter[str] = field(default_factory=Counter)
    late: int = 0
    early: int = 0
    between: int = 0
    reruns: int = 0
    close: int = 0
    seconds: float = 0.0

    def took(self, seconds: float) -> None:
        """A run took so long."""
        self.seconds += 0.3 * (seconds - self.seconds)


def run_undisturbed(scenario: Scenario, folder: Path) -> Undisturbed:
    """Run it to the end; the results are kept in ``usual/``."""
    inputs = contents(folder / "in")
    clear(folder)
    begin = time.monotonic()
    code = start(scenario, folder).wait(LONGEST_S)
    seconds = time.monotonic() - begin
    assert code == 0, said(folder)
    files = contents(folder / "out")
    assert bool(files) != scenario.prints
    assert finished(files) == files, "a temporary file stayed behind"
    shutil.rmtree(folder / "usual", ignore_errors=True)
    shutil.copytree(folder / "out", folder / "usual")
    before = contents(folder / "before") if scenario.before else {}
    return Undisturbed(
        files=files, before=before, inputs=inputs, printed=printed(folder), seconds=seconds
    )


def kill_once(
    scenario: Scenario,
    folder: Path,
    usual: Undisturbed,
    number: signal.Signals,
    random_: random.Random,
    tally: Tally | None = None,
) -> list[str]:
    """End the command at a random moment and run it again.

    Returns:
        What is wrong, one line each.

    """
    tally = tally or Tally()
    tally.seconds = tally.seconds or usual.seconds
    clear(folder)
    begin = time.monotonic()
    process = start(scenario, folder)
    kind = random_.random()
    if kind < 1 / 3:
        _wait(process, random_.uniform(0, tally.seconds))
    elif kind < 2 / 3:
        _wait(process, random_.uniform(1 - _LAST_PART, 1) * tally.seconds)
    else:
        _wait_for_change(process, folder, usual, 3 * tally.seconds)
        _wait(process, random_.uniform(0, _AFTER_FILE_S))
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
    early = number == signal.SIGINT and before_it_begins(said(folder))
    if code not in (0, -number, 128 + number) and not early:
        wrong.append(f"exit code {code}")
    tally.early += early
    if code == 0:
        tally.late += 1
        tally.took(time.monotonic() - begin)
    else:
        tally.ended[number.name] += 1
    wrong += left_alone(process.pid)
    after = contents(folder / "out")
    wrong += not_right(scenario, folder, usual, after, killed=number == signal.SIGKILL)
    if number != signal.SIGKILL and SCHEDULER not in scenario.args and finished(after) != after:
        wrong.append(f"temporary files stay: {sorted(set(after) - set(finished(after)))}")
    wrong += traces(folder)
    wrong += [f"the first run: {line}" for line in changed(folder, usual)]
    if after not in (usual.before, usual.files):
        tally.between += 1
    empty = after == usual.before and not (folder / "cache").exists()
    plain = empty or after == usual.files
    if not wrong and plain and random_.random() > _PLAIN_AGAIN:
        return []
    return wrong + run_again(scenario, folder, usual, tally)


def not_right(
    scenario: Scenario, folder: Path, usual: Undisturbed, after: dict[str, str], *, killed: bool
) -> list[str]:
    """Files under final names that are neither the usual nor older results, or do not belong."""
    there = finished(after)
    wrong = []
    news = set()
    for name, digest in there.items():
        if digest == usual.files.get(name) or _as_usual(scenario, folder, name):
            news.add(name)
        elif digest != usual.before.get(name):
            wrong.append(f"{name} is not what it should be")
    if wrong:
        return wrong
    all_old, all_new = there == usual.before, news == set(usual.files) == set(there)
    if scenario.head is not None and not (all_old or all_new):
        if scenario.head in there:
            wrong.append(f"{scenario.head} is there with {sorted(there)}, new {sorted(news)}")
        elif not killed:
            wrong.append(f"not all and not none: {sorted(there)}, new {sorted(news)}")
    return wrong


def _as_usual(scenario: Scenario, folder: Path, name: str) -> bool:
    if not scenario.close or not (folder / "usual" / name).exists():
        return False
    return same_files(folder / "usual" / name, folder / "out" / name)


def run_again(
    scenario: Scenario, folder: Path, usual: Undisturbed, tally: Tally | None = None
) -> list[str]:
    """The second run finishes the work, and nobody can tell."""
    tally = tally or Tally()
    tally.reruns += 1
    wrong = []
    begin = time.monotonic()
    code = start(scenario, folder, *scenario.again).wait(LONGEST_S)
    if not scenario.skips:
        tally.took(time.monotonic() - begin)
    if code != 0:
        wrong.append(f"the second run ends with {code}: {said(folder)}")
    if scenario.prints and printed(folder) != usual.printed:
        wrong.append("the second run prints something else")
    files = contents(folder / "out")
    if files != usual.files:
        off = {name for name, digest in files.items() if usual.files.get(name) != digest}
        missing = set(usual.files) - set(files)
        stay = {name for name in off if is_temporary(name)}
        off = {name for name in off - stay if not _as_usual(scenario, folder, name)}
        if missing or off:
            wrong.append(f"the second run differs: lacks {sorted(missing)}, has {sorted(off)}")
        elif stay:
            wrong.append(f"after the second run temporary files stay: {sorted(stay)}")
        else:
            tally.close += 1
    wrong += [f"the second run: {line}" for line in (*traces(folder), *changed(folder, usual))]
    return wrong


def changed(folder: Path, usual: Undisturbed) -> list[str]:
    """Inputs that are not what they were, and files where none should be."""
    wrong = [] if contents(folder / "in") == usual.inputs else ["an input changed"]
    wrong += [f"{name} in the home folder" for name in contents(folder / "home")]
    return wrong


def traces(folder: Path) -> list[str]:
    """Tracebacks among what was said."""
    text = said(folder)
    if before_it_begins(text):
        return []
    return (
        [f"traceback: {_shortened(text)}"]
        if "Traceback" in text or "Exception ignored" in text
        else []
    )


def _shortened(text: str) -> str:
    """Where it begins and how it ends."""
    return text if len(text) < 3000 else f"{text[:1500]}\n[...]\n{text[-1500:]}"


def before_it_begins(text: str) -> bool:
    """Whether this is what Python says of a Ctrl-C while it starts, with no line of ours run."""
    return "KeyboardInterrupt" in text and "/cubicfish_cli/" not in text


def _wait(process: subprocess.Popen[bytes], seconds: float) -> None:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return


def _wait_for_change(
    process: subprocess.Popen[bytes], folder: Path, usual: Undisturbed, longest: float
) -> None:
    """Until a file is there that was not, temporary or final, or one has gone."""
    until = time.monotonic() + longest
    before = set(usual.before)
    while process.poll() is None and time.monotonic() < until:
        out = folder / "out"
        if {
            os.path.relpath(os.path.join(place, name), out)
            for place, _, names in os.walk(out)
            for name in names
        } != before:
            return
        time.sleep(_STEP_S)


def left_alone(session: int) -> list[str]:
    """Processes of a session whose leader has ended and that do not end by themselves."""
    until = time.monotonic() + _GRACE_S
    while alive := of_session(session):
        if time.monotonic() > until:
            for pid in alive:
                os.kill(pid, signal.SIGKILL)
            return [f"{len(alive)} processes stay behind"]
        time.sleep(0.05)
    return []


def of_session(session: int) -> list[int]:
    """Processes of a session that are alive."""
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
