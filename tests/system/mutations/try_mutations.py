"""Break the maths one line at a time, and see whether the tests notice.

    python tests/system/mutations/try_mutations.py
    python tests/system/mutations/try_mutations.py --only fitting/

Works on a copy of the project. Exit code 1 when a fault went by unnoticed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from mutations import MUTATIONS, Mutation

PROJECT = Path(__file__).resolve().parents[3]


def noticed_by(mutation: Mutation, copy: Path) -> str | None:
    """The test that failed, or None."""
    module = copy / mutation.module
    text = module.read_text(encoding="utf-8")
    module.write_text(text.replace(mutation.right, mutation.wrong), encoding="utf-8")
    try:
        files = [f"tests/{name}.py" for name in mutation.tests]
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *files],
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        module.write_text(text, encoding="utf-8")
    if run.returncode == 0:
        return None
    failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if run.returncode != 1 or not failed:
        sys.exit(f"pytest itself failed with {mutation.module}:\n{run.stdout}{run.stderr}")
    return failed[0].split(" - ")[0].removeprefix("FAILED tests/")


def main() -> int:
    """Try every mutation and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="modules whose path holds this")
    chosen = [m for m in MUTATIONS if parser.parse_args().only in m.module]
    unnoticed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "project"
        shutil.copytree(
            PROJECT, copy, ignore=shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache")
        )
        for mutation in chosen:
            test = noticed_by(mutation, copy)
            unnoticed += test is None
            wrong = " ".join(mutation.wrong.split())
            print(f"{mutation.module:<34} {wrong:<62} {test or 'UNNOTICED'}", flush=True)
    print(f"{len(chosen)} faults, {len(chosen) - unnoticed} noticed")
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main())
