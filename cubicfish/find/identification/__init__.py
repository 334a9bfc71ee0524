"""Grids -> named corners: which grid is which board of the target, and which corner is (0, 0).

`observe/detection.py` is the recipe. `observe/photo_detection.py` reads one photo and finds its
nameless grids, or why there are none, and remembers what was found in it (`GridCache`). A photo in
which nothing is found, or a part of a board of small squares, is also searched at twice its size.
`workers/pool.py` shares photos out to processes. `find/identification/`
decides which board each grid is. Markers name their boards' corners at once (`identified.py`).
Plain boards are named by geometry (`name_grids.py`): all grids as nameless planes give the lens
(`scene.py`), and with it known every place on the target is tried photo by photo (`search.py`,
`decide.py`), with what cannot be decided left out, and once more with the boards where they are.
What is wrong where grids fit nowhere, or are named as other corners, `observe/detection.py` asks
of `diagnosis/`. `second_pass.py` then searches where corners are missing and a fitted camera
expects them, boards without markers on a marked target among them. All this needs lenses: it
imports `fit/`.
"""
