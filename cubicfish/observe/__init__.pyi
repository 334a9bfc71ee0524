"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.observe.detection import find_corners as find_corners
from cubicfish.observe.glances import Glances as Glances
