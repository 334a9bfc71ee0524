"""Grids -> named corners: which grid is which board of the target, and which corner is (0, 0).

`observe/detection.py` calls what is here. Markers name their boards' corners at once
(`identified.py`). Plain boards are named by geometry (`name_grids.py`): all grids as nameless
planes give the lens (`scene.py`), and with it known every place on the target is tried photo by
photo (`search.py`, `decide.py`), with what cannot be decided left out, and once more with the
boards where they are. `second_pass.py` then searches where corners are missing and a fitted camera
expects them, boards without markers on a marked target among them. `quick_detect.py` does all that
roughly, for pictures of films. All this needs lenses: it imports `fit/`.
"""
