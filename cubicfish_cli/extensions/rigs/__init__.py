"""Commands for several cameras on one body: each is a module of its name.

Of films, `extensions/rigs/films.py` is the recipe: `film_clocks.py` matches clocks by motion,
`moments.py` takes moments out, and the fit (`rigs/times.py`) finds what is left. `panorama.py` asks
all cameras as one and blends them; `lens_rig.py` joins them to other tools' lenses, which the
formats write from one `LensRig` (`foreign/file_contents.py`).
"""
