"""Which photos are meant, and reading them."""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
