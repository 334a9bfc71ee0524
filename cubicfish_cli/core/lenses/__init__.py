"""Lens models: the cubic, its radial reference, and those of other tools.

`core/lenses/` has a module for each model or family of models, listed in `registry.py`: the radial
reference, the models of `--compare`, those of other tools' files, and that of the prior. Each is
a `Lens` (`lens.py`), whose fields are its parameters: formats read and write these objects and
know no formula. `nearest.py` fits any of them to pixels of rays, through `FreeLens`, which is
what the adjustment takes too; f-theta, Scaramuzza's polynomial and mrcal's splines have a fit of
their own (`nearest_to`). `sphere.py` finds rays of pixels by Newton's method, for these and for
`CubicCamera`, which is no `Lens`: its parameters are gauged (`CubicFit` in `core/fit/lenses.py`),
its field is measured. `PointCamera` has no rays at all. A `FreeLens` of any model (of
`RadialCamera` for the reference), and with priors `BentFit` and `CubicFit` of `core/fit/`, are
what the solver adjusts.
"""
