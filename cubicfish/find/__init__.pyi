"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.find.detection.finder import find_grids as find_grids
from cubicfish.find.identification.identified import PhotoReport as PhotoReport
