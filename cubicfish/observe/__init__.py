"""Corners of one photo, or what the cache knows of it, and of many photos, found and named."""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
