"""Which photos are meant, and reading them.

`photos.py` finds files, checks their headers and reads them as they were made; `demosaic.py` knows
raw colour mosaics that were saved as grey pictures.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
