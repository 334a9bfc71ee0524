"""Each benchmark finds what it imports: nothing else runs them from one release to the next."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
LOAD = """
import runpy, sys
from pathlib import Path

folder, *files = sys.argv[1:]
sys.path[0] = folder  # what a script finds beside itself
for file in files:
    print(file, flush=True)
    runpy.run_path(file, run_name="loaded")
"""


@pytest.mark.slow
@pytest.mark.parametrize("folder", [FOLDER, FOLDER / "open"], ids=lambda folder: folder.name)
def test_benchmarks_can_be_loaded(folder):
    files = sorted(str(file) for file in folder.glob("*.py"))
    assert files
    # A process of its own, since this one has the folders of the tests on its path. All of them
    # share what they import.
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(folder), *files], capture_output=True, text=True
    )
    assert done.returncode == 0, f"{done.stdout.splitlines()[-1]}: {done.stderr}"
