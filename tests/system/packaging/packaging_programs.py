"""Programs that are installed somewhere, run one command a process, without a network."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from packaging_runs import Sandbox, Step, wrongly_written

GUARD = Path(__file__).with_name("guard")
SAMPLE = Path(__file__).parents[3] / "sample_data"
LONGEST_S = 600.0


@functools.cache
def without_network() -> tuple[str, ...]:
    """What to put before a command so that the kernel gives it no network, where it lets us."""
    for prefix in (("unshare", "-n"), ("unshare", "-r", "-n")):
        if (
            shutil.which(prefix[0])
            and not subprocess.run([*prefix, "true"], capture_output=True, check=False).returncode
        ):
            return prefix
    return ()


@dataclass(frozen=True, kw_only=True)
class Program:
    """cubicfish, as some Python has it.

    Attributes:
        python: that Python.
        path: folders that come before what is installed there.

    """

    python: Path
    path: tuple[Path, ...] = field(default=())

    def environment(self, sandbox: Sandbox, record: Path) -> dict[str, str]:
        """Where it runs, with every warning an error and no network."""
        return sandbox.environment(
            PYTHONPATH=os.pathsep.join(map(str, [GUARD, *self.path])),
            PYTHONWARNINGS="error",
            GUARD_RECORD=str(record),
        )

    def has(self, extra: str) -> bool:
        """Whether the libraries of an extra are there."""
        needed = {"report": "matplotlib, jinja2", "exr": "OpenEXR", "video": "av"}[extra]
        options = subprocess.run(
            [self.python, "-c", f"import {needed}"], capture_output=True, check=False
        )
        return options.returncode == 0

    def versions(self) -> str:
        """The libraries that are there, and their versions."""
        options = subprocess.run(
            [self.python, "-c", _VERSIONS], capture_output=True, text=True, check=True
        )
        return options.stdout.strip()

    def is_here(self, sandbox: Sandbox) -> bool:
        """Whether what runs is what was installed, and not what some checkout has."""
        options = subprocess.run(
            [self.python, "-c", "import cubicfish_cli; print(cubicfish_cli.__file__)"],
            cwd=sandbox.work, env=self.environment(sandbox, sandbox.base / "none"),
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        found = Path(options.stdout.strip())
        wanted = self.path[0] if self.path else self.python.parents[1]
        return found.is_relative_to(wanted)


_VERSIONS = """
import sys
from importlib.metadata import PackageNotFoundError, version
names = "opencv-python-headless numpy scipy click PyYAML rich platformdirs threadpoolctl av "
print(f"Python {sys.version.split()[0]}", end="")
for name in (names + "OpenEXR matplotlib jinja2 dask distributed").split():
    try:
        print(f", {name} {version(name)}", end="")
    except PackageNotFoundError:
        pass
"""


def try_steps(
    program: Program,
    steps: Sequence[Step],
    sandbox: Sandbox,
    *,
    tell: Callable[[str], None],
    more: Mapping[str, str] | None = None,
) -> list[str]:
    """Run steps in a sandbox; what went wrong, a line each."""
    record = sandbox.base.with_name(sandbox.base.name + ".guard")
    environment = {**program.environment(sandbox, record), **(more or {})}
    wrong: list[str] = []
    for step in steps:
        before = sandbox.files()
        start = time.monotonic()
        done = subprocess.run(
            [*without_network(), program.python, "-W", "error", "-m", "cubicfish_cli",
             *(arg.format(sample=SAMPLE) for arg in step.args)],
            cwd=sandbox.work, env=environment, input=step.input, capture_output=True, text=True,
            timeout=LONGEST_S, check=False,
        )  # fmt: skip
        seconds = time.monotonic() - start
        here = wrongly_written(step, before, sandbox.files())
        if done.returncode != step.code:
            said = (done.stderr.strip().splitlines() or ["nothing"])[-1]
            here.append(f"exit code {done.returncode}: {said}")
        if "Warning" in done.stderr or "Traceback" in done.stderr:
            here.append(f"said: {done.stderr.strip()[-2000:]}")
        if record.exists():
            lines = record.read_text(encoding="utf-8").splitlines()
            here += [line for line in lines if line.startswith("network")]
            record.unlink()
        tell(f"  {seconds:6.1f} s  {'WRONG' if here else 'right'}  {step.name}")
        for line in here:
            tell(f"      {line}")
        wrong += [f"{step.name}: {line}" for line in here]
    return wrong
