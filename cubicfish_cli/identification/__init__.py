"""Grids -> named corners: which grid is which board of the target, and which corner is (0, 0)."""
