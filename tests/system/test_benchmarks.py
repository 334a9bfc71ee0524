"""Each benchmark finds what it imports: nothing else runs them from one release to the next."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
FOREIGN = {"peer_mrcal.py"}  # for another tool's Python
LOAD = (
    "import runpy, sys; sys.path[0] = sys.argv[1]; runpy.run_path(sys.argv[2], run_name='loaded')"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.name for path in FOLDER.glob("*.py")} - FOREIGN))
def test_a_benchmark_can_be_loaded(name):
    # A process of its own, since this one has the folders of the tests on its path.
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(FOLDER), str(FOLDER / name)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
