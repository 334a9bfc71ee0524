"""The cubic camera and the lenses that its fit needs.

`radial.py` is the radial reference, a `Lens` (`lens.py`) as those of other tools above the core
are. `nearest.py` fits any of them to pixels of rays, through `FreeLens`, which is what the
adjustment takes too. `sphere.py` finds rays of pixels by Newton's method, for these and for
`CubicCamera`, which is no `Lens`: its parameters are gauged (`CubicFit` in `core/fit/lenses.py`),
its field is measured. `PointCamera` has no rays at all. A `FreeLens` of the reference, and with
priors `BentFit` and `CubicFit` of `core/fit/`, are what the solver adjusts.
"""
