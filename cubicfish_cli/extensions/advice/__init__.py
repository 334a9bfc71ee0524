"""What to photograph next: where the camera is uncertain, and which photos would help most.

`app/viewpoints/views.py` samples poses from which a camera sees whole boards well;
`simulate.py` chooses those that fill the field and renders them, with rays that are worked out once
for all photos (`RayGrid`), and makes grey levels of light, burnt out and bleeding where there is
too much. `AsymmetricLens` of tests/support is of the family that P is held to, and flatters what
leans on that: the lenses of `synthetic_lenses.py` there are of none, `simulated.py` makes corners
through any lens without pictures, with errors as those of photos, and `synthetic_films.py` renders
films of a hand that moves a target. `extensions/advice/knowledge.py` fits a calibration again from
its record. What photos say of a camera adds up (`Information` in `information.py`), so
`proposals.py` can tell for every sampled pose what its corners would leave of the uncertainty,
takes the best, then the best after that one. The squares of the field are counted once, in
`FieldCells` (`core/fit/coverage.py`), for coverage, report and advice. `enough.py` of
`app/sufficiency` names what is missing as a photographer would, goes by the verdict on whether
photos are enough, and gives one line from the record alone (`summary`).
"""
