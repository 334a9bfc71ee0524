"""Run a chain of commands in this one process, as its user would, and tell what each did.

    python -W error packaging_chain.py BASE SAMPLE RECORD [COMMAND...]

BASE is a sandbox, and this process lives in it; RECORD becomes one JSON object a step. Commands
may write anything into the working folder; without any, it is the usual chain.
"""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from packaging_runs import QUICK, Sandbox, Step, wrongly_written


def run(step: Step, sample: str) -> object:
    """The exit code of a command."""
    from cubicfish_cli.terminal.start import main

    sys.argv = ["cubicfish", *(arg.format(sample=sample) for arg in step.args)]
    sys.stdin = io.TextIOWrapper(io.BytesIO(step.input.encode()))
    try:
        main()
    except SystemExit as ending:
        return ending.code or 0
    return 0


def chain(base: Path, sample: str, record: Path, steps: list[Step]) -> None:
    """Run the steps and append what each did to ``record``."""
    # Temporary files may be there until the process ends.
    sandbox = Sandbox(base=base, free=("tmp/*",))
    os.chdir(sandbox.work)
    before = sandbox.files()
    for step in steps:
        code = run(step, sample)
        after = sandbox.files()
        wrong = wrongly_written(step, before, after)
        before = after
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step.name, "code": code, "wrong": wrong}) + "\n")


def main() -> None:
    """Run what the arguments say."""
    base, sample, record, *lines = sys.argv[1:]
    steps = [Step(args=tuple(line.split()), writes=("*",)) for line in lines] or list(QUICK)
    chain(Path(base), sample, Path(record), steps)


if __name__ == "__main__":
    main()
