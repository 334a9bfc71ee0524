"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.workers.pool import Executor as Executor
from cubicfish.workers.pool import Work as Work
