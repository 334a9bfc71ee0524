"""What was photographed: boards, the target that they make up, and the corners seen of it.

`boards/` has a class per type of board, with its keys, its corners and its markers; `target.py`
reads target.yaml and gives the world point of every corner; `placement.py` says where on a target a
grid of corners can lie; `observations.py` holds the corners of many photos, named or as points.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
