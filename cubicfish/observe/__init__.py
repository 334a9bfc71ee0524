"""Corners of one photo, or what the cache knows of it, and of many photos, found and named.

`detection.py` is the recipe. `photo_detection.py` reads one photo and finds its nameless grids, or
why there are none, and remembers what was found in it (`GridCache`). A photo in which nothing is
found, or a part of a board of small squares, is also searched at twice its size. `workers/pool.py`
shares photos out to processes, and `find/identification/` decides which board each grid is. What is
wrong where grids fit nowhere, or are named as other corners, `detection.py` asks of `diagnosis/`.
`glances.py` says roughly what many pictures of one camera show, before any is searched in full.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
