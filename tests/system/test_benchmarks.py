"""Each benchmark finds what it imports: nothing else runs them from one release to the next."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
LOAD = (
    "import runpy, sys; sys.path[0] = sys.argv[1]; runpy.run_path(sys.argv[2], run_name='loaded')"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "file", sorted([*FOLDER.glob("*.py"), *FOLDER.glob("open/*.py")]), ids=lambda file: file.name
)
def test_a_benchmark_can_be_loaded(file):
    # A process of its own, since this one has the folders of the tests on its path.
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(file.parent), str(file)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
