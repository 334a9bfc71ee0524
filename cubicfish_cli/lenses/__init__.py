"""Lens models: the cubic, its radial reference, and those of other tools."""
