"""What to photograph next: where the camera is uncertain, and which photos would help most.

`app/viewpoints/views.py` samples poses from which a camera sees whole boards well.
`extensions/advice/knowledge.py` fits a calibration again from its record. What photos say of a
camera adds up (`Information` in `information.py`), so `proposals.py` can tell for every sampled
pose what its corners would leave of the uncertainty, takes the best, then the best after that one.
The squares of the field are counted once, in `FieldCells` (`core/fit/coverage.py`), for coverage,
report and advice. Whether photos are enough is said by `app/sufficiency/enough.py`, for `calibrate`
too.
"""
