"""Other tools' lenses and their files: what all of them have in common.

Each model is a `ForeignLens` (`foreign_lens.py`), whose fields are its parameters: formats read and
write these objects. Scaramuzza's polynomial and mrcal's splines have a fit of their own
(`nearest_to`). The models themselves are in the extension of formats. `to_lens.py` finds the lens
nearest to a cubic camera, `from_lens.py` the cubic camera nearest to a lens. What is written into
files, and the checks of what is read from them, stand in `file_contents.py`; `foreign_files.py`
tells which format a file is of. The formats are the tables of the extension's formats.toml.

Beside them stands `point_fit.py`, the fit of the paper's literal model, on points instead of rays
(`core/lenses/point.py`).
"""
