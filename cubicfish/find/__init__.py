"""From a photo to observations: corners, markers, and which corner of which board each one is.

`find/detection/` finds grids of corners that have no names, and `find/identification/` names them.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
