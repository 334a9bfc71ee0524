"""What is likely wrong with a set-up, told from its corners: hypotheses, tested by cheap fits.

`HYPOTHESES` of `app/diagnosis/diagnose.py` lists every kind of thing that may be wrong with a
set-up: by which kind of evidence it is judged, the function that explains it, and when it applies.
`find_faults` tries those of one evidence in the order of the table, each knowing what was found
before. The library hands it to the fit and to rigs, and asks it itself about photos. A right set-up
costs a pass over its corners (`photo_lenses.py`); beyond that, things are fitted only where the fit
is worse than its corners' own noise, or was refused, and grids are named again (`object_faults.py`)
only where many fit nowhere. What belongs to one slip stands in one module: mirrors in
`mirrored.py`, counts of corners in `corner_count.py`, markers in `markers.py`, drawings and boards
that are doubted in `wrong_drawing.py` and `object_faults.py`, two groups of photos with a lens each
in `two_lenses.py`, photos each by itself in `photo_lenses.py`, photos from one place in
`repeats.py`, and photos that were left out, or have to be, in `left_out.py`. Kinds of evidence are
in `evidence.py`, and those of a fit in `core/fit/calibration.py`. Every hypothesis is judged
against what it would explain by chance: `tests/support/wrong_setups.py` holds wrong set-ups and
right ones. `object_check.py` says what is odd about a target before any photo.
"""
