"""Targets before cameras: where they see boards well, where corners then are, and what photos show.

`views.py` samples poses from which a camera sees whole boards well; `truth.py` has the exact pixels
of corners from a pose, and which of them are visible; `faces.py` the print of a board; `photos.py`
renders photos, with rays ray by ray and a sensor that saturates, and bleeds where there is too much
light. `scene.py` holds a target and a camera together.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
