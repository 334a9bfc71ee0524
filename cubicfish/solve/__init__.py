"""Least squares over poses, a target and any lens that has slopes.

`adjustment.py` is the Levenberg-Marquardt loop, over the blocks of `normal_equations.py`;
`poses.py` moves cameras, `deformable_target.py` boards and corners, `fit_lens.py` says what a lens
must offer. `leave_one_out.py` takes single photos away again without another fit. `statistics.py`
has the noise and the errors of residuals, `subset.py` parts of observations.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
