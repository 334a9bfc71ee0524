"""2D-3D pairs -> camera and poses.

`core/fit/calibrate.py` reads as the recipe, and `model_selection.py` as that of the target's
levels. The direction of a pixel from the image's centre does not depend on the radial profile,
which gives linear start poses without any guess (`radial_pose.py`, `start.py`). A Kannala–Brandt
lens and all poses follow (`radial_reference.py`). The cubic starts from the one nearest to the
radial reference on a cone (`nearest_cubic.py`: Eq. 8–9, then least squares in pixels) and is fitted
jointly with all poses (`cubic_fit.py`; `adjustment.py` has the residuals, their derivatives and the
steps, Eq. 10), held by a weak prior to the nearest lens of the radial reference's kind, decentred
and tilted (`asymmetric.py`, and `RayPrior` in `lenses.py`). That fixes the gauge and keeps poles
out where there are no corners. How symmetric that lens is and how firmly it holds P is chosen by
photos that are left out, to first order (`left_out.py`). `core/lenses/cubic.py` checks for poles
and folds over the whole trusted cone. Grossly wrong corners are dropped and listed, and at the end
those that depart from their neighbours (`rejection.py`). Photos count by their own noise
(`statistics.py`), and `held_out.py` says what the camera is worth on photos that it never saw.

What holds a lens or the target (`prior()`) is a Gram matrix of pseudo-observations, as what
corners say is (`NormalEquations`): they add up, and what photos put in is taken out again where
they are left out. `Adjustment` carries the type of its lens, a `FitLens` (`fit_lens.py`); `again`
adjusts on from it. `RadialReference` and `CameraFit` are adjustments with what else is known of
them. A lens that carries several cameras is known to the extension of rigs alone
(`extensions/rigs/fit/rig_lens.py`).

The target may be fitted in the same adjustment (`deformable_target.py`; as drawn it is one of which
nothing is free): boards' shapes and places are shared unknowns like the lens, corners' own offsets
a second family of small blocks beside the poses, of which `normal_equations.py` eliminates the
larger. `refinement.py` fits each level, and `model_selection.py` takes the richest by which
held-out photos gain. Before corners are fitted one by one, `orientation.py` asks which way round
photos show a target that looks the same after a turn (`core/placement.py`), and a rig's cameras are
made to agree (`extensions/rigs/fit/names.py`). `uncertainty.py` carries the corners' noise through
the normal equations to pixels, `photo_spread.py` adds what photos' shared errors do, `coverage.py`
says where corners are, and `core/assess/departure.py` measures by how much a fitted target departs
from its drawing.

The fit knows nothing of diagnosis. It hands what it knows (`FitEvidence`, or `FailedFit` where
there is none; `calibration.py`) to a function that its caller gives it, and takes findings back:
`find_faults` of `app/diagnosis/diagnose.py`.

Beside it stand `alignment.py` (the turn between the frames of two cameras), `evaluate.py` (a known
camera on other photos) and `nearest_lens` of `fit_lens.py` (any lens through given pixels). The fit
of the paper's own lift is `app/lenses/point_fit.py`.
"""
