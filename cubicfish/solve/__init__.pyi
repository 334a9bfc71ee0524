"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.solve.fit_lens import nearest_lens as nearest_lens
from cubicfish.solve.poses import Poses as Poses
