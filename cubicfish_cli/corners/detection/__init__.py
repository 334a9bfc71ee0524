"""Photo -> grids of sub-pixel corners."""
