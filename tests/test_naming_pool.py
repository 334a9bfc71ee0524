"""Worker processes, wherever temporary files are."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("letters", [0, 90])
def test_workers_start_however_long_the_name_of_the_temporary_folder_is(
    tmp_path: Path, letters: int
) -> None:
    """A socket's name is at most a hundred letters long, and a job's folder may be longer."""
    folder = tmp_path / ("x" * letters)
    folder.mkdir(exist_ok=True)
    work = "from cubicfish_cli.naming.pool import map_photos; print(*map_photos(abs, [-1, 2], 2))"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", work],
        env={**os.environ, "TMPDIR": str(folder)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.stdout.strip(), done.stderr) == ("1 2", "")
    assert list(folder.iterdir()) == []
