"""Options that have the work done by the workers of a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import bundle, option, record
from cubicfish_cli.cli.terminal import say

if TYPE_CHECKING:
    from cubicfish_cli.executors.executor import Executor


@record
class SchedulerOptions:
    """Where the work is done; ``address`` is None for this machine."""

    address: str | None = option(
        "--scheduler ADDRESS",
        "Have the work done by the dask workers of tcp://HOST:8786, which must see the "
        "same files under the same names (a shared file system). Only use a scheduler that "
        "you trust. Needs pip install 'cubicfish[scale]'.",
    )
    wait_s: float | None = option(
        "--wait SECONDS",
        "How long to wait while the scheduler has no worker. [default: 60]",
        FloatRange(min=0, max=1_000_000),
    )

    def check(self, jobs: int | None) -> None:
        """Refuse what does not go together."""
        if self.address is None and self.wait_s is not None:
            raise click.UsageError("--wait goes with --scheduler")
        if self.address is not None and jobs is not None:
            raise click.UsageError(
                "--jobs is for this machine: with --scheduler, 'dask worker --nthreads' says how "
                "many photos each worker does at a time"
            )

    @contextmanager
    def connected(self, *, needed: bool = True) -> Iterator[Executor | None]:
        """The cluster's workers while the block runs; None where the work is done here.

        Args:
            needed: whether there is work at all.

        Raises:
            ClusterError: they cannot be used.

        """
        if self.address is None or not needed:
            yield None
            return
        from cubicfish_cli.executors.cluster.connection import WAIT_S, connect

        with connect(self.address, wait_s=WAIT_S if self.wait_s is None else self.wait_s) as there:
            threads = count(there.threads, "thread")
            say(f"Using {count(there.workers, 'worker')} with {threads} at {self.address}.")
            yield there


scheduler_options = bundle(SchedulerOptions)
