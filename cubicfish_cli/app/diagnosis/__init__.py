"""What is likely wrong with a set-up, told from its corners: hypotheses, tested by cheap fits.

`HYPOTHESES` of `app/diagnosis/diagnose.py` lists every kind of thing that may be wrong with a
set-up: by which kind of evidence it is judged, the codes that it may find, what it costs, when it
applies, and the function that explains it. `find_faults` tries those of one evidence from the
cheapest on, each knowing what was found before, and tells them in the order of the table. The
library hands it to the fit and to rigs, and asks it itself about photos. A right set-up costs a
pass over its corners (`photo_lenses.py`); beyond that, things are fitted only where the fit is
worse than its corners' own noise, or was refused, and grids are named again (`object_faults.py`)
only where many fit nowhere. What belongs to one slip stands in one module: mirrors in
`mirrored.py`, counts in `corner_count.py` (`counts.py` counts), photos that are lost alike in
`lost_photos.py`, rows of markers in `marker_layout.py`, gaps of tags and places in
`wrong_drawing.py`, orders of corners and axes in `object_faults.py`, two groups of photos with a
lens each in `two_lenses.py`, photos each by itself in `odd_photos.py`, and what the difference
between two lenses is in `other_lens.py`. Every hypothesis is judged against what it would explain
by chance: `tests/support/wrong_setups.py` holds wrong set-ups and right ones. `object_check.py`
says what is odd about a target before any photo.
"""
