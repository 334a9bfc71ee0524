"""Whether the target is drawn wrongly, as grids and photos show it."""
