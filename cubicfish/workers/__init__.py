"""Executors: processes of this machine, or of a cluster.

Whoever works on many photos takes a `Work` (`workers/pool.py`): how many processes, who is told how
far it is, and maybe an `Executor`: something that does a function of one item on many items, and
answers as they are done. Several processes of this machine are those of `workers/processes.py`.
`connect` makes one of a cluster, a `Cluster` (`workers/cluster.py`), and nothing of dask is loaded
without it. It makes each item a task and notices when workers or scheduler are lost; `do_one` is
what runs in a worker: it checks versions and answers with errors as values. The work is unpickled
once per process, so that maps are made once there. A task may run twice, so the right to write is
settled before the work begins and tasks replace what they wrote.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
