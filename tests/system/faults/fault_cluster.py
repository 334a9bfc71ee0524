"""A dask cluster on this machine, for the commands that take --scheduler."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fault_process import environment

_SERVE = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@contextmanager
def cluster(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Two workers while the block runs; ``scheduler.txt`` and ``cluster.pid`` say where."""
    script = folder / "serve.py"
    script.write_text(_SERVE)
    with (folder / "cluster.txt").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, str(script)],
            env=environment(folder),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            start_new_session=True,
        )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        assert address, (folder / "cluster.txt").read_text()
        (folder / "scheduler.txt").write_text(address)
        (folder / "cluster.pid").write_text(str(process.pid))
        yield process
    finally:
        process.stdin.close()
        process.wait(60)
        process.stdout.close()
