"""What to photograph next: where the camera is uncertain, and which photos would help most.

`scene/views.py` samples poses from which a camera sees whole boards well.
The library fits a calibration again from its record (`sufficiency/knowledge.py`). The information
of photos adds up, so `proposals.py` can predict for every sampled pose what uncertainty its corners
would leave, and takes the best pose, then the best one after that. `FieldCells` (`fit/coverage.py`)
counts the squares of the field, for coverage, report and advice. `sufficiency/sufficiency.py` says
whether photos are enough, for `calibrate` too.
"""
