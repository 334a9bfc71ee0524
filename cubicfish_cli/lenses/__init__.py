"""Lens models, one module each: the cubic, its radial reference, and those of other tools."""
