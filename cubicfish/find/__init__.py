"""From a photo to observations: corners, markers, and which corner of which board each one is."""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
