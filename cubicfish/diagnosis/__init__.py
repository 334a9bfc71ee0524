"""What is likely wrong with a set-up: hypotheses about its corners, tested by cheap fits.

`HYPOTHESES` of `diagnosis/diagnose.py` lists every kind of thing that may be wrong with a
set-up: the kind of evidence that it is judged by, the function that explains it, and when it
applies. `find_faults` tries those of one evidence in the order of the table; each knows the earlier
findings. Callers hand it to the fit and to rigs, and call it themselves about photos. A right
set-up costs a pass over its corners (`photo_lenses.py`). Beyond that, things are fitted only where
the fit is worse than its corners' own noise, or was refused, and grids are named again
(`object_faults.py`) only where many fit nowhere. Each slip has one module: mirrors `mirrored.py`,
counts of corners `corner_count.py`, markers `markers.py`, wrong nominal targets
(target.yaml) and doubted boards `wrong_nominal.py` and `object_faults.py`, two groups of photos
with a lens each `two_lenses.py`, photos each by itself `photo_lenses.py`, what is another in every
photo `anew.py`, photos that were mirrored, turned or reduced, unlike most, `saved_otherwise.py`,
photos from one place `repeats.py`, and photos left out, or to be left out, `rejected_photos.py`.
Kinds of evidence are in `evidence.py`, and those of a fit in `fit/calibration.py`. Every hypothesis
is compared with what it would explain by chance: `tests/support/wrong_setups.py` has wrong set-ups
and right ones.
`object_check.py` says what is odd about a target before any photo is taken.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
