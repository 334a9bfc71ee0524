"""The cubic camera and the lenses that its fit needs.

`radial.py` is the radial reference, a `Lens` (`lens.py`). Those of other tools are a `FormulaLens`
(`formula_lens.py`): fields that are parameters, and a formula. `sphere.py` finds rays of pixels by
Newton's method, for these and for `CubicCamera`, which is no `Lens`: its parameters are gauged
(`CubicFit` in `fit/lenses.py`), its field is measured. `lift.py` has the 20 monomials, and
`pupil.py` where a near point is seen. `PointCamera`, of the paper's own lift, has no rays at all;
its fit is `fit/point_fit.py`. What the solver adjusts is a `FitLens` (`solve/fit_lens.py`): a
`FreeLens` of any `Lens`, or with priors `DecentredFit` and `CubicFit`.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
