"""Photo -> grids of sub-pixel corners.

`finder.py` is the recipe: a photo is searched at the scales of its ladder (`ladder.py`), from the
coarse end. At one scale (`search.py`) saddles of brightness (`corners.py`, `saddle.py`) are linked
(`links.py`). Pieces that look promising (`seeds.py`) grow into lattices (`growth.py`,
`lattice.py`), some of whose corners are fitted (`crossing.py`, `refine.py`) to accept them or not
(`accept.py`). Each grid is then completed and refined at finer scales (`follow.py`). `markers.py`
is the recipe for boards whose markers name their corners, with the modules of its name.
`diagnose.py` says why a photo shows no grid.
"""
