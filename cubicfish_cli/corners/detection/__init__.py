"""Photo -> grids of sub-pixel corners.

`finder.py` is the recipe: saddles of brightness (`corners.py`, `saddle.py`) are linked (`links.py`)
and grow into lattices (`growth.py`, `lattice.py`), whose corners are fitted (`crossing.py`) and
accepted or not (`accept.py`). `markers.py` is the recipe for boards whose markers name their
corners, with the modules of its name. `diagnose.py` says why a photo shows no grid.
"""
