"""Other tools' lenses and their files: what all of them have in common.

Each model is a `ForeignLens` (`foreign_lens.py`), whose fields are its parameters: formats read and
write these objects. Scaramuzza's polynomial and mrcal's splines have a fit of their own
(`nearest_to`). The models themselves are in the extension of formats. `to_lens.py` finds the lens
nearest to a cubic camera, `from_lens.py` the cubic camera nearest to a lens, `camera_format.py`
says what a format of files offers, and `foreign_files.py` finds formats by name.
"""
