"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.workers.cluster import connect as connect
from cubicfish.workers.pool import Executor as Executor
