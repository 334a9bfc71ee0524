"""Whether photos are enough for a camera, where they are lacking, and what one more adds.

`sufficiency.py` takes from the verdict whether photos are enough, and finds coverage gaps as a
photographer would name them. `knowledge.py` has the information of a calibration's photos, and of
one more. `information_gain.py` works out the information gain of each of many photos before a
camera is fitted.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
