"""Commands for several cameras on one body: each is a module of its name.

`calibrate.py` runs the stages that one camera has (`stages.py`). Of films,
`extensions/rigs/films.py` is the recipe: `film_clocks.py` matches clocks by motion, `moments.py`
takes moments out, and the fit (`rigs/times.py`) finds what is left. `lens_rig.py` joins cameras to
other tools' lenses, which the formats write from one `LensRig` (`foreign/file_contents.py`).
"""
