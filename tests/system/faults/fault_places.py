"""Places and files that turn against a command: what it says, and what it leaves."""

import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fault_kills import Undisturbed, changed, left_alone, not_right, of_session, run_again, traces
from fault_process import LONGEST_S, SCHEDULER, printed, said
from fault_scenarios import Scenario, clear, contents, finished, put_back, start

Problem = Callable[[Scenario, Path, Undisturbed], list[str] | None]


def may_mount() -> bool:
    """Whether a tmpfs of its own can be had here."""
    if os.geteuid() != 0:
        return False
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "none", folder], capture_output=True
        )
        if made.returncode == 0:
            subprocess.run(["umount", folder], check=True)
        return made.returncode == 0


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[None]:
    """A file system of ``size`` bytes at ``folder``."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def full_disk(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """Disks that hold none, a half and nearly all of the results."""
    if scenario.prints or not may_mount():
        return None
    wrong = []
    older, whole = _pages(folder / "before"), _pages(folder / "usual")
    for share in (0.02, 0.5, 0.95):
        clear(folder)
        with small_disk(folder / "out", _PAGE * (1 + older + int(share * whole))):
            put_back(folder)
            other = folder / "out" / "other"  # else one page, the least there is, may be enough
            other.write_bytes(bytes(_PAGE))
            code = start(scenario, folder).wait(LONGEST_S)
            other.unlink()
            wrong += _failed(scenario, folder, usual, code, "a full disk")
    return wrong


def read_only_folder(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """The folder of the results takes no files."""
    if scenario.prints:
        return None
    clear(folder)
    if os.geteuid() == 0:  # permissions do not bind root
        if not may_mount():
            return None
        with small_disk(folder / "out", 1 << 24):
            put_back(folder)
            subprocess.run(["mount", "-o", "remount,ro", str(folder / "out")], check=True)
            code = start(scenario, folder).wait(LONGEST_S)
            return _failed(scenario, folder, usual, code, "a read-only folder")
    (folder / "out").chmod(0o500)
    try:
        code = start(scenario, folder).wait(LONGEST_S)
        return _failed(scenario, folder, usual, code, "a read-only folder")
    finally:
        (folder / "out").chmod(0o700)


def no_home(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """The cache folder's place is taken by a file: the work goes on without."""
    clear(folder)
    (folder / "cache").write_text("a file\n")
    code = start(scenario, folder).wait(LONGEST_S)
    (folder / "cache").unlink()
    wrong = [] if code == 0 else [f"without a cache it ends with {code}: {said(folder)}"]
    if _differs(scenario, folder, usual):
        wrong.append("without a cache the result differs")
    return wrong + traces(folder)


def results_exist(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """Files of the user bear the results' names: they stay as they are."""
    if scenario.prints or scenario.before:
        return None
    wrong = []
    for name in usual.files:
        clear(folder)
        mine = folder / "out" / name
        mine.parent.mkdir(parents=True, exist_ok=True)
        mine.write_text("mine\n")
        code = start(scenario, folder).wait(LONGEST_S)
        if code != 1:
            wrong.append(f"with {name} there it ends with {code}")
        if mine.read_text() != "mine\n":
            wrong.append(f"{name} was overwritten")
        wrong += traces(folder) + changed(folder, usual)
    return wrong


def input_vanishes(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """Inputs go, one at a time, while the command runs."""
    return _while_running(scenario, folder, usual, lambda path: path.unlink(), "vanished")


def input_is_cut(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """Inputs lose their second half while the command runs."""

    def cut(path: Path) -> None:
        os.truncate(path, path.stat().st_size // 2)

    return _while_running(scenario, folder, usual, cut, "was cut")


def worker_is_killed(scenario: Scenario, folder: Path, usual: Undisturbed) -> list[str] | None:
    """A process that does the work is ended from outside, as when memory runs out."""
    wrong = []
    for delay in (0.0, 0.02, 0.1, 0.3):
        clear(folder)
        process = start(scenario, folder)
        if SCHEDULER in scenario.args:
            child = _worker_of_cluster(process, folder)
        else:
            child = _child_of(process)
        if child is None:
            return None
        time.sleep(delay)
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        try:
            code = process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return [*wrong, "it hangs when a worker is killed"]
        wrong += left_alone(process.pid)
        if code == 0 and _differs(scenario, folder, usual):
            wrong.append("a worker was killed, and the result differs")
        elif code != 0:
            wrong += _failed(scenario, folder, usual, code, "a killed worker")
        if SCHEDULER in scenario.args and code != 0:
            wrong.append("the other worker did not do the work")
    return wrong


PROBLEMS: dict[str, Problem] = {
    "full disk": full_disk,
    "read-only folder": read_only_folder,
    "no cache": no_home,
    "results exist": results_exist,
    "input vanishes": input_vanishes,
    "input is cut": input_is_cut,
    "worker killed": worker_is_killed,
}


_PAGE = 4096


def _pages(folder: Path) -> int:
    """How many pages of a tmpfs the files below a folder take."""
    return sum(-(-path.stat().st_size // _PAGE) for path in folder.rglob("*") if path.is_file())


def _differs(scenario: Scenario, folder: Path, usual: Undisturbed) -> bool:
    """Whether the results are not all there, or are others than usual."""
    if scenario.prints:
        return printed(folder) != usual.printed
    files = contents(folder / "out")
    right = not_right(scenario, folder, usual, files, killed=False)
    return bool(right) or set(files) != set(usual.files)


def _failed(
    scenario: Scenario, folder: Path, usual: Undisturbed, code: int, what: str
) -> list[str]:
    """It ended with one line; what it finished is right, and there is nothing else."""
    wrong = [] if code == 1 else [f"{what}: exit code {code}: {said(folder)}"]
    lines = [line for line in said(folder).splitlines() if line.startswith("Error: ")]
    if len(lines) != 1:
        wrong.append(f"{what}: said {said(folder)!r}")
    left = contents(folder / "out")
    if finished(left) != left:
        wrong.append(f"{what}: temporary files stay")
    right = not_right(scenario, folder, usual, left, killed=False)
    wrong += [f"{what}: {line}" for line in right]
    return wrong + traces(folder) + changed(folder, usual)


def _while_running(
    scenario: Scenario,
    folder: Path,
    usual: Undisturbed,
    spoil: Callable[[Path], None],
    what: str,
) -> list[str]:
    wrong = []
    inputs = sorted((folder / "in").rglob("*"))
    kept = folder / "kept"
    shutil.copytree(folder / "in", kept)
    try:
        for path in (path for path in inputs if path.is_file()):
            for share in (0.3, 0.7):
                clear(folder)
                timer = threading.Timer(share * usual.seconds, spoil, [path])
                process = start(scenario, folder)
                timer.start()
                code = process.wait(LONGEST_S)
                timer.join()
                name = path.relative_to(folder)
                if code not in (0, 1):
                    wrong.append(f"{name} {what}: exit code {code}: {said(folder)}")
                if code == 1 and "Error: " not in said(folder):
                    wrong.append(f"{name} {what}: said {said(folder)!r}")
                after = contents(folder / "out")
                if finished(after) != after:
                    wrong.append(f"{name} {what}: temporary files stay")
                if code == 0 and _differs(scenario, folder, usual):
                    # It came too late to notice: then this is what such an input gives.
                    as_printed = printed(folder)
                    clear(folder)
                    code = start(scenario, folder).wait(LONGEST_S)
                    same = contents(folder / "out") == after
                    if scenario.prints:
                        same = printed(folder) == as_printed
                    if code or not same:
                        wrong.append(f"{name} {what}: the result is that of neither input")
                wrong += traces(folder)
                shutil.rmtree(folder / "in")
                shutil.copytree(kept, folder / "in")
    finally:
        shutil.rmtree(kept)
    clear(folder)
    return wrong + run_again(scenario, folder, usual)


def _child_of(process: subprocess.Popen[bytes]) -> int | None:
    """The last process that it started, once there is one that has loaded its work."""
    until = time.monotonic() + 30
    while process.poll() is None and time.monotonic() < until:
        children = [pid for pid in of_session(process.pid) if pid != process.pid]
        if len(children) >= 3:  # the server, the tracker of resources, and a worker
            return max(children)
        time.sleep(0.01)
    return None


def _worker_of_cluster(process: subprocess.Popen[bytes], folder: Path) -> int | None:
    """One of the cluster's workers, once it has work."""
    session = int((folder / "cluster.pid").read_text())
    while process.poll() is None and "Using 2 workers" not in said(folder):
        time.sleep(0.01)
    workers = [
        pid
        for pid in of_session(session)
        if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    return min(workers, default=None)
