"""Whether photos are enough for a camera, where they are lacking, and what one more adds.

`sufficiency.py` takes from the verdict whether photos are enough, names coverage gaps as a
photographer would, and sums both up in a line (`summary`). `information_gain.py` works out the
information gain of each of many photos before a camera is fitted.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
