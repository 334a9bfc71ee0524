"""Camera -> views and maps.

A `View` says which ray each pixel looks along, from the camera's place (`view.py`, with a
`Projection` for each kind) or onto a plane (`plane.py`). `fields.py` finds what a camera sees of a
view, and the field that suits it. `maps.py` asks the camera for the pixel of each ray, in blocks of
rows on two threads. For the cubic camera `cubic_grid.py` does that by a few products of small
matrices per picture, in one way for each kind of view: `tests/cubicfish/views/test_projections.py`
compares each with the plain way. `CubicCamera.for_photos` makes the camera of a rescaled photo, so
that no other code deals with rescaled photos. What people ask of a view, and which one suits a
camera, is in `options.py` and `choose.py`. `render.py` straightens a picture, and `bands.py` writes
maps for which there is no room in memory.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
