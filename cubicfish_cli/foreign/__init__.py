"""Other tools' lenses and their files: what all of them have in common.

Each model is a `ForeignLens` (`foreign_lens.py`), whose fields are its parameters: formats read and
write these objects. Scaramuzza's polynomial and mrcal's splines have a fit of their own
(`nearest_to`). The models themselves are in the extension of formats. `to_lens.py` finds the lens
nearest to a cubic camera, `from_lens.py` the cubic camera nearest to a lens. `file_contents.py` has
the records that are written into files, and checks what is read from them; `foreign_files.py`
recognises the format of a file. The formats are the tables of the extension's formats.toml.

Beside them stands `point_fit.py`, the fit of the paper's literal model, on points instead of rays
(`models/point.py`).
"""
